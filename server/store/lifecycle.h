// The states of a job and the transitions between them.
#pragma once

#include <string>

#include "absl/status/status.h"
#include "absl/time/time.h"
#include "google/protobuf/timestamp.pb.h"
#include "planish/v1/job.pb.h"

namespace planish {

// Actions that change the state of a job.
enum class JobAction {
  kStart,      // a worker took it
  kStop,       // somebody wants the best map so far
  kCancel,     // somebody wants it to end
  kSucceed,    // the worker delivered; or another job's worker delivered the same
  kFail,       // the worker reported an error, or is lost; or the job ran out of time
  kCancelled,  // the worker obeyed
  kRequeue,    // the worker is lost, and another one shall try
  kExpire,     // the UV are dropped
};

// "RUNNING" for JOB_STATE_RUNNING.
std::string StateName(v1::JobState state);

// Whether nothing can happen to a job in `state` any more.
bool IsTerminal(v1::JobState state);

// Applies `action` to `job` at time `now`: the only function that writes Job.state, start_time and end_time.
//   QUEUED     kStart -> RUNNING      kCancel -> CANCELLED   kSucceed -> SUCCEEDED   kFail -> FAILED
//   RUNNING    kStop, kCancel -> STOPPING                    kSucceed -> SUCCEEDED   kFail -> FAILED
//              kRequeue -> QUEUED
//   STOPPING   kCancelled -> CANCELLED                       kSucceed -> SUCCEEDED   kFail -> FAILED
//              kRequeue -> QUEUED
//   SUCCEEDED  kExpire -> EXPIRED
// FAILED_PRECONDITION for everything else, and `job` is unchanged.
absl::Status Advance(JobAction action, absl::Time now, v1::Job* job);

google::protobuf::Timestamp ToTimestamp(absl::Time time);

}  // namespace planish
