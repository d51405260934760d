// The manager, as those see it who watch a server.
#include <algorithm>

#include "google/protobuf/util/time_util.h"
#include "server/jobs/job_manager.h"

namespace planish {

JobGauges JobManager::Gauges() const {
  JobGauges gauges;
  const std::lock_guard lock(mutex_);
  const absl::Time now = options_.clock();
  for (const auto& [name, live] : live_) {
    const v1::Job& job = live.record.job();
    if (job.state() != v1::JOB_STATE_QUEUED) {
      ++gauges.running[job.tenant()];
      continue;
    }
    const v1::Priority asked = job.scheduling().priority();
    const v1::Priority priority = asked == v1::PRIORITY_UNSPECIFIED ? v1::PRIORITY_NORMAL : asked;
    JobGauges::Waiting& waiting = gauges.queued[{job.tenant(), priority}];
    ++waiting.jobs;
    const auto created = google::protobuf::util::TimeUtil::TimestampToNanoseconds(job.create_time());
    waiting.longest = std::max(waiting.longest, now - absl::FromUnixNanos(created));
  }
  gauges.busy_workers = queue_.running();
  gauges.reserved_memory_bytes = reserved_memory_;
  gauges.draining = draining_;
  return gauges;
}

bool JobManager::IsDraining() const {
  const std::lock_guard lock(mutex_);
  return draining_;
}

}  // namespace planish
