#include "server/store/lifecycle.h"

#include <optional>

#include "core/base/error.h"
#include "google/protobuf/util/time_util.h"

namespace planish {
namespace {

using v1::JobState;

std::optional<JobState> Next(JobState state, JobAction action) {
  const bool queued = state == v1::JOB_STATE_QUEUED;
  const bool running = state == v1::JOB_STATE_RUNNING;
  const bool stopping = state == v1::JOB_STATE_STOPPING;
  switch (action) {
    case JobAction::kStart:
      if (queued) return v1::JOB_STATE_RUNNING;
      break;
    case JobAction::kStop:
      if (running) return v1::JOB_STATE_STOPPING;
      break;
    case JobAction::kCancel:
      if (queued) return v1::JOB_STATE_CANCELLED;
      if (running) return v1::JOB_STATE_STOPPING;
      break;
    case JobAction::kSucceed:
      if (queued || running || stopping) return v1::JOB_STATE_SUCCEEDED;
      break;
    case JobAction::kFail:
      if (queued || running || stopping) return v1::JOB_STATE_FAILED;
      break;
    case JobAction::kCancelled:
      if (stopping) return v1::JOB_STATE_CANCELLED;
      break;
    case JobAction::kRequeue:
      if (running || stopping) return v1::JOB_STATE_QUEUED;
      break;
    case JobAction::kExpire:
      if (state == v1::JOB_STATE_SUCCEEDED) return v1::JOB_STATE_EXPIRED;
      break;
  }
  return std::nullopt;
}

const char* Name(JobAction action) {
  switch (action) {
    case JobAction::kStart:
      return "start";
    case JobAction::kStop:
      return "stop";
    case JobAction::kCancel:
      return "cancel";
    case JobAction::kSucceed:
      return "succeed";
    case JobAction::kFail:
      return "fail";
    case JobAction::kCancelled:
      return "be reported as cancelled";
    case JobAction::kRequeue:
      return "be queued again";
    case JobAction::kExpire:
      return "expire";
  }
  return "?";
}

}  // namespace

std::string StateName(JobState state) {
  constexpr int kPrefix = sizeof("JOB_STATE_") - 1;
  const std::string name = v1::JobState_Name(state);
  return name.empty() ? std::to_string(static_cast<int>(state)) : name.substr(kPrefix);
}

bool IsTerminal(JobState state) {
  return state == v1::JOB_STATE_SUCCEEDED || state == v1::JOB_STATE_FAILED || state == v1::JOB_STATE_CANCELLED ||
         state == v1::JOB_STATE_EXPIRED;
}

absl::Status Advance(JobAction action, absl::Time now, v1::Job* job) {
  const std::optional<JobState> next = Next(job->state(), action);
  if (!next.has_value()) {
    return MakeError(absl::StatusCode::kFailedPrecondition, "JOB_STATE",
                     job->name() + " is " + StateName(job->state()) + " and cannot " + Name(action));
  }
  job->set_state(*next);
  // Durations stay non-negative even if the clock was set back.
  google::protobuf::Timestamp time = ToTimestamp(now);
  for (const google::protobuf::Timestamp& before : {job->create_time(), job->start_time()}) {
    if (before > time) time = before;
  }
  if (action == JobAction::kStart) *job->mutable_start_time() = time;
  if (action == JobAction::kRequeue) job->clear_start_time();
  if (IsTerminal(*next) && action != JobAction::kExpire) *job->mutable_end_time() = time;
  return absl::OkStatus();
}

google::protobuf::Timestamp ToTimestamp(absl::Time time) {
  return google::protobuf::util::TimeUtil::NanosecondsToTimestamp(absl::ToUnixNanos(time));
}

}  // namespace planish
