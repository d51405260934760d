// What happens to a job of locked work when an attempt reports or ends, or a time limit passes.
#pragma once

#include <algorithm>
#include <cstdint>
#include <vector>

#include "absl/status/status.h"
#include "absl/time/time.h"
#include "google/rpc/status.pb.h"
#include "planish/v1/job.pb.h"
#include "server/store/job_store.h"
#include "server/store/job_transaction.h"

namespace planish {

// Adds an event for each progress message.
absl::Status AddProgress(JobTransaction* transaction, const std::vector<v1::Progress>& progress, JobChange* change);
// Ends the job with the worker's result.
absl::Status Deliver(JobTransaction* transaction, const AttemptOutcome& outcome, JobChange* change);
// The attempt was lost with its worker: queues the job again, or fails it after the last attempt.
absl::Status Lose(JobTransaction* transaction, const AttemptOutcome::Loss& loss, JobChange* change);
// The attempt needed more memory than was reserved: queues the job again with `memory_bytes`.
absl::Status Enlarge(JobTransaction* transaction, std::int64_t memory_bytes, JobChange* change);
// Ends or stops the job if one of its time limits has passed.
absl::Status EndIfOverdue(JobTransaction& transaction, const LockedWork& work, JobChange* change);
// The error of a job whose last attempt was lost with its server.
google::rpc::Status ServerCrashed(int attempts);

// When the job must be ended or stopped; infinite future: never.
struct JobLimitTimes {
  absl::Time callers = absl::InfiniteFuture();  // its callers are gone
  absl::Time timeout = absl::InfiniteFuture();  // Scheduling.timeout
  absl::Time budget = absl::InfiniteFuture();   // Scheduling.compute_budget

  absl::Time First() const { return std::min({callers, timeout, budget}); }
};
JobLimitTimes LimitTimesOf(const JobRecord& record);

}  // namespace planish
