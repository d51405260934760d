#include "server/jobs/job_queue.h"

#include <iterator>

namespace planish {
namespace {

// What a class of priority is worth in time of waiting.
constexpr absl::Duration kPriorityStep = absl::Minutes(10);

}  // namespace

absl::Time QueueTime(absl::Time create_time, v1::Priority priority) {
  if (priority == v1::PRIORITY_HIGH) return create_time - kPriorityStep;
  if (priority == v1::PRIORITY_LOW) return create_time + kPriorityStep;
  return create_time;
}

bool JobQueue::HasRoom(std::int64_t bytes, int idle_workers) const {
  if (static_cast<std::int64_t>(entries_.size()) >= std::int64_t{capacity_} + idle_workers) return false;
  return entries_.empty() || bytes <= max_bytes_ - bytes_;
}

void JobQueue::Push(const std::string& name, std::int64_t bytes, absl::Time time, std::int64_t number) {
  Remove(name);
  places_[name] = entries_.insert({time, number, name, bytes}).first;
  bytes_ += bytes;
}

std::optional<std::string> JobQueue::Front() const {
  if (entries_.empty()) return std::nullopt;
  return entries_.begin()->name;
}

void JobQueue::Remove(const std::string& name) {
  const auto place = places_.find(name);
  if (place == places_.end()) return;
  bytes_ -= place->second->bytes;
  entries_.erase(place->second);
  places_.erase(place);
}

int JobQueue::Position(const std::string& name) const {
  const auto place = places_.find(name);
  if (place == places_.end()) return 0;
  return static_cast<int>(std::distance(entries_.begin(), std::set<Entry>::const_iterator(place->second)));
}

}  // namespace planish
