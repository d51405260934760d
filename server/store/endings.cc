#include "server/store/endings.h"

#include <map>
#include <string>

#include "absl/strings/str_cat.h"
#include "absl/time/time.h"
#include "core/base/error.h"
#include "core/base/status_macros.h"
#include "google/protobuf/util/time_util.h"
#include "server/link/rpc_status.h"

namespace planish {
namespace {

// The error of jobs whose attempt was lost.
google::rpc::Status LossError(const AttemptOutcome::Loss& loss, int attempts) {
  std::map<std::string, std::string> metadata = loss.metadata;
  metadata["attempts"] = absl::StrCat(attempts);
  const auto code = loss.reason == "OUT_OF_MEMORY" ? absl::StatusCode::kResourceExhausted : absl::StatusCode::kInternal;
  return ToRpcStatus(
      MakeError(code, loss.reason,
                absl::StrCat(loss.message, attempts > 1 ? absl::StrCat(" (", attempts, " attempts)") : ""), metadata));
}

absl::Time TimeFrom(const google::protobuf::Timestamp& timestamp) {
  return absl::FromUnixNanos(google::protobuf::util::TimeUtil::TimestampToNanoseconds(timestamp));
}

absl::Duration DurationFrom(const google::protobuf::Duration& duration) {
  return absl::Nanoseconds(google::protobuf::util::TimeUtil::DurationToNanoseconds(duration));
}

}  // namespace

JobLimitTimes LimitTimesOf(const JobRecord& record) {
  const v1::Job& job = record.job();
  JobLimitTimes times;
  if (IsTerminal(job.state()) || IsEndWanted(record)) return times;
  if (record.attached() && record.has_callers_until()) times.callers = TimeFrom(record.callers_until());
  const v1::Scheduling& limits = job.scheduling();
  if (limits.has_timeout()) times.timeout = TimeFrom(job.create_time()) + DurationFrom(limits.timeout());
  if (limits.has_compute_budget() && job.state() == v1::JOB_STATE_RUNNING && !job.stop_requested()) {
    times.budget = TimeFrom(job.start_time()) + DurationFrom(limits.compute_budget());
  }
  return times;
}

google::rpc::Status ServerCrashed(int attempts) {
  return ToRpcStatus(MakeError(absl::StatusCode::kInternal, "SERVER_CRASHED",
                               absl::StrCat("the server died while it ran the job (", attempts, " attempts)"),
                               {{"attempts", absl::StrCat(attempts)}}));
}

absl::Status AddProgress(JobTransaction* transaction, const std::vector<v1::Progress>& progress, JobChange* change) {
  for (const v1::Progress& news : progress) {
    v1::JobEvent event;
    *event.mutable_progress() = news;
    PLANISH_RETURN_IF_ERROR(transaction->AddEvent(change, std::move(event)));
  }
  return absl::OkStatus();
}

absl::Status EndIfOverdue(JobTransaction& transaction, const LockedWork& work, JobChange* change) {
  PLANISH_ASSIGN_OR_RETURN(const std::int64_t nanoseconds, transaction.Now());
  const absl::Time now = absl::FromUnixNanos(nanoseconds);
  const JobRecord& record = change->record;
  const JobLimitTimes limits = LimitTimesOf(record);
  if (now >= limits.callers) return transaction.EndEarly(work, EarlyEnd::kCancel, /*forget=*/true, change);
  if (now >= limits.timeout) return transaction.EndEarly(work, EarlyEnd::kTimeout, /*forget=*/false, change);
  return now >= limits.budget ? transaction.Stop(change) : absl::OkStatus();
}

// Applies the worker's result to one of the jobs.
absl::Status Deliver(JobTransaction* transaction, const AttemptOutcome& outcome, JobChange* change) {
  const auto code = static_cast<absl::StatusCode>(outcome.status.code());
  const bool ended_well = code == absl::StatusCode::kOk || code == absl::StatusCode::kCancelled;
  if (change->record.timed_out() || ended_well) {
    PLANISH_ASSIGN_OR_RETURN(const bool ended, transaction->EndIfWanted(change));
    if (ended) return absl::OkStatus();
  }
  if (code == absl::StatusCode::kCancelled) {
    return transaction->Fail(ToRpcStatus(InternalError("the worker cancelled a job that nobody cancelled")), change);
  }
  if (code != absl::StatusCode::kOk) return transaction->Fail(outcome.status, change);
  v1::Job* job = change->record.mutable_job();
  *job->mutable_report() = outcome.report;
  *job->mutable_report()->mutable_times()->mutable_queue() = job->start_time() - job->create_time();
  *job->mutable_uv() = outcome.uv;
  return transaction->Act(JobAction::kSucceed, change);
}

absl::Status Lose(JobTransaction* transaction, const AttemptOutcome::Loss& loss, JobChange* change) {
  JobRecord& record = change->record;
  record.set_crashes(record.crashes() + 1);
  PLANISH_ASSIGN_OR_RETURN(const bool ended, transaction->EndIfWanted(change));
  if (ended) return absl::OkStatus();
  if (loss.is_final || record.crashes() >= transaction->context().max_attempts) {
    return transaction->Fail(LossError(loss, record.job().attempts()), change);
  }
  return transaction->Requeue(change);
}

absl::Status Enlarge(JobTransaction* transaction, std::int64_t memory_bytes, JobChange* change) {
  PLANISH_ASSIGN_OR_RETURN(const bool ended, transaction->EndIfWanted(change));
  if (ended) return absl::OkStatus();
  change->record.set_enlargements(change->record.enlargements() + 1);
  change->record.mutable_job()->set_memory_bytes(memory_bytes);
  return transaction->Requeue(change);
}

}  // namespace planish
