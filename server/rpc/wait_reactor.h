// The call WaitJob: waits for the end of a job without a thread.
#pragma once

#include <functional>

#include "absl/status/statusor.h"
#include "absl/time/time.h"
#include "grpcpp/support/server_callback.h"
#include "planish/v1/planish.pb.h"
#include "server/rpc/task_threads.h"
#include "server/rpc/watch_reactor.h"

namespace planish {

struct WaitedJob {
  JobFinder find;                                // its events; on a task thread
  std::function<absl::StatusOr<v1::Job>()> get;  // the job as it is now; likewise
  absl::Duration timeout;
};

// Answers with what `get` says once the job has ended, its log was interrupted (that error instead), or the timeout has
// passed. `response` and the threads of `tasks` outlive the call.
grpc::ServerUnaryReactor* AwaitJob(WaitedJob job, TenantTasks tasks, v1::Job* response);

}  // namespace planish
