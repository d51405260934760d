#include "server/store/ids.h"

#include "absl/strings/str_cat.h"
#include "core/base/random_id.h"

namespace planish {

std::string RandomId() {
  return absl::StrCat(absl::Hex(Entropy(), absl::kZeroPad16));
}

}  // namespace planish
