// The reason why no worker can be started.
#pragma once

#include <mutex>

#include "absl/status/status.h"
#include "absl/strings/str_cat.h"
#include "core/base/error.h"
#include "server/shutdown_events.h"

namespace planish {

// Passes this reason from the pool's threads to the main thread. Thread-safe.
class NoWorkers {
 public:
  void Set(const absl::Status& last, ShutdownEvents* events) {
    {
      const std::lock_guard lock(mutex_);
      status_ = MakeError(absl::StatusCode::kUnavailable, "NO_WORKERS",
                          absl::StrCat("no worker can be started: ", last.message()));
    }
    events->NotifyFailed();
  }

  absl::Status status() {
    const std::lock_guard lock(mutex_);
    return status_;
  }

 private:
  std::mutex mutex_;
  absl::Status status_;  // guarded by mutex_
};

}  // namespace planish
