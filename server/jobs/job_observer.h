// For whoever counts what a JobManager does.
#pragma once

#include <cstdint>
#include <map>
#include <string>
#include <utility>

#include "absl/time/time.h"
#include "planish/v1/job.pb.h"
#include "planish/worker/v1/worker.pb.h"
#include "server/link/worker_link.h"

namespace planish {

// Where the result of a job that was just accepted comes from.
enum class JobOrigin {
  kOwnWork,
  kSharedWork,  // work of another job that waits or runs
  kKeptResult,  // of a job that ended
};

// Called in order, under the manager's lock: must be quick and must not call back.
class JobObserver {
 public:
  virtual ~JobObserver() = default;

  virtual void OnAccepted(const v1::Job& job, JobOrigin origin) = 0;

  // A worker answered after `duration`, whatever it said. `job` is one of those that share the work.
  virtual void OnWorkEnded(const v1::Job& job, const worker::v1::WorkResult& result, absl::Duration duration) = 0;

  // A worker was lost after `duration`, or ran out of the memory reserved for its work, which is queued again with more
  // (`loss` has OUT_OF_MEMORY then); `retried` of the jobs that shared the work were queued again.
  virtual void OnWorkLost(const v1::Job& job, const WorkerLoss& loss, int retried, absl::Duration duration) = 0;
};

}  // namespace planish
