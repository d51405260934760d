#include "server/jobs/job_queue.h"

#include <algorithm>

namespace planish {

bool JobQueue::HasRoom(std::int64_t bytes, int idle_workers) const {
  if (static_cast<std::int64_t>(entries_.size()) >= std::int64_t{capacity_} + idle_workers) return false;
  return entries_.empty() || bytes_ + bytes <= max_bytes_;
}

void JobQueue::Push(const std::string& name, std::int64_t bytes) {
  entries_.push_back({name, bytes});
  bytes_ += bytes;
}

std::optional<std::string> JobQueue::Pop() {
  if (entries_.empty()) return std::nullopt;
  const Entry entry = entries_.front();
  entries_.pop_front();
  bytes_ -= entry.bytes;
  return entry.name;
}

void JobQueue::Remove(const std::string& name) {
  const auto entry =
      std::find_if(entries_.begin(), entries_.end(), [&](const Entry& held) { return held.name == name; });
  if (entry == entries_.end()) return;
  bytes_ -= entry->bytes;
  entries_.erase(entry);
}

int JobQueue::Position(const std::string& name) const {
  const auto entry =
      std::find_if(entries_.begin(), entries_.end(), [&](const Entry& held) { return held.name == name; });
  return entry == entries_.end() ? 0 : static_cast<int>(entry - entries_.begin());
}

}  // namespace planish
