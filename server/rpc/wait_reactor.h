// The call WaitJob: waits for the end of a job without a thread.
#pragma once

#include <functional>
#include <memory>

#include "absl/status/statusor.h"
#include "absl/time/time.h"
#include "planish/v1/planish.pb.h"
#include "server/jobs/job_manager.h"
#include "server/rpc/call.h"
#include "server/rpc/task_threads.h"

namespace planish {

struct WaitedJob {
  WatchedJob job;
  std::function<absl::StatusOr<v1::Job>()> get;  // the job as it is then; runs on a task thread
  absl::Duration timeout;
};

// Finds the job that a request is about; runs on a task thread.
using WaitOpener = std::function<absl::StatusOr<WaitedJob>(const CallInfo&, ReceivedMessage& request)>;

// Answers with what `get` says once the job has ended, its log was interrupted (that error instead), or the timeout has
// passed. The threads of `tasks` outlive the call.
std::shared_ptr<Call> AwaitJob(CallInfo info, WaitOpener open, TenantTasks tasks);

}  // namespace planish
