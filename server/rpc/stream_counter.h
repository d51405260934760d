#pragma once

#include <atomic>
#include <condition_variable>
#include <cstdint>
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

  // Bytes of UV that streams were given to send, ever.
  void AddUvBytes(std::int64_t bytes) { uv_bytes_ += bytes; }
  std::int64_t uv_bytes() const { return uv_bytes_; }

  // Waits until there are none; false if `deadline` passes first.
  bool WaitForNone(absl::Time deadline);

 private:
  std::mutex mutex_;
  std::condition_variable none_;
  std::atomic<int> count_ = 0;  // written under mutex_
  std::atomic<std::int64_t> uv_bytes_ = 0;
};

}  // namespace planish
