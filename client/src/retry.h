// When a call is made again after an error: the one place where that is decided.
#pragma once

#include <chrono>
#include <optional>
#include <random>
#include <string>

#include "planish/error.h"

namespace planish {

// When a call must be over; nothing: never.
using Deadline = std::optional<std::chrono::system_clock::time_point>;
Deadline DeadlineAfter(Seconds timeout);  // 0: never

// Whether `error` says that the upload of a mesh is gone: it must begin again.
bool IsUploadGone(const Error& error);

// The attempts of one call. An error passes if it comes from the network, from a server that goes down, or from one
// that is full and says when to come back.
class Retry {
 public:
  struct Limits {
    Seconds lost{0};         // how long a server that was lost is waited for
    Seconds full{0};         // and room on one that is full
    Seconds first_pause{0};  // after a loss; doubles, up to 5 s, a little at random
    Deadline deadline;       // of the whole call
  };

  Retry(std::string target, const Limits& limits);

  // Something came through: limits count from the next error on.
  void Reset();

  // How long to wait after `error` before the next attempt. Throws `error` if it will not pass, or the server was never
  // `reached`; CONNECTION_LOST or, where the server is full, `error` when the limit is over, and DEADLINE_EXCEEDED.
  Seconds PauseAfter(const Error& error, bool reached);

 private:
  using Clock = std::chrono::steady_clock;

  const std::string target_;
  const Limits limits_;
  std::minstd_rand random_{std::random_device()()};
  int losses_ = 0;
  std::optional<Clock::time_point> lost_since_, full_since_;
};

}  // namespace planish
