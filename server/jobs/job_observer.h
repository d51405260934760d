// The interface for metrics of a JobManager.
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
  kSharedWork,  // the work of another job, which waits or runs
  kKeptResult,  // the result of a job that has ended
};

// Its functions are called in order, while the manager holds a lock: they must be quick and must not call the manager.
class JobObserver {
 public:
  virtual ~JobObserver() = default;

  virtual void OnAccepted(const v1::Job& job, JobOrigin origin) = 0;

  // A worker sent a result, good or bad, after `duration`. `job` is one of the jobs that share the work.
  virtual void OnWorkEnded(const v1::Job& job, const worker::v1::WorkResult& result, absl::Duration duration) = 0;

  // A worker was lost after `duration`, or ran out of reserved memory, so that its work is queued again with more
  // (`loss` then has OUT_OF_MEMORY). `retried`: how many of the jobs that shared the work were queued again.
  virtual void OnWorkLost(const v1::Job& job, const WorkerLoss& loss, int retried, absl::Duration duration) = 0;
};

}  // namespace planish
