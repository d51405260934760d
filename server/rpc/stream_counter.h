#pragma once

#include <condition_variable>
#include <mutex>

#include "absl/time/time.h"

namespace planish {

// Counts the streams under way, so that a shutdown can wait for the last events to be delivered. (grpc::Server's own
// shutdown waits for connections instead, and a client that is idle does not close its own.) Thread-safe.
class StreamCounter {
 public:
  void Add();
  void Remove();

  // Waits until there are none; false if `deadline` passes first.
  bool WaitForNone(absl::Time deadline);

 private:
  std::mutex mutex_;
  std::condition_variable none_;
  // Guarded by mutex_.
  int count_ = 0;
};

}  // namespace planish
