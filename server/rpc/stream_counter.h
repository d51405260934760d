#pragma once

#include <atomic>
#include <condition_variable>
#include <cstdint>
#include <memory>
#include <mutex>
#include <vector>

#include "absl/time/time.h"

namespace planish {

// A call that receives a stream, and may wait for its caller without limit.
class Interruptible {
 public:
  virtual ~Interruptible() = default;

  // Ends the call soon with UNAVAILABLE, DRAINING. Called on any thread, at most once.
  virtual void Interrupt() = 0;
};

// Counts open streams, so that a shutdown can wait until the last events are delivered. (grpc::Server's own shutdown
// waits for connections instead, and idle clients do not close theirs.) Thread-safe.
class StreamCounter {
 public:
  void Add();
  void Remove();

  int count() const { return count_; }

  // Total bytes of UV that streams have sent.
  void AddUvBytes(std::int64_t bytes) { uv_bytes_ += bytes; }
  std::int64_t uv_bytes() const { return uv_bytes_; }

  // Waits until no stream is open. False if `deadline` passes first.
  bool WaitForNone(absl::Time deadline);

  // Registers a call for InterruptSenders(). If that was called before, the call is interrupted at once.
  void AddSender(const std::shared_ptr<Interruptible>& call);
  // Interrupts all registered calls. If the server only closed its sockets, some of them would end with CANCELLED, as
  // if the caller had given up, and the caller would not come back.
  void InterruptSenders();

 private:
  std::mutex mutex_;
  std::vector<std::weak_ptr<Interruptible>> senders_;  // guarded by mutex_; may have expired
  bool interrupted_ = false;                           // guarded by mutex_
  std::condition_variable none_;
  std::atomic<int> count_ = 0;  // written under mutex_
  std::atomic<std::int64_t> uv_bytes_ = 0;
};

}  // namespace planish
