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

// What all streams share. `streams` outlives all streams.
struct StreamSurroundings {
  StreamCounter* streams;
  // Progress events per second of all streams together, so that many watchers cost only a few percent of one core
  // (about 25 us for an event). With more streams, each gets fewer events, always the newest.
  double progress_per_second = 1000;
};

// A job whose events are sent, and the position at which to begin.
struct OpenedJob {
  WatchedJob job;
  JobStream::Position position;
};

// The threads of a stream's tasks.
struct StreamTasks {
  TenantTasks open_on;
  TenantTasks release_on;  // to release the job, which writes to the store
};

// Finds the job of a request. Runs on a task thread; not called if the caller is gone by then.
using JobOpener = std::function<absl::StatusOr<OpenedJob>(const CallInfo&, ReceivedMessage& request)>;

// Sends the events of the job that `open` returns, then its UV; ends with the error of `open` if it fails. There is one
// write at a time: a slow reader leaves events in the log, where new progress replaces old, and delays nobody else. The
// attachment that `open` returns is released when the caller goes away or its deadline passes.
std::shared_ptr<Call> StreamUnwrap(CallInfo info, JobOpener open, StreamTasks tasks,
                                   const StreamSurroundings& surroundings);
std::shared_ptr<Call> StreamWatchJob(CallInfo info, JobOpener open, StreamTasks tasks,
                                     const StreamSurroundings& surroundings);

}  // namespace planish
