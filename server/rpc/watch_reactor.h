// The streams of Unwrap and WatchJob.
#pragma once

#include <functional>

#include "absl/status/statusor.h"
#include "grpcpp/support/server_callback.h"
#include "planish/v1/planish.pb.h"
#include "server/jobs/job_manager.h"
#include "server/rpc/job_stream.h"
#include "server/rpc/stream_counter.h"
#include "server/rpc/task_threads.h"

namespace planish {

// What streams share. All of it outlives them.
struct StreamSurroundings {
  StreamCounter* streams;
  // Progress events that all streams together send in a second, so that a crowd of watchers costs a few percent of one
  // core (about 25 us each): the more streams there are the fewer events each gets, always the newest.
  double progress_per_second = 1000;
};

// Finds the job whose events are sent.
using JobFinder = std::function<absl::StatusOr<WatchedJob>()>;

struct WatchedCall {
  JobFinder find;  // runs on one of the threads of `find_on`, unless the caller is gone by then
  TenantTasks find_on;
  TenantTasks write_on;  // to release the job, which writes to the store
};

// Sends the events of the job that `find` brings, then its UV, and ends with find's error if it brings none. One write
// is under way at a time: a slow reader leaves events in the log, where old progress gives way to new, and holds up
// nobody. The attachment that `find` brings is released when the caller goes away, or its deadline passes. The reactor
// belongs to gRPC.
grpc::ServerWriteReactor<v1::UnwrapResponse>* StreamUnwrap(grpc::CallbackServerContext* context, WatchedCall call,
                                                           const JobStream::Position& position,
                                                           const StreamSurroundings& surroundings);
grpc::ServerWriteReactor<v1::WatchJobResponse>* StreamWatchJob(grpc::CallbackServerContext* context, WatchedCall call,
                                                               const JobStream::Position& position,
                                                               const StreamSurroundings& surroundings);

}  // namespace planish
