#include "server/jobs/event_log.h"

#include <algorithm>
#include <utility>

#include "server/store/lifecycle.h"

namespace planish {

void JobEventLog::Restore(v1::JobEvent event, StoredBlobPtr uv) {
  const std::lock_guard lock(mutex_);
  if (!ended_ && event.sequence() > last_sequence_) Hold(std::move(event), std::move(uv));
}

bool JobEventLog::Append(v1::JobEvent event, StoredBlobPtr uv) {
  const std::lock_guard lock(mutex_);
  if (ended_ || event.sequence() <= last_sequence_) return true;
  if (event.sequence() != last_sequence_ + 1) return false;
  Hold(std::move(event), std::move(uv));
  return true;
}

void JobEventLog::Interrupt(const absl::Status& status) {
  const std::lock_guard lock(mutex_);
  if (ended_) return;
  ended_ = true;
  status_ = status;
}

void JobEventLog::Hold(v1::JobEvent event, StoredBlobPtr uv) {
  last_sequence_ = event.sequence();
  if (event.has_job() && IsTerminal(event.job().state())) {
    ended_ = true;
    uv_ = std::move(uv);
  }
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

bool JobEventLog::ended() const {
  const std::lock_guard lock(mutex_);
  return ended_;
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
