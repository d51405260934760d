#pragma once

#include <cstdint>
#include <string_view>

namespace planish {
inline namespace abi0 {

// Between attempts to reach a server that was lost.
inline constexpr double kLongestPauseSeconds = 5;

// Pauses between attempts: each about twice as long as the one before. Clients that lost the same server at the same
// moment come back at different ones, as long as their seeds differ.
class Backoff {
 public:
  Backoff(double first_seconds, double longest_seconds, std::string_view seed);

  // Seconds to wait, between half and all of first * 2^n, at most the longest.
  double Next();

  // After a success: the next pause is the first again.
  void Reset() { count_ = 0; }

 private:
  const double first_;
  const double longest_;
  std::uint64_t random_;
  int count_ = 0;
};

}  // namespace abi0
}  // namespace planish
