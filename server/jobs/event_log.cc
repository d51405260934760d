#include "server/jobs/event_log.h"

#include <algorithm>
#include <utility>

namespace planish {

void JobEventLog::Restore(v1::JobEvent event, std::int64_t reserved) {
  const std::lock_guard lock(mutex_);
  last_sequence_ = std::max(event.sequence(), reserved);
  Hold(std::move(event));
}

std::int64_t JobEventLog::Append(v1::JobEvent event) {
  const std::lock_guard lock(mutex_);
  return ended_ ? 0 : AppendLocked(std::move(event));
}

std::int64_t JobEventLog::AppendLast(v1::JobEvent event, StoredBlobPtr uv) {
  const std::lock_guard lock(mutex_);
  if (ended_) return 0;
  ended_ = true;
  uv_ = std::move(uv);
  return AppendLocked(std::move(event));
}

void JobEventLog::End(StoredBlobPtr uv) {
  const std::lock_guard lock(mutex_);
  ended_ = true;
  uv_ = std::move(uv);
}

void JobEventLog::Interrupt(const absl::Status& status) {
  const std::lock_guard lock(mutex_);
  if (ended_) return;
  ended_ = true;
  status_ = status;
}

std::int64_t JobEventLog::AppendLocked(v1::JobEvent event) {
  event.set_sequence(++last_sequence_);
  Hold(std::move(event));
  return last_sequence_;
}

void JobEventLog::Hold(v1::JobEvent event) {
  events_.push_back(std::move(event));
  if (events_.size() <= capacity_) return;
  const auto oldest =
      std::find_if(events_.begin(), events_.end(), [](const v1::JobEvent& held) { return held.has_progress(); });
  if (oldest != events_.end()) events_.erase(oldest);
}

void JobEventLog::Notify() const {
  std::vector<Subscription> live;
  {
    const std::lock_guard lock(mutex_);
    std::erase_if(subscribers_, [](const auto& subscriber) { return subscriber.expired(); });
    for (const auto& subscriber : subscribers_) live.push_back(subscriber.lock());
  }
  for (const Subscription& subscriber : live) {
    if (subscriber != nullptr) (*subscriber)();
  }
}

JobEventLog::Read JobEventLog::ReadAfter(std::int64_t after) const {
  const std::lock_guard lock(mutex_);
  const auto next = std::upper_bound(events_.begin(), events_.end(), after,
                                     [](std::int64_t a, const v1::JobEvent& held) { return a < held.sequence(); });
  Read read;
  if (next == events_.end()) {
    read.ended = ended_;
    read.status = status_;
    return read;
  }
  read.event = *next;
  read.event->set_skipped(next->sequence() - after - 1);
  return read;
}

std::int64_t JobEventLog::last_sequence() const {
  const std::lock_guard lock(mutex_);
  return last_sequence_;
}

StoredBlobPtr JobEventLog::uv() const {
  const std::lock_guard lock(mutex_);
  return uv_;
}

JobEventLog::Subscription JobEventLog::Subscribe(std::function<void()> wake) const {
  auto subscription = std::make_shared<const std::function<void()>>(std::move(wake));
  const std::lock_guard lock(mutex_);
  std::erase_if(subscribers_, [](const auto& subscriber) { return subscriber.expired(); });
  subscribers_.push_back(subscription);
  return subscription;
}

}  // namespace planish
