// What the targets of this folder have in common.
#pragma once

#include <cstddef>
#include <cstdint>
#include <initializer_list>
#include <map>
#include <string>
#include <string_view>

#include "absl/status/status.h"

// FUZZ_TARGET(requests, bytes) { .. } defines and registers the target "requests", a function that tries one input,
// `bytes`. Every promise that it finds broken ends the process. To be used within a namespace.
#define FUZZ_TARGET(name, bytes)                                                                         \
  static void Try(std::string_view bytes);                                                               \
  [[maybe_unused]] static const bool registered = ::planish::fuzz::Targets().emplace(#name, Try).second; \
  static void Try(std::string_view bytes)

namespace planish::fuzz {

using Target = void (*)(std::string_view bytes);

// Of this program, by name. libFuzzer's programs have one each.
std::map<std::string, Target>& Targets();

// Unless `kept`, says on stderr which promise was broken and aborts: a finding, for libFuzzer as for a test.
void Require(bool kept, std::string_view promise);

// The same for an error that `status` must be: of one of the `reasons`, with a message for people.
void RequireReason(const absl::Status& status, std::initializer_list<std::string_view> reasons);

// An input that is read as a list of small numbers and pieces. Past its end there are zeros and empty pieces.
class Bytes {
 public:
  explicit Bytes(std::string_view bytes) : rest_(bytes) {}

  bool empty() const { return rest_.empty(); }
  int Byte();
  int Below(int n) { return Byte() % n; }
  std::string_view Take(std::size_t size);
  std::string_view Rest() { return Take(rest_.size()); }

 private:
  std::string_view rest_;
};

}  // namespace planish::fuzz
