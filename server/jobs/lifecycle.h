// The states of a job and the only ways between them.
#pragma once

#include <string>

#include "absl/status/status.h"
#include "absl/time/time.h"
#include "google/protobuf/timestamp.pb.h"
#include "planish/v1/job.pb.h"

namespace planish {

// What happens to a job.
enum class JobAction {
  kStart,      // a worker took it
  kCancel,     // somebody wants it to end
  kSucceed,    // the worker delivered
  kFail,       // the worker reported an error, or is lost
  kCancelled,  // the worker obeyed
};

// "RUNNING" for JOB_STATE_RUNNING.
std::string StateName(v1::JobState state);

// Whether nothing can happen to a job in `state` any more.
bool IsTerminal(v1::JobState state);

// Applies `action` to `job` at time `now`: the only function that writes Job.state, start_time and end_time.
//   QUEUED    kStart -> RUNNING       kCancel -> CANCELLED
//   RUNNING   kCancel -> STOPPING     kSucceed -> SUCCEEDED   kFail -> FAILED
//   STOPPING                          kSucceed -> SUCCEEDED   kFail -> FAILED   kCancelled -> CANCELLED
// FAILED_PRECONDITION for everything else, and `job` is unchanged.
absl::Status Advance(JobAction action, absl::Time now, v1::Job* job);

google::protobuf::Timestamp ToTimestamp(absl::Time time);

}  // namespace planish
