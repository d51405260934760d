// Decides when a call is retried after an error.
#pragma once

#include <chrono>
#include <optional>
#include <random>
#include <string>

#include "planish/error.h"

namespace planish {

// When a call must have ended; empty: no limit.
using Deadline = std::optional<std::chrono::system_clock::time_point>;
Deadline DeadlineAfter(Seconds timeout);  // 0: never

// Whether `error` means that the upload of a mesh is gone, so that it must be restarted.
bool IsUploadGone(const Error& error);

// The attempts of one call. Temporary errors are those of the network, of a server that shuts down, of a server that is
// full and says when to retry, and of a mesh's upload that must be repeated or resumed.
class Retry {
 public:
  struct Limits {
    Seconds lost{0};         // how long to wait for a lost server
    Seconds full{0};         // how long to wait for room on a full server
    Seconds first_pause{0};  // after a lost connection; doubles up to 5 s, with jitter
    Deadline deadline;       // of the whole call
  };

  Retry(std::string target, const Limits& limits);

  // To be called after progress: the limits then count from the next error on.
  void Reset();

  // Returns how long to wait after `error` before the next attempt. Throws `error` if it is not temporary, or if the
  // server was never `reached`. Throws CONNECTION_LOST or, if the server is full, `error` if the wait would exceed the
  // limit; DEADLINE_EXCEEDED if it would exceed the deadline.
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
