#pragma once

#include <atomic>
#include <condition_variable>
#include <cstdint>
#include <memory>
#include <mutex>
#include <vector>

#include "absl/time/time.h"

namespace planish {

// A call by which a caller sends, and which may wait for the caller without end.
class Interruptible {
 public:
  virtual ~Interruptible() = default;

  // Ends the call soon with UNAVAILABLE, DRAINING. Any thread; at most once.
  virtual void Interrupt() = 0;
};

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

  // The call is interrupted with the others as long as it lives, or at once if that has been.
  void AddSender(const std::shared_ptr<Interruptible>& call);
  // Interrupts the calls of AddSender(). A server that only closed its sockets would end some of them with CANCELLED,
  // as if the caller had given up, and the caller would not come back.
  void InterruptSenders();

 private:
  std::mutex mutex_;
  std::vector<std::weak_ptr<Interruptible>> senders_;  // guarded by mutex_; some may be gone
  bool interrupted_ = false;                           // guarded by mutex_
  std::condition_variable none_;
  std::atomic<int> count_ = 0;  // written under mutex_
  std::atomic<std::int64_t> uv_bytes_ = 0;
};

}  // namespace planish
