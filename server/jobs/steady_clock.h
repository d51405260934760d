#pragma once

#include <chrono>

#include "absl/time/time.h"

namespace planish {

// The time of a steady clock with an arbitrary start, to measure durations within this process.
inline absl::Time SteadyNow() {
  return absl::UnixEpoch() + absl::FromChrono(std::chrono::steady_clock::now().time_since_epoch());
}

}  // namespace planish
