// The call WaitJob: waits until a job has ended or a timeout has passed. No thread is blocked meanwhile.
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
  std::function<absl::StatusOr<v1::Job>()> get;  // reads the job when the wait is over; runs on a task thread
  absl::Duration timeout;
};

// Finds the job of a request. Runs on a task thread.
using WaitOpener = std::function<absl::StatusOr<WaitedJob>(const CallInfo&, ReceivedMessage& request)>;

// Answers with the result of `get` once the job has ended or the timeout has passed; with the log's error if the log
// was interrupted. The threads of `tasks` outlive the call.
std::shared_ptr<Call> AwaitJob(CallInfo info, WaitOpener open, TenantTasks tasks);

}  // namespace planish
