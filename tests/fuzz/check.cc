#include "tests/fuzz/check.h"

#include <algorithm>
#include <cstdlib>
#include <iostream>
#include <string>

#include "core/base/error.h"

// What libFuzzer calls.
extern "C" int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size);

extern "C" int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size) {
  planish::fuzz::Targets().begin()->second({reinterpret_cast<const char*>(data), size});
  return 0;
}

namespace planish::fuzz {

std::map<std::string, Target>& Targets() {
  static auto* targets = new std::map<std::string, Target>;
  return *targets;
}

void Require(bool kept, std::string_view promise) {
  if (kept) return;
  std::cerr << "broken promise: " << promise << std::endl;
  std::abort();
}

void RequireReason(const absl::Status& status, std::initializer_list<std::string_view> reasons) {
  const std::string reason = ErrorInfoOf(status).reason;
  const bool expected = !status.ok() && std::find(reasons.begin(), reasons.end(), reason) != reasons.end();
  Require(expected, "an error of a reason that is documented, not " + status.ToString());
  Require(!status.message().empty(), "an error has a message");
}

int Bytes::Byte() {
  const std::string_view taken = Take(1);
  return taken.empty() ? 0 : static_cast<unsigned char>(taken[0]);
}

std::string_view Bytes::Take(std::size_t size) {
  const std::string_view taken = rest_.substr(0, size);
  rest_.remove_prefix(taken.size());
  return taken;
}

}  // namespace planish::fuzz
