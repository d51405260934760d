#include "server/store/job_transaction.h"

#include <algorithm>
#include <cmath>
#include <limits>
#include <utility>

#include "absl/strings/str_cat.h"
#include "core/base/error.h"
#include "core/base/status_macros.h"
#include "google/protobuf/util/time_util.h"
#include "server/access/caller.h"
#include "server/link/rpc_status.h"
#include "server/store/endings.h"

namespace planish {
namespace {

using google::protobuf::util::TimeUtil;

// Sequence numbers reserved at a time.
constexpr std::int64_t kSequenceBlock = 1024;

// At least this many progress events of a job are kept. Each time as many more have come, older ones are deleted.
constexpr std::int64_t kKeptProgress = 2048;

absl::Status BadRow() {
  return InternalError("the job store: a row that cannot be read");
}

// Fills in the tenant of records from before there were tenants.
void FillInTenant(v1::Job* job) {
  if (job->tenant().empty()) job->set_tenant(kDefaultTenant);
}

// Serializes `message` without the report of its `job`. Reports may be hundreds of KB each and have a column of their
// own, so that lists can omit them.
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

constexpr std::int64_t kNever = std::numeric_limits<std::int64_t>::max();

// The content of a row of `events` (job_schema.h).
enum EventKind : std::int64_t { kOneEvent = 0, kWithState = 1, kProgressOnly = 2 };

absl::Time TimeOf(const google::protobuf::Timestamp& timestamp) {
  return absl::FromUnixNanos(TimeUtil::TimestampToNanoseconds(timestamp));
}

absl::Duration DurationOf(const google::protobuf::Duration& duration) {
  return absl::Nanoseconds(TimeUtil::DurationToNanoseconds(duration));
}

std::int64_t DueColumn(const JobRecord& record) {
  const absl::Time due = LimitTimesOf(record).First();
  return due == absl::InfiniteFuture() ? kNever : absl::ToUnixNanos(due);
}

JobStanding StandingOf(const JobRecord& record, int max_attempts) {
  const v1::Job& job = record.job();
  const absl::Time turn = QueueTime(TimeOf(job.create_time()), job.scheduling().priority());
  return {IsTerminal(job.state()),
          IsLeased(record),
          IsEndWanted(record),
          job.stop_requested(),
          record.server_crashes() > 0 && record.crashes() + 1 >= max_attempts,
          record.number(),
          absl::ToUnixNanos(turn),
          job.memory_bytes()};
}

// The Wish for an attempt at work with these jobs.
Wish WishOf(const std::vector<JobRow>& jobs) {
  bool cancel = true, stop = true;
  for (const JobRow& job : jobs) {
    if (job.standing.ended) continue;
    cancel = cancel && job.standing.end_wanted;
    stop = stop && job.standing.stop_requested;
  }
  return cancel ? Wish::kCancel : stop ? Wish::kStop : Wish::kGoOn;
}

double ShareIn(const WorkRow& work) {
  return static_cast<double>(work.share) / 1e6;
}

absl::Status TimedOut(const v1::Job& job) {
  const absl::Duration timeout = DurationOf(job.scheduling().timeout());
  return MakeError(absl::StatusCode::kDeadlineExceeded, "DEADLINE_EXCEEDED",
                   absl::StrCat("the job had not ended ", absl::FormatDuration(timeout),
                                " after it was accepted (Scheduling.timeout)"));
}

// The unfinished jobs of pieces of work, each with the name of its work.
RowBatch JobsOfWorks() {
  return RowBatch::Of(absl::StrCat("SELECT ", kJobColumns, ", work FROM jobs WHERE ended = 0 AND work IN ({rows})"));
}
constexpr std::size_t kJobWorkColumn = 4;

std::int64_t ResultBytes(const JobRecord& record) {
  return record.job().state() == v1::JOB_STATE_SUCCEEDED ? record.job().uv().total_bytes() : 0;
}

// Approximate size of an ended job without its blobs. Old progress of long work was dropped.
std::int64_t KeptBytes(const JobRecord& record) {
  constexpr std::int64_t kRows = 1024;  // columns and index entries
  const double kept = std::min(1.0, 2.0 * kKeptProgress / static_cast<double>(record.last_sequence()));
  return kRows + static_cast<std::int64_t>(record.ByteSizeLong()) +
         std::llround(kept * static_cast<double>(record.event_bytes()));
}

// Adds the size of the event to event_bytes, without its report, which is counted with the record.
void NoteEventBytes(const v1::JobEvent& event, JobRecord* record) {
  std::size_t bytes = event.ByteSizeLong();
  if (event.job().has_report()) bytes -= event.job().report().ByteSizeLong();
  record->set_event_bytes(record->event_bytes() + static_cast<std::int64_t>(bytes));
}

}  // namespace

absl::StatusOr<JobRow> JobRowOf(const SqlRows& rows, std::size_t i, std::size_t column) {
  JobRow job;
  JobRecord& record = job.record;
  if (!record.ParseFromString(rows.Bytes(i, column + 2))) return BadRow();
  FillInTenant(record.mutable_job());
  const std::string& report = rows.Bytes(i, column + 3);
  const bool has_report = !report.empty();
  if (has_report && !record.mutable_job()->mutable_report()->ParseFromString(report)) return BadRow();
  record.DiscardUnknownFields();  // of earlier builds: clients may use other fields with these numbers
  record.set_number(rows.Int(i, column));
  job.had_request_id = !record.request_id().empty();
  job.due = rows.Int(i, column + 1);
  job.result_bytes = ResultBytes(record);
  job.record_bytes = record.kept_bytes();
  job.standing.ended = IsTerminal(record.job().state());
  return job;
}

absl::StatusOr<std::vector<JobRow>> JobRowsOf(const SqlRows& rows) {
  std::vector<JobRow> jobs(rows.size());
  for (std::size_t i = 0; i < rows.size(); ++i) {
    PLANISH_ASSIGN_OR_RETURN(jobs[i], JobRowOf(rows, i));
  }
  return jobs;
}

absl::StatusOr<std::vector<v1::JobEvent>> EventsOf(const SqlRows& rows, std::int64_t after) {
  std::vector<v1::JobEvent> events;
  for (std::size_t i = 0; i < rows.size(); ++i) {
    store::v1::EventBatch batch;
    const bool parsed = rows.Int(i, 0) == kOneEvent ? batch.add_events()->ParseFromString(rows.Bytes(i, 1))
                                                    : batch.ParseFromString(rows.Bytes(i, 1));
    if (!parsed) return BadRow();
    for (v1::JobEvent& event : *batch.mutable_events()) {
      if (event.sequence() <= after) continue;
      event.DiscardUnknownFields();
      if (event.has_job()) FillInTenant(event.mutable_job());
      events.push_back(std::move(event));
    }
  }
  return events;
}

std::int64_t LockedWork::Size() const {
  return std::count_if(jobs.begin(), jobs.end(), [](const JobRow& job) { return !job.standing.ended; });
}

JobTransaction::JobTransaction(SqlConnection* connection, const VerbContext* context, const StoreClock* clock)
    : sql_(*connection),
      context_(*context),
      clock_(*clock),
      inserts_(
          RowBatch::Of("INSERT INTO jobs (number, name, tenant, request_id, state, priority, ended, end_time, "
                       "work_key, mesh_sha256, elements_sha256, uv_sha256, record, report, create_time, work, due) "
                       "VALUES {rows}")),
      labels_(RowBatch::Of("INSERT INTO labels (job, key, value) VALUES {rows}")),
      new_works_(WorkInserts()),
      events_(RowBatch::Of("INSERT INTO events (job, sequence, event, kind) VALUES {rows}")),
      works_(WorkUpdates()) {}

absl::StatusOr<std::int64_t> JobTransaction::Now() {
  if (now_.has_value()) return *now_;
  if (clock_ != nullptr) {
    now_ = absl::ToUnixNanos(clock_());
  } else {
    PLANISH_ASSIGN_OR_RETURN(const SqlRows now, sql_.Run("SELECT {now}", {}));
    now_ = now.Int(0, 0);
  }
  return *now_;
}

void JobTransaction::SetNow(std::int64_t database_now) {
  if (clock_ == nullptr && !now_.has_value()) now_ = database_now;
}

absl::StatusOr<JobRow> JobTransaction::Find(const std::string& name) {
  static const std::string sql = absl::StrCat("SELECT ", kJobColumns, " FROM jobs WHERE name = ?");
  PLANISH_ASSIGN_OR_RETURN(const SqlRows rows, sql_.Run(sql, {std::string_view(name)}));
  if (rows.empty()) return JobNotFound(name);
  PLANISH_ASSIGN_OR_RETURN(std::vector<JobRow> jobs, JobRowsOf(rows));
  return std::move(jobs.front());
}

// The lock of a work's row also locks its jobs: every transaction that changes or adds such a job takes this lock
// first.
absl::StatusOr<std::optional<LockedWork>> JobTransaction::LockWork(const std::string& work, bool wait) {
  static const std::string select = absl::StrCat("SELECT ", kWorkColumns, ", {now} FROM works WHERE name = ? ");
  static const std::string waits = select + "{lock}", skips = select + "{skip}";
  SqlRows rows;
  PLANISH_RETURN_IF_ERROR(sql_.RunLater(wait ? waits : skips, {std::string_view(work)}, &rows));
  PLANISH_ASSIGN_OR_RETURN(JobsByWork jobs, ReadJobs({work}));
  if (rows.empty()) return std::nullopt;
  SetNow(rows.Int(0, kWorkColumnCount));  // Settle() may need it
  return LockedWorkOf(std::move(WorkRowsOf(rows).front()), std::move(jobs[work]));
}

absl::StatusOr<std::vector<std::optional<LockedWork>>> JobTransaction::EndWorks(const std::vector<Lease>& ordered) {
  // Says "running != 0", as JobStore::Renew does: with "running = 1" PostgreSQL might use the index of the owner's
  // running work, and read all of it, instead of the index of names.
  static const std::string sql =
      absl::StrCat("DELETE FROM works WHERE name = ? AND owner = ? AND attempt = ? AND running != 0 RETURNING ",
                   kWorkColumns, ", {now}");
  std::vector<SqlRows> rows(ordered.size());
  std::vector<std::string> names;
  for (std::size_t i = 0; i < ordered.size(); ++i) {
    const Lease& lease = ordered[i];
    PLANISH_RETURN_IF_ERROR(
        sql_.RunLater(sql, {std::string_view(lease.work), std::string_view(lease.owner), lease.attempt}, &rows[i]));
    names.push_back(lease.work);
  }
  PLANISH_ASSIGN_OR_RETURN(JobsByWork jobs, ReadJobs(names));
  std::vector<std::optional<LockedWork>> works(ordered.size());
  for (std::size_t i = 0; i < ordered.size(); ++i) {
    if (rows[i].empty()) continue;
    SetNow(rows[i].Int(0, kWorkColumnCount));
    works[i] = LockedWorkOf(std::move(WorkRowsOf(rows[i]).front()), std::move(jobs[ordered[i].work]));
    works[i]->is_taken = true;
  }
  return works;
}

absl::StatusOr<JobTransaction::JobsByWork> JobTransaction::ReadJobs(const std::vector<std::string>& works) {
  RowBatch questions = JobsOfWorks();
  for (const std::string& work : works) questions.Add({std::string_view(work)});
  std::deque<SqlRows> answers;
  PLANISH_RETURN_IF_ERROR(questions.Send(&sql_, &answers));
  PLANISH_RETURN_IF_ERROR(sql_.Flush());
  JobsByWork jobs;
  for (const SqlRows& rows : answers) {
    for (std::size_t i = 0; i < rows.size(); ++i) {
      PLANISH_ASSIGN_OR_RETURN(JobRow job, JobRowOf(rows, i));
      jobs[rows.Bytes(i, kJobWorkColumn)].push_back(std::move(job));
    }
  }
  return jobs;
}

LockedWork JobTransaction::LockedWorkOf(WorkRow row, std::vector<JobRow> jobs) const {
  LockedWork locked;
  locked.before = row;
  locked.jobs = std::move(jobs);
  std::sort(locked.jobs.begin(), locked.jobs.end(),
            [](const JobRow& a, const JobRow& b) { return a.record.number() < b.record.number(); });
  locked.row = std::move(row);
  for (JobRow& job : locked.jobs) job.standing = StandingOf(job.record, context_.max_attempts);
  return locked;
}

absl::StatusOr<JobTransaction::Locked> JobTransaction::LockJob(const std::string& name) {
  PLANISH_ASSIGN_OR_RETURN(const SqlRows work,
                           sql_.Run("SELECT work FROM jobs WHERE name = ?", {std::string_view(name)}));
  if (work.empty()) return JobNotFound(name);
  Locked locked;
  PLANISH_ASSIGN_OR_RETURN(std::optional<LockedWork> found, LockWork(work.Bytes(0, 0)));
  if (found.has_value()) locked.work = *std::move(found);
  for (std::size_t i = 0; i < locked.work.jobs.size(); ++i) {
    if (locked.work.jobs[i].record.job().name() == name) locked.place = i;
  }
  if (locked.place.has_value()) return locked;
  PLANISH_ASSIGN_OR_RETURN(JobRow row, Find(name));
  locked.work.jobs.clear();
  locked.work.jobs.push_back(std::move(row));
  return locked;
}

absl::Status JobTransaction::Settle(LockedWork* work) {
  WorkRow& row = work->row;
  const WorkRow& before = work->before;
  bool leased = false;
  std::int64_t turn_time = kNever, number = kNever, memory_bytes = 0;
  row.alone = false;
  for (const JobRow& job : work->jobs) {
    if (job.standing.ended) continue;
    leased = leased || job.standing.leased;
    row.alone = row.alone || job.standing.alone;
    turn_time = std::min(turn_time, job.standing.turn_time);
    number = std::min(number, job.standing.number);
    memory_bytes = std::max(memory_bytes, job.standing.memory_bytes);
  }
  const bool gone = number == kNever;
  row.running = leased && !gone;
  if (!gone) {
    row.turn_time = turn_time;
    row.number = number;
    row.memory_bytes = memory_bytes;
  }
  row.wish = WishOf(work->jobs);
  TenantAccount& account = accounts_.of(row.tenant);
  if (before.running && !row.running) {
    PLANISH_ASSIGN_OR_RETURN(const std::int64_t now, Now());
    account.running -= 1;
    account.started -= before.start_time / 1'000'000;
    account.charged -= before.charge;
    account.received += SettledFor(absl::Nanoseconds(now - before.start_time), ShareIn(before));
    row.owner.clear();
    row.lease_until = 0;
  } else if (!before.running && row.running) {
    account.running += 1;
    account.started += row.start_time / 1'000'000;
    account.charged += row.charge;
  }
  const int waited = before.running ? 0 : 1;
  const int waits = row.running || gone ? 0 : 1;
  // Work that was lost or given back is queued like new work.
  if (waits > waited) PLANISH_RETURN_IF_ERROR(Lift(row.tenant, ShareIn(before)));
  account.waiting += waits - waited;
  account.waiting_bytes += (waits - waited) * row.mesh_bytes;
  if (!row.running && (before.running || gone)) news_.work = true;
  if (before.running && (!row.running || row.wish != before.wish)) news_.works.push_back(row.name);
  if (work->is_taken) return gone ? absl::OkStatus() : InternalError("work was to end, and did not");
  if (gone) return DeleteWork(&sql_, row.name);
  if (row != before) UpdateWork(row, &works_);
  return absl::OkStatus();
}

absl::Status JobTransaction::Lift(const std::string& tenant, double share) {
  PLANISH_ASSIGN_OR_RETURN(const FairAccounts accounts, ReadAccounts(&sql_));
  return LiftIn(accounts, tenant, share);
}

absl::Status JobTransaction::LiftIn(const FairAccounts& accounts, const std::string& tenant, double share) {
  const auto found = accounts.tenants.find(tenant);
  TenantAccount& change = accounts_.of(tenant);
  if ((found != accounts.tenants.end() && found->second.waiting > 0) || change.waiting > 0) return absl::OkStatus();
  PLANISH_ASSIGN_OR_RETURN(const std::int64_t now, Now());
  change.received += LiftOf(accounts, tenant, share, absl::FromUnixNanos(now));
  return absl::OkStatus();
}

void JobTransaction::AddWork(const JobRow& job, absl::Duration run_time) {
  const v1::Job& described = job.record.job();
  WorkRow work;
  work.name = job.record.work();
  work.tenant = described.tenant();
  work.number = job.record.number();
  work.turn_time = job.standing.turn_time;
  work.memory_bytes = described.memory_bytes();
  work.mesh_bytes = described.mesh_bytes();
  work.run_time = absl::ToInt64Nanoseconds(run_time);
  TenantAccount& account = accounts_.of(work.tenant);
  account.waiting += 1;
  account.waiting_bytes += work.mesh_bytes;
  news_.work = true;
  InsertWork(work, &new_works_);
}

absl::Status JobTransaction::Flush() {
  PLANISH_RETURN_IF_ERROR(FlushRows());
  return accounts_.Write(&sql_);
}

absl::Status JobTransaction::FlushRows() {
  std::vector<RowBatch*> batches = {&inserts_, &labels_, &new_works_};
  for (auto& [columns, batch] : saves_) batches.push_back(&batch);
  batches.insert(batches.end(), {&events_, &works_});
  for (RowBatch* const batch : batches) PLANISH_RETURN_IF_ERROR(batch->Send(&sql_));
  for (const auto& [id, bytes] : blobs_) {  // in the order of ids, as in every transaction
    PLANISH_RETURN_IF_ERROR(sql_.RunLater(
        "INSERT INTO blobs VALUES (?, ?, ?) ON CONFLICT (tenant, sha256) DO UPDATE SET bytes = excluded.bytes",
        {std::string_view(id.tenant), SqlBytes{id.sha256}, SqlBytes{bytes->bytes()}}));
  }
  blobs_.clear();
  return absl::OkStatus();
}

void JobTransaction::Insert(JobRow* row) {
  JobRecord& record = row->record;
  const v1::Job& job = record.job();
  const std::string bytes = BytesWithoutReport(&record, record.mutable_job());
  const std::string report = job.report().SerializeAsString();
  inserts_.Add({record.number(), std::string_view(job.name()), std::string_view(job.tenant()), RequestId(record),
                job.state(), job.scheduling().priority(), IsTerminal(job.state()) ? 1 : 0,
                TimeUtil::TimestampToNanoseconds(job.end_time()), SqlBytes{record.work_key()},
                SqlBytes{record.mesh_sha256()}, SqlBytes{record.elements_sha256()}, SqlBytes{job.uv().uv_sha256()},
                SqlBytes{bytes}, SqlBytes{report}, TimeUtil::TimestampToNanoseconds(job.create_time()),
                std::string_view(record.work()), DueColumn(record)});
  Account(*row, record);
  row->standing = StandingOf(record, context_.max_attempts);
  news_.jobs.push_back(job.name());
  for (const auto& [key, value] : job.labels()) {
    labels_.Add({record.number(), std::string_view(key), std::string_view(value)});
  }
}

void JobTransaction::Save(JobRow* row, JobRecord* record) {
  const v1::Job& job = record->job();
  const std::string bytes = BytesWithoutReport(record, record->mutable_job());
  const std::string report = job.report().SerializeAsString();
  const std::int64_t due = DueColumn(*record);
  // Each column in a statement costs an update of its indexes, changed or not. So there are several statements.
  std::vector<std::string> columns = {"state", "record"};
  std::vector<SqlValue> values = {std::int64_t{job.state()}, SqlBytes{bytes}};
  unsigned which = 0;
  const auto set = [&](unsigned bit, const std::vector<std::pair<std::string, SqlValue>>& changes) {
    which |= bit;
    for (const auto& [column, value] : changes) {
      columns.push_back(column);
      values.push_back(value);
    }
  };
  if (row->had_request_id && record->request_id().empty()) set(1, {{"request_id", std::monostate()}});
  if (IsTerminal(job.state())) {
    set(2, {{"ended", std::int64_t{1}},
            {"end_time", TimeUtil::TimestampToNanoseconds(job.end_time())},
            {"uv_sha256", SqlBytes{job.uv().uv_sha256()}},
            {"report", SqlBytes{report}}});
  }
  if (due != row->due) set(4, {{"due", due}});
  values.emplace_back(record->number());
  saves_.try_emplace(which, RowBatch::Update("jobs", columns, "number")).first->second.Add(values);
  Account(*row, *record);
  row->standing = StandingOf(*record, context_.max_attempts);
  news_.jobs.push_back(job.name());
}

absl::Status JobTransaction::Delete(const std::vector<JobRow>& jobs) {
  for (const std::string from : {"events WHERE job", "labels WHERE job", "jobs WHERE number"}) {
    RowBatch rows = RowBatch::Of("DELETE FROM " + from + " IN ({rows})");
    for (const JobRow& job : jobs) rows.Add({job.record.number()});
    PLANISH_RETURN_IF_ERROR(rows.Send(&sql_));
  }
  for (const JobRow& job : jobs) {
    TenantAccount& account = accounts_.of(job.record.job().tenant());
    account.ended -= 1;
    account.result_bytes -= job.result_bytes;
    account.record_bytes -= job.record_bytes;
  }
  return absl::OkStatus();
}

void JobTransaction::Account(const JobRow& row, const JobRecord& record) {
  TenantAccount& account = accounts_.of(record.job().tenant());
  account.ended += (IsTerminal(record.job().state()) ? 1 : 0) - (row.standing.ended ? 1 : 0);
  account.result_bytes += ResultBytes(record) - row.result_bytes;
  account.record_bytes += record.kept_bytes() - row.record_bytes;
}

void JobTransaction::PutBlobs(const std::vector<BlobRow>& blobs) {
  for (const BlobRow& blob : blobs) blobs_.emplace(blob.id, blob.bytes->memory());
}

absl::Status JobTransaction::AddEvent(JobChange* change, v1::JobEvent event) {
  JobRecord& record = change->record;
  const std::int64_t last = record.last_sequence();
  record.set_last_sequence(last + 1);
  if (last + 1 > record.reserved_sequence()) record.set_reserved_sequence(last + 1 + kSequenceBlock);
  event.set_sequence(last + 1);
  PLANISH_ASSIGN_OR_RETURN(const std::int64_t now, Now());
  *event.mutable_time() = TimeUtil::NanosecondsToTimestamp(now);
  NoteEventBytes(event, &record);
  change->events.push_back(std::move(event));
  return absl::OkStatus();
}

void JobTransaction::SkipReserved(JobRecord* record) {
  record->set_last_sequence(std::max(record->last_sequence(), record->reserved_sequence()));
}

absl::Status JobTransaction::WriteEvents(JobChange* change) {
  if (change->events.empty()) return absl::OkStatus();
  EventKind kind = kProgressOnly;
  store::v1::EventBatch batch;
  for (v1::JobEvent& event : change->events) {
    if (event.has_job()) kind = kWithState;
    v1::Report* const report = event.has_job() ? event.mutable_job()->release_report() : nullptr;
    *batch.add_events() = event;
    if (report != nullptr) event.mutable_job()->set_allocated_report(report);
  }
  const std::string bytes = batch.SerializeAsString();
  const std::int64_t last = change->events.back().sequence();
  if (last / kKeptProgress != (change->events.front().sequence() - 1) / kKeptProgress && last > kKeptProgress) {
    PLANISH_RETURN_IF_ERROR(sql_.Run("DELETE FROM events WHERE job = ? AND sequence <= ? AND kind = ?",
                                     {change->record.number(), last - kKeptProgress, std::int64_t{kProgressOnly}})
                                .status());
  }
  events_.Add({change->record.number(), last, SqlBytes{bytes}, std::int64_t{kind}});
  return absl::OkStatus();
}

absl::Status JobTransaction::Announce(JobChange* change) {
  v1::JobEvent event;
  *event.mutable_job() = change->record.job();
  return AddEvent(change, std::move(event));
}

absl::Status JobTransaction::Act(JobAction action, JobChange* change) {
  v1::Job* job = change->record.mutable_job();
  PLANISH_ASSIGN_OR_RETURN(const std::int64_t now, Now());
  PLANISH_RETURN_IF_ERROR(Advance(action, absl::FromUnixNanos(now), job));
  if (job->state() == v1::JOB_STATE_SUCCEEDED && context_.retained_time < absl::InfiniteDuration()) {
    *job->mutable_expire_time() = ToTimestamp(TimeOf(job->end_time()) + context_.retained_time);
  }
  if (IsTerminal(job->state())) change->record.clear_owner();
  PLANISH_RETURN_IF_ERROR(Announce(change));
  if (IsTerminal(job->state()) && action != JobAction::kExpire) {
    change->record.set_kept_bytes(KeptBytes(change->record));
  }
  return absl::OkStatus();
}

absl::Status JobTransaction::Fail(const google::rpc::Status& error, JobChange* change) {
  *change->record.mutable_job()->mutable_error() = error;
  return Act(JobAction::kFail, change);
}

absl::StatusOr<bool> JobTransaction::EndIfWanted(JobChange* change) {
  const v1::Job& job = change->record.job();
  if (change->record.timed_out()) {
    PLANISH_RETURN_IF_ERROR(Fail(ToRpcStatus(TimedOut(job)), change));
    return true;
  }
  if (!job.cancel_requested()) return false;
  if (job.state() == v1::JOB_STATE_RUNNING) PLANISH_RETURN_IF_ERROR(Act(JobAction::kCancel, change));
  const JobAction last = job.state() == v1::JOB_STATE_QUEUED ? JobAction::kCancel : JobAction::kCancelled;
  PLANISH_RETURN_IF_ERROR(Act(last, change));
  return true;
}

absl::Status JobTransaction::Requeue(JobChange* change) {
  change->record.clear_owner();
  return Act(JobAction::kRequeue, change);
}

absl::Status JobTransaction::EndEarly(const LockedWork& work, EarlyEnd why, bool forget, JobChange* change) {
  JobRecord& record = change->record;
  if (IsEndWanted(record)) return absl::OkStatus();
  if (forget) record.clear_request_id();
  if (why == EarlyEnd::kCancel) {
    record.mutable_job()->set_cancel_requested(true);
  } else {
    record.set_timed_out(true);
  }
  // If a worker runs the work for this job alone, the job ends when the worker has answered.
  if (IsLeased(record) && work.Size() == 1) {
    const bool runs = record.job().state() == v1::JOB_STATE_RUNNING;
    return runs ? Act(JobAction::kCancel, change) : absl::OkStatus();
  }
  return EndIfWanted(change).status();
}

absl::Status JobTransaction::Stop(JobChange* change) {
  v1::Job* job = change->record.mutable_job();
  if (job->stop_requested()) return absl::OkStatus();
  job->set_stop_requested(true);
  if (job->state() == v1::JOB_STATE_RUNNING) return Act(JobAction::kStop, change);
  return Announce(change);
}

absl::Status JobTransaction::Start(const Lease& lease, JobChange* change) {
  JobRecord& record = change->record;
  record.set_owner(lease.owner);
  record.set_attempt(lease.attempt);
  record.mutable_job()->set_attempts(record.job().attempts() + 1);
  return Act(JobAction::kStart, change);
}

}  // namespace planish
