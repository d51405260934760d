// How many files of a batch are in flight, that is in memory and with the server.
#pragma once

#include <condition_variable>
#include <cstdint>
#include <mutex>

namespace planish::cli {

// Begins with the server's workers and some more, so that the next mesh is there when a worker is free. A job that did
// not have to wait at all, later than the first few, shows that the server takes more; a full queue, that it takes
// less. Thread-safe.
class BatchFlight {
 public:
  // Files of together more than `most_bytes` are not in flight at a time, unless it is a single one.
  BatchFlight(int workers, std::int64_t most_bytes);

  // The limit is never above this: so many threads are enough.
  int most() const { return most_; }
  int limit() const;

  // Waits until there is room for a file of `bytes`; false after Stop().
  bool Enter(std::int64_t bytes);
  void Leave(std::int64_t bytes);
  // Nobody enters any more.
  void Stop();

  void OnQueueFull();
  // A job ended that had waited for a worker for so long.
  void OnDone(double queue_seconds);

 private:
  const int most_;
  const std::int64_t most_bytes_;
  mutable std::mutex mutex_;  // guards what follows
  std::condition_variable changed_;
  int limit_;
  int in_flight_ = 0;
  int first_jobs_;  // that have yet to end: they had the workers for themselves
  std::int64_t bytes_ = 0;
  bool stopped_ = false;
};

}  // namespace planish::cli
