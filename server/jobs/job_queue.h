#pragma once

#include <cstdint>
#include <optional>
#include <set>
#include <string>
#include <unordered_map>

#include "absl/time/time.h"
#include "planish/v1/job.pb.h"

namespace planish {

// When a job that came at `create_time` counts as having come (planish.v1.Priority).
absl::Time QueueTime(absl::Time create_time, v1::Priority priority);

// What waits for a worker, oldest QueueTime() first. Not thread-safe.
class JobQueue {
 public:
  // At most `capacity` entries (>= 0) with meshes of `max_bytes` in all may wait. A job never waits in vain for bytes:
  // an empty queue takes a mesh of any size.
  JobQueue(int capacity, std::int64_t max_bytes) : capacity_(capacity), max_bytes_(max_bytes) {}

  // What waits stays, also beyond a lower capacity.
  void set_capacity(int capacity) { capacity_ = capacity; }

  // Whether an entry with a mesh of `bytes` may be pushed while `idle_workers` are about to take entries off.
  bool HasRoom(std::int64_t bytes, int idle_workers) const;

  // `number` decides between equal times, the lower first. A `name` that waits is put in its new place.
  void Push(const std::string& name, std::int64_t bytes, absl::Time time, std::int64_t number);

  // The name that is next; empty if none waits.
  std::optional<std::string> Front() const;

  // No effect if the name does not wait.
  void Remove(const std::string& name);

  // Entries ahead of `name`, 0 if it does not wait. Linear in the queue's length.
  int Position(const std::string& name) const;

  bool empty() const { return entries_.empty(); }
  int size() const { return static_cast<int>(entries_.size()); }

 private:
  struct Entry {
    absl::Time time;
    std::int64_t number = 0;
    std::string name;
    std::int64_t bytes = 0;

    bool operator<(const Entry& other) const { return time != other.time ? time < other.time : number < other.number; }
  };

  int capacity_;
  const std::int64_t max_bytes_;
  std::set<Entry> entries_;
  std::unordered_map<std::string, std::set<Entry>::iterator> places_;
  std::int64_t bytes_ = 0;
};

}  // namespace planish
