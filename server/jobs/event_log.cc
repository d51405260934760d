#include "server/jobs/event_log.h"

#include <algorithm>
#include <utility>

namespace planish {

void JobEventLog::Append(v1::JobEvent event) {
  const std::lock_guard lock(mutex_);
  AppendLocked(std::move(event));
}

void JobEventLog::AppendLast(v1::JobEvent event, std::shared_ptr<const std::string> uv) {
  const std::lock_guard lock(mutex_);
  if (ended_) return;
  AppendLocked(std::move(event));
  ended_ = true;
  uv_ = std::move(uv);
}

void JobEventLog::AppendLocked(v1::JobEvent event) {
  if (ended_) return;
  event.set_sequence(++last_sequence_);
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
    return read;
  }
  read.event = *next;
  read.event->set_skipped(next->sequence() - after - 1);
  return read;
}

std::shared_ptr<const std::string> JobEventLog::uv() const {
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
