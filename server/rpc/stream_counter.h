#pragma once

#include <atomic>
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

  int count() const { return count_; }

  // Waits until there are none; false if `deadline` passes first.
  bool WaitForNone(absl::Time deadline);

 private:
  std::mutex mutex_;
  std::condition_variable none_;
  std::atomic<int> count_ = 0;  // written under mutex_
};

}  // namespace planish
