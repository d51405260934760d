#include "server/store/ids.h"

#include <cstdint>
#include <random>

#include "absl/strings/str_cat.h"

namespace planish {

std::string RandomId() {
  thread_local std::random_device entropy;  // opening it takes longer than reading it
  const std::uint64_t id = (std::uint64_t{entropy()} << 32) | std::uint64_t{entropy()};
  return absl::StrCat(absl::Hex(id, absl::kZeroPad16));
}

}  // namespace planish
