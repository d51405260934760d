// What operators change while jobs wait and run.
#include "server/jobs/job_manager.h"

namespace planish {

void JobManager::SetLimits(const JobLimits& limits) {
  const std::lock_guard lock(mutex_);
  options_.limits = limits;
  queue_.set_capacity(limits.queue_capacity);
  next_expiry_ = absl::InfinitePast();
  // Jobs whose callers are gone were to be looked at after the grace that there was.
  for (auto& [name, live] : live_) {
    if (live.orphaned < absl::InfiniteFuture()) SetAlarm(live, live.orphaned + limits.reattach_grace);
  }
}

JobLimits JobManager::Limits() const {
  const std::lock_guard lock(mutex_);
  return options_.limits;
}

}  // namespace planish
