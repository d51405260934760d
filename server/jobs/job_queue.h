#pragma once

#include <cstdint>
#include <deque>
#include <optional>
#include <string>

namespace planish {

// Jobs that wait for a worker, first in, first out. Not thread-safe.
class JobQueue {
 public:
  // At most `capacity` jobs (>= 0) with meshes of `max_bytes` in all may wait. A job never waits in vain for bytes:
  // an empty queue takes a mesh of any size.
  JobQueue(int capacity, std::int64_t max_bytes) : capacity_(capacity), max_bytes_(max_bytes) {}

  // Whether a job with a mesh of `bytes` may be pushed while `idle_workers` are about to take jobs off.
  bool HasRoom(std::int64_t bytes, int idle_workers) const;

  void Push(const std::string& name, std::int64_t bytes);

  // The job that waited longest; empty if none does.
  std::optional<std::string> Pop();

  // No effect if the job does not wait.
  void Remove(const std::string& name);

  // Jobs ahead of `name`, 0 if it does not wait. Linear in the queue's length.
  int Position(const std::string& name) const;

  bool empty() const { return entries_.empty(); }

 private:
  struct Entry {
    std::string name;
    std::int64_t bytes;
  };

  const int capacity_;
  const std::int64_t max_bytes_;
  std::deque<Entry> entries_;
  std::int64_t bytes_ = 0;
};

}  // namespace planish
