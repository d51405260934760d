// The streams of Unwrap and WatchJob.
#pragma once

#include <functional>
#include <memory>

#include "absl/status/statusor.h"
#include "planish/v1/planish.pb.h"
#include "server/jobs/job_manager.h"
#include "server/rpc/call.h"
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

// A job whose events are sent, and from where on.
struct OpenedJob {
  WatchedJob job;
  JobStream::Position position;
};

// The threads of a stream's tasks.
struct StreamTasks {
  TenantTasks open_on;
  TenantTasks release_on;  // to release the job, which writes to the store
};

// Finds the job that a request is about; runs on a task thread, unless the caller is gone by then.
using JobOpener = std::function<absl::StatusOr<OpenedJob>(const CallInfo&, ReceivedMessage& request)>;

// Sends the events of the job that `open` brings, then its UV, and ends with open's error if it brings none. One write
// is under way at a time: a slow reader leaves events in the log, where old progress gives way to new, and holds up
// nobody. The attachment that `open` brings is released when the caller goes away, or its deadline passes.
std::shared_ptr<Call> StreamUnwrap(CallInfo info, JobOpener open, StreamTasks tasks,
                                   const StreamSurroundings& surroundings);
std::shared_ptr<Call> StreamWatchJob(CallInfo info, JobOpener open, StreamTasks tasks,
                                     const StreamSurroundings& surroundings);

}  // namespace planish
