// What operators see and change while jobs wait and run.
#include <algorithm>

#include "core/base/error.h"
#include "google/protobuf/util/time_util.h"
#include "server/jobs/job_manager.h"

namespace planish {

void JobManager::SetLimits(const JobLimits& limits) {
  const std::lock_guard lock(mutex_);
  options_.queue_capacity = limits.queue_capacity;
  options_.retained_jobs = limits.retained_jobs;
  options_.retained_bytes = limits.retained_bytes;
  options_.retained_time = limits.retained_time;
  options_.reattach_grace = limits.reattach_grace;
  queue_.set_capacity(limits.queue_capacity);
  next_expiry_ = absl::InfinitePast();
  // Jobs whose callers are gone were to be looked at after the grace that there was.
  for (const auto& [name, live] : live_) {
    if (live.orphaned < absl::InfiniteFuture()) alarms_.emplace(live.orphaned + limits.reattach_grace, name);
  }
}

JobLimits JobManager::Limits() const {
  const std::lock_guard lock(mutex_);
  return {options_.queue_capacity, options_.retained_jobs, options_.retained_bytes, options_.retained_time,
          options_.reattach_grace};
}

ManagerStats JobManager::Stats() const {
  using google::protobuf::util::TimeUtil;
  ManagerStats stats;
  stats.stored_bytes = blobs_->bytes();
  stats.store_bytes = blobs_->max_bytes();
  const std::lock_guard lock(mutex_);
  stats.draining = draining_;
  stats.workers = options_.workers;
  stats.reserved_memory_bytes = reserved_memory_;
  stats.memory_bytes = options_.memory_bytes;
  std::map<std::string, TenantStats> tenants;
  for (const auto& [name, live] : live_) {
    const v1::Job& job = live.record.job();
    const bool waits = job.state() == v1::JOB_STATE_QUEUED;
    TenantStats& tenant = tenants[job.tenant()];
    ++(waits ? stats.queued : stats.running);
    ++(waits ? tenant.queued : tenant.running);
    if (!waits) continue;
    const absl::Time came = absl::FromUnixNanos(TimeUtil::TimestampToNanoseconds(job.create_time()));
    stats.oldest_wait = std::max(stats.oldest_wait, options_.clock() - came);
  }
  for (auto& [name, tenant] : tenants) {
    tenant.tenant = name;
    stats.tenants.push_back(tenant);
  }
  return stats;
}

absl::Status JobManager::Undrain() {
  const std::lock_guard lock(mutex_);
  if (ending_) {
    return MakeError(absl::StatusCode::kFailedPrecondition, "SHUTTING_DOWN",
                     "the server is shutting down: that cannot be taken back");
  }
  draining_ = false;
  return absl::OkStatus();
}

}  // namespace planish
