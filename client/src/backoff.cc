#include "client/src/backoff.h"

#include <algorithm>
#include <cmath>
#include <functional>

namespace planish {
inline namespace abi0 {

Backoff::Backoff(double first_seconds, double longest_seconds, std::string_view seed)
    : first_(first_seconds), longest_(longest_seconds), random_(std::hash<std::string_view>()(seed)) {}

double Backoff::Next() {
  const double pause = std::min(longest_, std::ldexp(first_, std::min(count_++, 30)));
  random_ = random_ * 6364136223846793005u + 1442695040888963407u;  // Knuth's MMIX: good enough to spread clients
  return pause * (0.5 + std::ldexp(static_cast<double>(random_ >> 11), -54));
}

}  // namespace abi0
}  // namespace planish
