#include "server/store/job_transaction.h"

#include <algorithm>
#include <utility>

#include "absl/strings/str_cat.h"
#include "core/base/error.h"
#include "core/base/status_macros.h"
#include "google/protobuf/util/time_util.h"
#include "server/access/caller.h"
#include "server/link/rpc_status.h"

namespace planish {
namespace {

using google::protobuf::util::TimeUtil;

// Sequence numbers that are reserved at a time: most jobs need one block, that is one write, only.
constexpr std::int64_t kSequenceBlock = 1024;

absl::Status BadRow() {
  return InternalError("the job store: a row that cannot be read");
}

// What was written before there were tenants. Fields of earlier builds that this one does not know are dropped where
// rows are read: passed on, they would puzzle clients that have another field of that number.
void FillInTenant(v1::Job* job) {
  if (job->tenant().empty()) job->set_tenant(kDefaultTenant);
}

// Lists do without reports, which may be hundreds of KB each and have a column of their own.
template <class Message>
std::string BytesWithoutReport(Message* message, v1::Job* job) {
  v1::Report* const report = job->release_report();
  std::string bytes = message->SerializeAsString();
  if (report != nullptr) job->set_allocated_report(report);
  return bytes;
}

SqlValue RequestId(const JobRecord& record) {
  if (record.request_id().empty()) return std::monostate();
  return std::string_view(record.request_id());
}

absl::Status TimedOut(const v1::Job& job) {
  const absl::Duration timeout = absl::Nanoseconds(TimeUtil::DurationToNanoseconds(job.scheduling().timeout()));
  return MakeError(absl::StatusCode::kDeadlineExceeded, "DEADLINE_EXCEEDED",
                   absl::StrCat("the job had not ended ", absl::FormatDuration(timeout),
                                " after it was accepted (Scheduling.timeout)"));
}

}  // namespace

absl::StatusOr<std::vector<JobRow>> JobRowsOf(const SqlRows& rows) {
  std::vector<JobRow> jobs(rows.size());
  for (std::size_t i = 0; i < rows.size(); ++i) {
    JobRecord& record = jobs[i].record;
    if (!record.ParseFromString(rows.Bytes(i, 2))) return BadRow();
    FillInTenant(record.mutable_job());
    const std::string& report = rows.Bytes(i, 3);
    const bool has_report = !report.empty();
    if (has_report && !record.mutable_job()->mutable_report()->ParseFromString(report)) return BadRow();
    record.DiscardUnknownFields();
    record.set_number(rows.Int(i, 0));
    jobs[i].had_request_id = !record.request_id().empty();
    jobs[i].lease_until = rows.Int(i, 1);
  }
  return jobs;
}

absl::StatusOr<std::vector<v1::JobEvent>> EventsOf(const SqlRows& rows) {
  std::vector<v1::JobEvent> events(rows.size());
  for (std::size_t i = 0; i < rows.size(); ++i) {
    if (!events[i].ParseFromString(rows.Bytes(i, 0))) return BadRow();
    events[i].DiscardUnknownFields();
    if (events[i].has_job()) FillInTenant(events[i].mutable_job());
  }
  return events;
}

absl::StatusOr<JobRow> JobTransaction::Find(const std::string& name) {
  static const std::string sql = absl::StrCat("SELECT ", kJobColumns, " FROM jobs WHERE name = ?");
  PLANISH_ASSIGN_OR_RETURN(const SqlRows rows, sql_.Run(sql, {std::string_view(name)}));
  if (rows.empty()) return JobNotFound(name);
  PLANISH_ASSIGN_OR_RETURN(std::vector<JobRow> jobs, JobRowsOf(rows));
  return std::move(jobs.front());
}

absl::StatusOr<std::vector<JobRow>> JobTransaction::LockWork(const std::string& work, bool wait) {
  // Locks of rows would not do: what waited for one does not see the job that joined the work in the meantime.
  PLANISH_ASSIGN_OR_RETURN(const bool locked, sql_.Serialize(work, wait));
  if (!locked) return std::vector<JobRow>();
  static const std::string sql =
      absl::StrCat("SELECT ", kJobColumns, " FROM jobs WHERE work = ? AND ended = 0 ORDER BY number {lock}");
  PLANISH_ASSIGN_OR_RETURN(const SqlRows rows, sql_.Run(sql, {std::string_view(work)}));
  return JobRowsOf(rows);
}

absl::StatusOr<JobTransaction::Locked> JobTransaction::LockJob(const std::string& name) {
  PLANISH_ASSIGN_OR_RETURN(const SqlRows work,
                           sql_.Run("SELECT work FROM jobs WHERE name = ?", {std::string_view(name)}));
  if (work.empty()) return JobNotFound(name);
  Locked locked;
  PLANISH_ASSIGN_OR_RETURN(locked.rows, LockWork(work.Bytes(0, 0)));
  for (std::size_t i = 0; i < locked.rows.size(); ++i) {
    if (locked.rows[i].record.job().name() == name) locked.place = i;
  }
  if (locked.place.has_value()) return locked;
  PLANISH_ASSIGN_OR_RETURN(JobRow row, Find(name));
  locked.rows.assign(1, std::move(row));
  return locked;
}

absl::StatusOr<bool> JobTransaction::Insert(JobRow* row, absl::Time turn) {
  JobRecord& record = row->record;
  const v1::Job& job = record.job();
  const std::string bytes = BytesWithoutReport(&record, record.mutable_job());
  const std::string report = job.report().SerializeAsString();
  static const std::string insert =
      "INSERT INTO jobs (number, name, tenant, request_id, state, ended, end_time, work_key, mesh_sha256, "
      "seams_sha256, "
      "uv_sha256, uv_bytes, record, report, create_time, work, owner, attempt, lease_until, turn_time, memory_bytes) "
      "VALUES ({next_number}, ?, ?, ?, ?, ?, ?, ?, ?, ?, ?, ?, ?, ?, ?, ?, ?, ?, ?, ?, ?) "
      "ON CONFLICT DO NOTHING RETURNING number";
  PLANISH_ASSIGN_OR_RETURN(const SqlRows number, sql_.Run(insert, {std::string_view(job.name()),
                                                                   std::string_view(job.tenant()),
                                                                   RequestId(record),
                                                                   job.state(),
                                                                   IsTerminal(job.state()) ? 1 : 0,
                                                                   TimeUtil::TimestampToNanoseconds(job.end_time()),
                                                                   SqlBytes{record.work_key()},
                                                                   SqlBytes{record.mesh_sha256()},
                                                                   SqlBytes{record.seams_sha256()},
                                                                   SqlBytes{job.uv().uv_sha256()},
                                                                   job.uv().total_bytes(),
                                                                   SqlBytes{bytes},
                                                                   SqlBytes{report},
                                                                   TimeUtil::TimestampToNanoseconds(job.create_time()),
                                                                   std::string_view(record.work()),
                                                                   std::string_view(record.owner()),
                                                                   record.attempt(),
                                                                   row->lease_until,
                                                                   absl::ToUnixNanos(turn),
                                                                   job.memory_bytes()}));
  if (number.empty()) return false;
  record.set_number(number.Int(0, 0));
  for (const auto& [key, value] : job.labels()) {
    PLANISH_RETURN_IF_ERROR(sql_.Run("INSERT INTO labels VALUES (?, ?, ?)",
                                     {record.number(), std::string_view(key), std::string_view(value)})
                                .status());
  }
  return true;
}

absl::Status JobTransaction::Save(const JobRow& row, JobRecord* record) {
  // Each column that a statement names costs the indexes that it is in, changed or not: so there are four.
  static const std::string changed = "UPDATE jobs SET state = ?, record = ?, owner = ?, attempt = ?, lease_until = ?";
  static const std::string forgotten = ", request_id = NULL";
  static const std::string ended = ", ended = 1, end_time = ?, uv_sha256 = ?, uv_bytes = ?, report = ?";
  static const std::string where = " WHERE number = ?";
  static const std::string statements[] = {changed + where, changed + forgotten + where, changed + ended + where,
                                           changed + forgotten + ended + where};
  const v1::Job& job = record->job();
  const std::string bytes = BytesWithoutReport(record, record->mutable_job());
  std::string report;
  std::vector<SqlValue> values = {std::int64_t{job.state()}, SqlBytes{bytes}, std::string_view(record->owner()),
                                  std::int64_t{record->attempt()}, row.lease_until};
  const bool forgets = row.had_request_id && record->request_id().empty();
  const bool ends = IsTerminal(job.state());
  if (ends) {
    report = job.report().SerializeAsString();
    values.insert(values.end(), {TimeUtil::TimestampToNanoseconds(job.end_time()), SqlBytes{job.uv().uv_sha256()},
                                 job.uv().total_bytes(), SqlBytes{report}});
  }
  values.emplace_back(record->number());
  return sql_.Run(statements[(forgets ? 1 : 0) + (ends ? 2 : 0)], values).status();
}

absl::Status JobTransaction::PutBlobs(const std::vector<BlobRow>& blobs) {
  for (const BlobRow& blob : blobs) {
    PLANISH_RETURN_IF_ERROR(
        sql_.Run("INSERT INTO blobs VALUES (?, ?, ?) ON CONFLICT (tenant, sha256) DO UPDATE SET bytes = excluded.bytes",
                 {std::string_view(blob.id.tenant), SqlBytes{blob.id.sha256}, SqlBytes{blob.bytes->memory()->bytes()}})
            .status());
  }
  return absl::OkStatus();
}

absl::Status JobTransaction::AddEvent(JobChange* change, v1::JobEvent event, bool taken_over) {
  JobRecord& record = change->record;
  std::int64_t last = record.last_sequence();
  if (context_->told != nullptr) last = std::max(last, context_->told(record.job().name()));
  if (taken_over) last = std::max(last, record.reserved_sequence());
  event.set_sequence(last + 1);
  *event.mutable_time() = ToTimestamp(context_->now);
  record.set_last_sequence(last + 1);
  if (record.reserved_sequence() > 0 && last + 1 >= record.reserved_sequence()) {
    record.set_reserved_sequence(last + 1 + kSequenceBlock);
  }
  change->events.push_back(std::move(event));
  return absl::OkStatus();
}

absl::Status JobTransaction::WriteEvents(JobChange* change) {
  static const std::string insert = "INSERT INTO events VALUES (?, ?, ?)";
  for (v1::JobEvent& event : change->events) {
    const std::string bytes =
        event.has_job() ? BytesWithoutReport(&event, event.mutable_job()) : event.SerializeAsString();
    PLANISH_RETURN_IF_ERROR(sql_.Run(insert, {change->record.number(), event.sequence(), SqlBytes{bytes}}).status());
  }
  return absl::OkStatus();
}

absl::Status JobTransaction::Announce(JobChange* change, bool taken_over) {
  v1::JobEvent event;
  *event.mutable_job() = change->record.job();
  return AddEvent(change, std::move(event), taken_over);
}

absl::Status JobTransaction::Act(JobAction action, JobChange* change, bool taken_over) {
  v1::Job* job = change->record.mutable_job();
  PLANISH_RETURN_IF_ERROR(Advance(action, context_->now, job));
  if (job->state() == v1::JOB_STATE_SUCCEEDED && context_->retained_time < absl::InfiniteDuration()) {
    *job->mutable_expire_time() = ToTimestamp(context_->now + context_->retained_time);
  }
  if (IsTerminal(job->state())) change->record.clear_owner();
  return Announce(change, taken_over);
}

absl::Status JobTransaction::Fail(const google::rpc::Status& error, JobChange* change, bool taken_over) {
  *change->record.mutable_job()->mutable_error() = error;
  return Act(JobAction::kFail, change, taken_over);
}

absl::StatusOr<bool> JobTransaction::EndIfWanted(JobChange* change, bool taken_over) {
  const v1::Job& job = change->record.job();
  if (change->record.timed_out()) {
    PLANISH_RETURN_IF_ERROR(Fail(ToRpcStatus(TimedOut(job)), change, taken_over));
    return true;
  }
  if (!job.cancel_requested()) return false;
  if (job.state() == v1::JOB_STATE_RUNNING) PLANISH_RETURN_IF_ERROR(Act(JobAction::kCancel, change, taken_over));
  const JobAction last = job.state() == v1::JOB_STATE_QUEUED ? JobAction::kCancel : JobAction::kCancelled;
  PLANISH_RETURN_IF_ERROR(Act(last, change, taken_over));
  return true;
}

absl::Status JobTransaction::Requeue(JobRow* row, JobChange* change, bool taken_over) {
  change->record.clear_owner();
  row->lease_until = 0;
  return Act(JobAction::kRequeue, change, taken_over);
}

absl::Status JobTransaction::Start(const Lease& lease, JobChange* change) {
  JobRecord& record = change->record;
  record.set_owner(lease.owner);
  record.set_attempt(lease.attempt);
  record.mutable_job()->set_attempts(record.job().attempts() + 1);
  return Act(JobAction::kStart, change);
}

}  // namespace planish
