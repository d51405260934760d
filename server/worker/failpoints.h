// Fault injection, for tests of what a server does when a worker fails (planish.worker.v1.WorkRequest.failpoint).
#pragma once

#include <functional>
#include <string>
#include <string_view>

#include "absl/status/status.h"
#include "absl/status/statusor.h"

namespace planish {

// Where a fault may strike, in the order of a job:
//   start   before anything is done         encode  before the result is put together
//   decode  before the mesh is decoded      result  before the result is sent
//   solve   at the first solver report      idle    after the result was sent, before the worker says it is idle
// and what may happen there:
//   abort        abort()
//   segv         writes where no memory is
//   exit         exits with code 42
//   hang         sleeps for ever, ignoring cancellation
//   spin         computes for ever, ignoring cancellation
//   oom          allocates until there is no memory: std::bad_alloc
//   oom-thread   the same on another thread, where nobody catches it
//   garbage      sends bytes that are not a message
//   mute         closes the link and goes on
//   probe        tries what a sandbox should refuse and ends the job with Probe()
struct Failpoint {
  std::string point;  // empty: none
  std::string action;

  // From "POINT=ACTION". INVALID_ARGUMENT with REQUEST_INVALID for a name that is not above.
  static absl::StatusOr<Failpoint> Parse(std::string_view text);
};

// Functions of the worker that the actions "garbage" and "mute" call.
struct FailpointHooks {
  std::function<void()> send_garbage;
  std::function<void()> close_link;
};

// Performs the action of `failpoint` if `point` is its point. Returns the status that the job must end with, or OK.
absl::Status ReachPoint(const Failpoint& failpoint, std::string_view point, const FailpointHooks& hooks);

// Tries to open a file and a socket, to start a program and a process, and to signal and trace others. Returns INTERNAL
// with reason PROBE; its metadata have, for each attempt, "allowed" or the errno's name, and some limits of the
// process.
absl::Status Probe();

}  // namespace planish
