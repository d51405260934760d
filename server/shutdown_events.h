// The events that the main thread of planishd waits for.
#pragma once

#include "absl/time/time.h"

namespace planish {

enum class Wake {
  kSignal,          // SIGTERM or SIGINT
  kReload,          // SIGHUP
  kSupervisorGone,  // the supervisor's end of the socket was closed; reported once
  kIdle,            // NotifyIdle() was called; reported once
  kFailed,          // NotifyFailed() was called; reported once
  kTimeout,
};

// Blocks SIGTERM, SIGINT and SIGHUP and receives them itself. Construct it before any thread starts, once in a process.
// A supervised server ignores SIGINT: Ctrl-C in a terminal reaches the whole process group, and the supervisor must be
// able to cancel its job first.
class ShutdownEvents {
 public:
  // `supervisor_fd`: see ServerFlags; this object takes ownership. -1: none.
  explicit ShutdownEvents(int supervisor_fd);
  ~ShutdownEvents();
  ShutdownEvents(const ShutdownEvents&) = delete;
  ShutdownEvents& operator=(const ShutdownEvents&) = delete;

  // Writes "ready\n" to the supervisor, if there is one.
  void TellReady();

  // Waits at most `timeout`. Call it from one thread.
  Wake Wait(absl::Duration timeout);

  // Make Wait() return kIdle or kFailed. Thread-safe.
  void NotifyIdle();
  void NotifyFailed();

 private:
  bool SupervisorGone();

  int supervisor_fd_;  // -1: none, or gone
  int signal_fd_;
  int idle_fd_;
  int failed_fd_;
};

}  // namespace planish
