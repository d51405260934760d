#include "server/store/ids.h"

#include <algorithm>
#include <cstdint>
#include <random>
#include <utility>

#include "absl/strings/ascii.h"
#include "absl/strings/str_cat.h"

namespace planish {
namespace {

// As long as a label of a DNS name, such as a pod's.
constexpr std::size_t kLongestInstanceName = 63;

}  // namespace

std::string RandomId() {
  thread_local std::random_device entropy;  // opening it takes longer than reading it
  const std::uint64_t id = (std::uint64_t{entropy()} << 32) | std::uint64_t{entropy()};
  return absl::StrCat(absl::Hex(id, absl::kZeroPad16));
}

bool IsInstanceName(std::string_view name) {
  return !name.empty() && name.size() <= kLongestInstanceName && std::all_of(name.begin(), name.end(), [](char c) {
    return absl::ascii_islower(static_cast<unsigned char>(c)) || absl::ascii_isdigit(static_cast<unsigned char>(c)) ||
           c == '-';
  });
}

std::function<std::string()> IdsOf(std::string instance) {
  if (instance.empty()) return RandomId;
  return [instance = std::move(instance)] { return absl::StrCat(instance, ".", RandomId()); };
}

}  // namespace planish
