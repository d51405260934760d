#pragma once

#include <chrono>

#include "absl/time/time.h"

namespace planish {

// The time of a clock that nobody sets, from an arbitrary beginning: for how long something takes in this process.
inline absl::Time SteadyNow() {
  return absl::UnixEpoch() + absl::FromChrono(std::chrono::steady_clock::now().time_since_epoch());
}

}  // namespace planish
