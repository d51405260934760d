// What the targets of this folder have in common.
#pragma once

#include <cstddef>
#include <cstdint>
#include <initializer_list>
#include <string_view>

#include "absl/status/status.h"

// Tries one input; every promise that it finds broken ends the process.
extern "C" int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size);

namespace planish::fuzz {

// Unless `kept`, says on stderr which promise was broken and aborts: a finding, for libFuzzer as for a test.
void Require(bool kept, std::string_view promise);

// The same for an error that `status` must be: of one of the `reasons`, with a message for people.
void RequireReason(const absl::Status& status, std::initializer_list<std::string_view> reasons);

// An input that is read as a list of small numbers and pieces. Past its end there are zeros and empty pieces.
class Bytes {
 public:
  Bytes(const std::uint8_t* data, std::size_t size) : rest_(reinterpret_cast<const char*>(data), size) {}

  bool empty() const { return rest_.empty(); }
  int Byte();
  int Below(int n) { return Byte() % n; }
  std::string_view Take(std::size_t size);
  std::string_view Rest() { return Take(rest_.size()); }

 private:
  std::string_view rest_;
};

}  // namespace planish::fuzz
