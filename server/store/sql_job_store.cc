// JobStore's verbs in SQL.
#include <algorithm>
#include <limits>
#include <utility>

#include "absl/strings/str_cat.h"
#include "absl/time/clock.h"
#include "core/base/error.h"
#include "core/base/status_macros.h"
#include "google/protobuf/util/time_util.h"
#include "server/link/rpc_status.h"
#include "server/store/job_questions.h"
#include "server/store/job_store.h"
#include "server/store/job_transaction.h"

namespace planish {
namespace {

// Another attempt at these jobs was lost.
google::rpc::Status LossError(const AttemptOutcome::Loss& loss, int attempts) {
  std::map<std::string, std::string> metadata = loss.metadata;
  metadata["attempts"] = absl::StrCat(attempts);
  const auto code = loss.reason == "OUT_OF_MEMORY" ? absl::StatusCode::kResourceExhausted : absl::StatusCode::kInternal;
  return ToRpcStatus(
      MakeError(code, loss.reason,
                absl::StrCat(loss.message, attempts > 1 ? absl::StrCat(" (", attempts, " attempts)") : ""), metadata));
}

google::rpc::Status ServerCrashed(int attempts) {
  return ToRpcStatus(MakeError(absl::StatusCode::kInternal, "SERVER_CRASHED",
                               absl::StrCat("the server died while it ran the job (", attempts, " attempts)"),
                               {{"attempts", absl::StrCat(attempts)}}));
}

bool IsEndWanted(const JobRecord& record) {
  return record.timed_out() || record.job().cancel_requested();
}

// Whether a job that comes may still join this work, all of whose jobs are given.
bool MayJoin(const std::vector<JobRow>& jobs) {
  return std::any_of(jobs.begin(), jobs.end(), [](const JobRow& row) {
    const bool stops = IsLeased(row.record) && row.record.job().stop_requested();
    return !stops && !IsEndWanted(row.record);
  });
}

class SqlJobStore : public JobStore {
 public:
  SqlJobStore(std::unique_ptr<SqlDatabase> database, JobStoreOptions options)
      : database_(std::move(database)), options_(std::move(options)), questions_(database_.get()) {}

  const std::string& id() const override { return database_->id(); }

  // ---- callers

  absl::StatusOr<AcceptedChange> Accept(const VerbContext& context, NewJob job) override {
    AcceptedChange accepted;
    const absl::Status status = Transact(database_.get(), Durability::kNow, [&](SqlConnection& sql) {
      JobTransaction transaction(&sql, &context);
      accepted = AcceptedChange();
      return AcceptIn(&transaction, job, &accepted);
    });
    PLANISH_RETURN_IF_ERROR(status);
    return accepted;
  }

  absl::StatusOr<JobChange> EndEarly(const VerbContext& context, const std::string& name, EarlyEnd why,
                                     bool forget) override {
    return ChangeJob(
        context, name,
        [&](JobTransaction& transaction, JobTransaction::Locked* locked, JobChange* change) -> absl::Status {
          JobRecord& record = change->record;
          if (IsEndWanted(record)) return absl::OkStatus();
          if (forget) record.clear_request_id();
          if (why == EarlyEnd::kCancel) {
            record.mutable_job()->set_cancel_requested(true);
          } else {
            record.set_timed_out(true);
          }
          // The worker has to answer first, if it works for nobody else.
          if (IsLeased(record) && locked->rows.size() == 1) {
            const bool runs = record.job().state() == v1::JOB_STATE_RUNNING;
            return runs ? transaction.Act(JobAction::kCancel, change) : absl::OkStatus();
          }
          return transaction.EndIfWanted(change).status();
        });
  }

  absl::StatusOr<JobChange> RequestStop(const VerbContext& context, const std::string& name) override {
    return ChangeJob(context, name,
                     [](JobTransaction& transaction, JobTransaction::Locked*, JobChange* change) -> absl::Status {
                       v1::Job* job = change->record.mutable_job();
                       if (job->stop_requested()) return absl::OkStatus();
                       job->set_stop_requested(true);
                       if (job->state() == v1::JOB_STATE_RUNNING) return transaction.Act(JobAction::kStop, change);
                       return transaction.Announce(change);
                     });
  }

  absl::StatusOr<JobChange> Fail(const VerbContext& context, const std::string& name, const google::rpc::Status& error,
                                 bool forget) override {
    return ChangeJob(context, name,
                     [&](JobTransaction& transaction, JobTransaction::Locked*, JobChange* change) -> absl::Status {
                       if (forget) change->record.clear_request_id();
                       return transaction.Fail(error, change);
                     });
  }

  absl::StatusOr<JobChange> Detach(const std::string& name) override {
    return ChangeJob({}, name, [](JobTransaction&, JobTransaction::Locked*, JobChange* change) {
      change->record.set_attached(false);
      return absl::OkStatus();
    });
  }

  // ---- workers

  absl::StatusOr<std::vector<ClaimedWork>> Claim(const VerbContext& context, const ClaimRequest& request) override {
    std::vector<ClaimedWork> claimed;
    const absl::Status status = Transact(database_.get(), Durability::kNow, [&](SqlConnection& sql) -> absl::Status {
      JobTransaction transaction(&sql, &context);
      claimed.clear();
      PLANISH_ASSIGN_OR_RETURN(const std::vector<std::string> works, Candidates(&sql, request));
      PLANISH_ASSIGN_OR_RETURN(const std::int64_t until, LeaseUntil(&sql, request.lease));
      for (const std::string& work : works) {
        PLANISH_ASSIGN_OR_RETURN(std::vector<JobRow> jobs, transaction.LockWork(work, /*wait=*/false));
        std::erase_if(jobs, [](const JobRow& row) { return row.record.job().state() != v1::JOB_STATE_QUEUED; });
        if (jobs.empty()) continue;
        ClaimedWork& taken = claimed.emplace_back();
        taken.lease = {work, 0, request.owner};
        for (const JobRow& row : jobs) taken.lease.attempt = std::max(taken.lease.attempt, row.record.attempt());
        ++taken.lease.attempt;
        for (JobRow& row : jobs) {
          row.lease_until = until;
          JobChange change = {std::move(row.record), {}};
          PLANISH_RETURN_IF_ERROR(transaction.Start(taken.lease, &change));
          PLANISH_RETURN_IF_ERROR(Write(&transaction, row, &change));
          taken.jobs.push_back(std::move(change));
        }
      }
      return absl::OkStatus();
    });
    PLANISH_RETURN_IF_ERROR(status);
    return claimed;
  }

  absl::StatusOr<std::vector<Wish>> Renew(const std::vector<Lease>& leases, absl::Duration lease) override {
    std::vector<Wish> wishes;
    const absl::Status status = Transact(database_.get(), Durability::kLater, [&](SqlConnection& sql) -> absl::Status {
      wishes.clear();
      PLANISH_ASSIGN_OR_RETURN(const std::int64_t until, LeaseUntil(&sql, lease));
      for (const Lease& held : leases) {
        PLANISH_ASSIGN_OR_RETURN(
            const SqlRows rows,
            sql.Run("UPDATE jobs SET lease_until = ? WHERE work = ? AND owner = ? AND attempt = ? AND ended = 0 "
                    "RETURNING number, lease_until, record, NULL",
                    {until, std::string_view(held.work), std::string_view(held.owner), held.attempt}));
        PLANISH_ASSIGN_OR_RETURN(const std::vector<JobRow> jobs, JobRowsOf(rows));
        wishes.push_back(WishOf(jobs));
      }
      return absl::OkStatus();
    });
    PLANISH_RETURN_IF_ERROR(status);
    return wishes;
  }

  absl::Status Report(const VerbContext& context, const Lease& lease,
                      const std::vector<v1::Progress>& progress) override {
    return ChangeWork(context, lease, Durability::kLater,
                      [&](JobTransaction& transaction, JobRow*, JobChange* change) -> absl::Status {
                        for (const v1::Progress& news : progress) {
                          v1::JobEvent event;
                          *event.mutable_progress() = news;
                          PLANISH_RETURN_IF_ERROR(transaction.AddEvent(change, std::move(event)));
                        }
                        return absl::OkStatus();
                      })
        .status();
  }

  absl::StatusOr<std::vector<JobChange>> Finish(const VerbContext& context, const Lease& lease,
                                                const AttemptOutcome& outcome) override {
    return ChangeWork(
        context, lease, Durability::kNow,
        [&](JobTransaction& transaction, JobRow* row, JobChange* change) -> absl::Status {
          return outcome.loss.has_value() ? Lose(&transaction, context, *outcome.loss, row, change)
                                          : Deliver(&transaction, outcome, change);
        },
        outcome.blobs);
  }

  absl::StatusOr<std::vector<JobChange>> Release(const VerbContext& context, const std::string& owner) override {
    const auto works = [&owner](SqlConnection& sql) {
      return sql.Run("SELECT DISTINCT work FROM jobs WHERE ended = 0 AND state != 1 AND owner = ?",
                     {std::string_view(owner)});
    };
    return ForWorks(context, works,
                    [&owner](JobTransaction& transaction, JobRow* row, JobChange* change) -> absl::Status {
                      if (!IsLeased(change->record) || change->record.owner() != owner) return absl::OkStatus();
                      PLANISH_ASSIGN_OR_RETURN(const bool ended, transaction.EndIfWanted(change));
                      return ended ? absl::OkStatus() : transaction.Requeue(row, change);
                    });
  }

  absl::StatusOr<JobChange> ReserveSequences(const VerbContext& context, const std::string& name,
                                             std::int64_t count) override {
    return ChangeJob(context, name, [&](JobTransaction&, JobTransaction::Locked*, JobChange* change) {
      const std::int64_t told = context.told != nullptr ? context.told(name) : 0;
      change->record.set_reserved_sequence(std::max(told, change->record.last_sequence()) + count);
      return absl::OkStatus();
    });
  }

  // ---- order

  absl::StatusOr<std::vector<JobChange>> Reap(const VerbContext& context, const std::string& sole_owner,
                                              int most) override {
    std::int64_t now = 0;
    const auto is_over = [&](const JobRow& row, const JobRecord& record) {
      if (!IsLeased(record)) return false;
      return sole_owner.empty() ? row.lease_until <= now : record.owner() != sole_owner;
    };
    const auto works = [&](SqlConnection& sql) -> absl::StatusOr<SqlRows> {
      PLANISH_ASSIGN_OR_RETURN(now, LeaseUntil(&sql, absl::ZeroDuration()));
      if (!sole_owner.empty()) {
        return sql.Run("SELECT DISTINCT work FROM jobs WHERE ended = 0 AND state != 1 AND owner != ? LIMIT ?",
                       {std::string_view(sole_owner), most});
      }
      return sql.Run("SELECT DISTINCT work FROM jobs WHERE ended = 0 AND state != 1 AND lease_until <= ? LIMIT ?",
                     {now, most});
    };
    return ForWorks(context, works, [&](JobTransaction& transaction, JobRow* row, JobChange* change) -> absl::Status {
      JobRecord& record = change->record;
      if (!is_over(*row, record)) return absl::OkStatus();
      // One without an owner was released by an earlier version of planish.
      const bool was_lost = !record.owner().empty();
      if (was_lost) {
        record.set_crashes(record.crashes() + 1);
        record.set_server_crashes(record.server_crashes() + 1);
      }
      PLANISH_ASSIGN_OR_RETURN(const bool ended, transaction.EndIfWanted(change, /*taken_over=*/true));
      if (ended) return absl::OkStatus();
      if (was_lost && record.crashes() >= context.max_attempts) {
        return transaction.Fail(ServerCrashed(record.job().attempts()), change, /*taken_over=*/true);
      }
      return transaction.Requeue(row, change, /*taken_over=*/true);
    });
  }

  absl::StatusOr<JobChange> Expire(const VerbContext& context, const std::string& name) override {
    JobChange change;
    const absl::Status status = Transact(database_.get(), Durability::kLater, [&](SqlConnection& sql) -> absl::Status {
      JobTransaction transaction(&sql, &context);
      PLANISH_RETURN_IF_ERROR(sql.Run("SELECT 1 FROM jobs WHERE name = ? {lock}", {std::string_view(name)}).status());
      PLANISH_ASSIGN_OR_RETURN(JobRow row, transaction.Find(name));
      change = {std::move(row.record), {}};
      if (!Advance(JobAction::kExpire, context.now, change.record.mutable_job()).ok()) return absl::OkStatus();
      change.record.clear_request_id();  // a caller that asks again wants UV
      return transaction.Save(row, &change.record);
    });
    PLANISH_RETURN_IF_ERROR(status);
    return change;
  }

  absl::Status Delete(const std::string& name) override {
    return Transact(database_.get(), Durability::kLater, [&](SqlConnection& sql) -> absl::Status {
      PLANISH_ASSIGN_OR_RETURN(const SqlRows rows, sql.Run("SELECT number, ended FROM jobs WHERE name = ? {lock}",
                                                           {std::string_view(name)}));
      if (rows.empty()) return JobNotFound(name);
      if (rows.Int(0, 1) == 0) {
        return MakeError(absl::StatusCode::kFailedPrecondition, "JOB_NOT_FINISHED",
                         absl::StrCat(name, " has not ended: cancel it first"), {{"job", name}});
      }
      const std::int64_t number = rows.Int(0, 0);
      for (const char* statement : {"DELETE FROM events WHERE job = ?", "DELETE FROM labels WHERE job = ?",
                                    "DELETE FROM jobs WHERE number = ?"}) {
        PLANISH_RETURN_IF_ERROR(sql.Run(statement, {number}).status());
      }
      return absl::OkStatus();
    });
  }

  // ---- questions

  absl::StatusOr<std::optional<JobRecord>> Find(const std::string& name) override { return questions_.Find(name); }
  absl::StatusOr<std::optional<JobRecord>> FindByRequestId(const std::string& tenant,
                                                           const std::string& request_id) override {
    return questions_.FindByRequestId(tenant, request_id);
  }
  absl::StatusOr<std::optional<JobRecord>> FindResult(const std::string& work_key) override {
    return questions_.FindResult(work_key);
  }
  absl::StatusOr<std::vector<JobRecord>> List(const JobQuery& query) override { return questions_.List(query); }
  absl::StatusOr<std::vector<JobRecord>> Unfinished() override { return questions_.Unfinished(); }
  absl::StatusOr<std::optional<JobRecord>> FirstEnded(const std::string& tenant, v1::JobState state) override {
    return questions_.FirstEnded(tenant, state);
  }
  absl::StatusOr<JobTotals> Totals() override { return questions_.Totals(); }
  absl::StatusOr<std::vector<v1::JobEvent>> Events(std::int64_t number, std::int64_t after) override {
    return questions_.Events(number, after);
  }
  absl::StatusOr<bool> UsesBlob(const BlobId& id) override { return questions_.UsesBlob(id); }
  BlobRows* rows() override { return database_->outlives_process() ? &questions_ : nullptr; }

 private:
  using OnJob = std::function<absl::Status(JobTransaction&, JobTransaction::Locked*, JobChange*)>;
  using OnRow = std::function<absl::Status(JobTransaction&, JobRow*, JobChange*)>;

  // Nanoseconds since 1970, by the clock of leases.
  absl::StatusOr<std::int64_t> LeaseUntil(SqlConnection* sql, absl::Duration lease) const {
    if (lease == absl::InfiniteDuration()) return std::numeric_limits<std::int64_t>::max();
    if (options_.lease_clock != nullptr) return absl::ToUnixNanos(options_.lease_clock() + lease);
    if (!database_->has_clock()) return absl::ToUnixNanos(absl::Now() + lease);
    PLANISH_ASSIGN_OR_RETURN(const SqlRows now, sql->Run("SELECT {now}", {}));
    return now.Int(0, 0) + absl::ToInt64Nanoseconds(lease);
  }

  // Writes what changed of a job that is there.
  static absl::Status Write(JobTransaction* transaction, const JobRow& row, JobChange* change) {
    PLANISH_RETURN_IF_ERROR(transaction->Save(row, &change->record));
    return transaction->WriteEvents(change);
  }

  // One job that has not ended, whose work is locked.
  absl::StatusOr<JobChange> ChangeJob(const VerbContext& context, const std::string& name, const OnJob& body) {
    JobChange change;
    const absl::Status status = Transact(database_.get(), Durability::kNow, [&](SqlConnection& sql) -> absl::Status {
      JobTransaction transaction(&sql, &context);
      PLANISH_ASSIGN_OR_RETURN(JobTransaction::Locked locked, transaction.LockJob(name));
      change = {std::move(locked.row().record), {}};
      if (!locked.place.has_value()) return absl::OkStatus();
      PLANISH_RETURN_IF_ERROR(body(transaction, &locked, &change));
      return Write(&transaction, locked.row(), &change);
    });
    PLANISH_RETURN_IF_ERROR(status);
    return change;
  }

  // All jobs of the work that is held by the lease.
  absl::StatusOr<std::vector<JobChange>> ChangeWork(const VerbContext& context, const Lease& lease,
                                                    Durability durability, const OnRow& body,
                                                    const std::vector<BlobRow>& blobs = {}) {
    std::vector<JobChange> changes;
    const absl::Status status = Transact(database_.get(), durability, [&](SqlConnection& sql) -> absl::Status {
      JobTransaction transaction(&sql, &context);
      changes.clear();
      PLANISH_ASSIGN_OR_RETURN(std::vector<JobRow> jobs, transaction.LockWork(lease.work));
      std::erase_if(jobs, [&lease](const JobRow& row) {
        const JobRecord& record = row.record;
        return !IsLeased(record) || record.owner() != lease.owner || record.attempt() != lease.attempt;
      });
      if (jobs.empty()) return LeaseLost(lease);
      PLANISH_RETURN_IF_ERROR(transaction.PutBlobs(blobs));
      for (JobRow& row : jobs) {
        JobChange change = {std::move(row.record), {}};
        PLANISH_RETURN_IF_ERROR(body(transaction, &row, &change));
        PLANISH_RETURN_IF_ERROR(Write(&transaction, row, &change));
        changes.push_back(std::move(change));
      }
      return absl::OkStatus();
    });
    PLANISH_RETURN_IF_ERROR(status);
    return changes;
  }

  // All jobs of all `works`, in one transaction; those that the body leaves without an event are not among the changes.
  absl::StatusOr<std::vector<JobChange>> ForWorks(const VerbContext& context,
                                                  const std::function<absl::StatusOr<SqlRows>(SqlConnection&)>& works,
                                                  const OnRow& body) {
    std::vector<JobChange> changes;
    const absl::Status status = Transact(database_.get(), Durability::kNow, [&](SqlConnection& sql) -> absl::Status {
      JobTransaction transaction(&sql, &context);
      changes.clear();
      PLANISH_ASSIGN_OR_RETURN(const SqlRows names, works(sql));
      for (std::size_t i = 0; i < names.size(); ++i) {
        PLANISH_ASSIGN_OR_RETURN(std::vector<JobRow> jobs, transaction.LockWork(names.Bytes(i, 0)));
        for (JobRow& row : jobs) {
          JobChange change = {std::move(row.record), {}};
          PLANISH_RETURN_IF_ERROR(body(transaction, &row, &change));
          if (change.events.empty()) continue;
          PLANISH_RETURN_IF_ERROR(Write(&transaction, row, &change));
          changes.push_back(std::move(change));
        }
      }
      return absl::OkStatus();
    });
    PLANISH_RETURN_IF_ERROR(status);
    return changes;
  }

  // ---- parts of Accept()

  static absl::Status AcceptIn(JobTransaction* transaction, const NewJob& job, AcceptedChange* accepted) {
    SqlConnection& sql = transaction->sql();
    const v1::Job& asked = job.record.job();
    JobChange& change = accepted->change;
    change.record = job.record;
    change.record.set_work(asked.name());
    JobRow row;
    std::optional<JobRecord> result;
    std::vector<JobRow> others;
    if (!asked.scheduling().fresh()) {
      // Of two that come at the same time the second one finds the first.
      PLANISH_RETURN_IF_ERROR(sql.Serialize(job.record.work_key(), /*wait=*/true).status());
      PLANISH_ASSIGN_OR_RETURN(result, Result(transaction, job));
      if (!result.has_value()) {
        PLANISH_ASSIGN_OR_RETURN(others, WorkToJoin(transaction, job.record));
      }
    }
    accepted->shares = result.has_value() || !others.empty();
    PLANISH_RETURN_IF_ERROR(transaction->Announce(&change));
    if (result.has_value()) {
      const v1::Job& source = result->job();
      v1::Job* own = change.record.mutable_job();
      own->set_result_of(source.result_of().empty() ? source.name() : source.result_of());
      *own->mutable_report() = source.report();
      *own->mutable_uv() = source.uv();
      PLANISH_RETURN_IF_ERROR(transaction->Act(JobAction::kSucceed, &change));
    } else if (!others.empty()) {
      const JobRow& first = others.front();
      change.record.set_work(first.record.work());
      change.record.mutable_job()->set_result_of(first.record.work());
      // As its first event says, too.
      change.events.front().mutable_job()->set_result_of(first.record.work());
      if (IsLeased(first.record)) {
        row.lease_until = first.lease_until;
        PLANISH_RETURN_IF_ERROR(
            transaction->Start({first.record.work(), first.record.attempt(), first.record.owner()}, &change));
      }
    }
    row.record = std::move(change.record);
    PLANISH_ASSIGN_OR_RETURN(accepted->created, transaction->Insert(&row, job.turn));
    change.record = std::move(row.record);
    if (accepted->created) {
      PLANISH_RETURN_IF_ERROR(transaction->PutBlobs(job.blobs));
      return transaction->WriteEvents(&change);
    }
    // Its name or its request id is taken.
    PLANISH_ASSIGN_OR_RETURN(std::optional<JobRecord> known, Known(&sql, job.record));
    if (!known.has_value()) return StoreUnavailable("two jobs came at the same time; try again");
    *accepted = {false, false, {*std::move(known), {}}};
    return absl::OkStatus();
  }

  static absl::StatusOr<std::optional<JobRecord>> Known(SqlConnection* sql, const JobRecord& record) {
    static const std::string by_name = absl::StrCat("SELECT ", kJobColumns, " FROM jobs WHERE name = ?");
    static const std::string by_request =
        absl::StrCat("SELECT ", kJobColumns, " FROM jobs WHERE tenant = ? AND request_id = ?");
    PLANISH_ASSIGN_OR_RETURN(SqlRows rows, sql->Run(by_name, {std::string_view(record.job().name())}));
    if (rows.empty() && !record.request_id().empty()) {
      PLANISH_ASSIGN_OR_RETURN(
          rows, sql->Run(by_request, {std::string_view(record.job().tenant()), std::string_view(record.request_id())}));
    }
    if (rows.empty()) return std::nullopt;
    PLANISH_ASSIGN_OR_RETURN(std::vector<JobRow> jobs, JobRowsOf(rows));
    return std::move(jobs.front().record);
  }

  static absl::StatusOr<std::optional<JobRecord>> Result(JobTransaction* transaction, const NewJob& job) {
    if (job.result_of.empty()) return std::nullopt;
    PLANISH_RETURN_IF_ERROR(
        transaction->sql().Run("SELECT 1 FROM jobs WHERE name = ? {lock}", {std::string_view(job.result_of)}).status());
    absl::StatusOr<JobRow> source = transaction->Find(job.result_of);
    if (absl::IsNotFound(source.status())) return std::nullopt;
    PLANISH_RETURN_IF_ERROR(source.status());
    const bool is_kept = source->record.job().state() == v1::JOB_STATE_SUCCEEDED;
    if (!is_kept || source->record.work_key() != job.record.work_key()) return std::nullopt;
    return std::move(source->record);
  }

  // The jobs of the newest work with this key; empty if there is none to join.
  static absl::StatusOr<std::vector<JobRow>> WorkToJoin(JobTransaction* transaction, const JobRecord& record) {
    PLANISH_ASSIGN_OR_RETURN(
        const SqlRows works,
        transaction->sql().Run(
            "SELECT work FROM jobs WHERE work_key = ? AND tenant = ? AND ended = 0 ORDER BY number DESC LIMIT 1",
            {SqlBytes{record.work_key()}, std::string_view(record.job().tenant())}));
    if (works.empty()) return std::vector<JobRow>();
    PLANISH_ASSIGN_OR_RETURN(std::vector<JobRow> jobs, transaction->LockWork(works.Bytes(0, 0)));
    if (!MayJoin(jobs)) jobs.clear();
    return jobs;
  }

  // ---- parts of Claim(), Renew() and Finish()

  static absl::StatusOr<std::vector<std::string>> Candidates(SqlConnection* sql, const ClaimRequest& request) {
    if (!request.work.empty()) return std::vector<std::string>{request.work};
    PLANISH_ASSIGN_OR_RETURN(
        const SqlRows rows,
        sql->Run("SELECT work, memory_bytes FROM jobs WHERE state = 1 ORDER BY turn_time, number LIMIT ? {skip}",
                 {request.most}));
    std::vector<std::string> works;
    std::int64_t memory = 0;
    for (std::size_t i = 0; i < rows.size(); ++i) {
      const std::string& work = rows.Bytes(i, 0);
      if (std::find(works.begin(), works.end(), work) != works.end()) continue;
      memory += rows.Int(i, 1);
      // What has waited longest waits for room; it is not passed by for ever.
      if (request.memory_bytes > 0 && memory > request.memory_bytes) break;
      works.push_back(work);
    }
    return works;
  }

  static Wish WishOf(const std::vector<JobRow>& jobs) {
    if (jobs.empty()) return Wish::kGiveUp;
    const bool cancel =
        std::all_of(jobs.begin(), jobs.end(), [](const JobRow& row) { return IsEndWanted(row.record); });
    const bool stop =
        std::all_of(jobs.begin(), jobs.end(), [](const JobRow& row) { return row.record.job().stop_requested(); });
    return cancel ? Wish::kCancel : stop ? Wish::kStop : Wish::kGoOn;
  }

  // What the worker delivered becomes of one of its jobs.
  static absl::Status Deliver(JobTransaction* transaction, const AttemptOutcome& outcome, JobChange* change) {
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

  static absl::Status Lose(JobTransaction* transaction, const VerbContext& context, const AttemptOutcome::Loss& loss,
                           JobRow* row, JobChange* change) {
    JobRecord& record = change->record;
    record.set_crashes(record.crashes() + 1);
    PLANISH_ASSIGN_OR_RETURN(const bool ended, transaction->EndIfWanted(change));
    if (ended) return absl::OkStatus();
    if (loss.is_final || record.crashes() >= context.max_attempts) {
      return transaction->Fail(LossError(loss, record.job().attempts()), change);
    }
    return transaction->Requeue(row, change);
  }

  const std::unique_ptr<SqlDatabase> database_;
  const JobStoreOptions options_;
  JobQuestions questions_;
};

}  // namespace

absl::Status JobNotFound(const std::string& name) {
  return MakeError(absl::StatusCode::kNotFound, "JOB_NOT_FOUND",
                   absl::StrCat("there is no job '", name, "': it never was, or it was deleted or dropped"),
                   {{"job", name}});
}

absl::Status LeaseLost(const Lease& lease) {
  return MakeError(absl::StatusCode::kAborted, "LEASE_LOST",
                   absl::StrCat("attempt ", lease.attempt, " at ", lease.work, " is no longer that of ", lease.owner));
}

std::unique_ptr<JobStore> NewJobStore(std::unique_ptr<SqlDatabase> database, JobStoreOptions options) {
  return std::make_unique<SqlJobStore>(std::move(database), std::move(options));
}

absl::StatusOr<std::unique_ptr<JobStore>> OpenJobStore(const std::string& path) {
  PLANISH_ASSIGN_OR_RETURN(std::unique_ptr<SqlDatabase> database, OpenSqliteDatabase(path));
  return NewJobStore(std::move(database));
}

}  // namespace planish
