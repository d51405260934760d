// JobStore's verbs in SQL.
#include <algorithm>
#include <deque>
#include <limits>
#include <map>
#include <numeric>
#include <set>
#include <string>
#include <utility>

#include "absl/strings/str_cat.h"
#include "absl/time/clock.h"
#include "core/base/error.h"
#include "core/base/status_macros.h"
#include "server/store/call_groups.h"
#include "server/store/endings.h"
#include "server/store/job_questions.h"
#include "server/store/job_store.h"
#include "server/store/job_transaction.h"
#include "server/store/job_verbs.h"
#include "server/store/store_news.h"

namespace planish {
namespace {

// Transactions of this process at the same time: a front has callers from everywhere, the workers of one machine need
// one connection for what they finish. And calls in each.
constexpr int kAccepting = 2, kFinishing = 1;
constexpr std::size_t kGroupedCalls = 16;

class SqlJobStore : public JobStore {
 public:
  SqlJobStore(std::unique_ptr<SqlDatabase> database, JobStoreOptions options)
      : database_(std::move(database)), clock_(std::move(options.clock)), questions_(database_.get()) {
    if (clock_ == nullptr && !database_->has_clock()) clock_ = absl::Now;
    database_->Listen([this](std::string_view message) { listeners_.Call(DecodeNews(message)); });
  }

  const std::string& id() const override { return database_->id(); }
  bool is_shared() const override { return database_->is_shared(); }

  absl::StatusOr<absl::Time> Now() override { return questions_.Now(clock_); }

  // ---- callers

  absl::StatusOr<AcceptedChange> Accept(const VerbContext& context, NewJob job) override {
    std::vector<std::string> keys = KeysOf(job);
    AcceptCall call = {std::move(job), std::move(keys), {}, {}};
    PLANISH_RETURN_IF_ERROR(
        ChangeTogether(context, &accepts_, &call, [&](JobTransaction& transaction, const auto& calls) {
          return AcceptIn(&transaction, calls, &recent_accounts_);
        }));
    return std::move(call.accepted);
  }

  std::vector<absl::StatusOr<AcceptedChange>> AcceptAll(const VerbContext& context, std::vector<NewJob> jobs) override {
    std::vector<AcceptCall> calls;
    std::vector<AcceptCall*> pointers;
    calls.reserve(jobs.size());
    for (NewJob& job : jobs) {
      std::vector<std::string> keys = KeysOf(job);
      calls.push_back({std::move(job), std::move(keys), {}, {}});
      pointers.push_back(&calls.back());
    }
    ChangeAll(context, pointers, [&](JobTransaction& transaction, const std::vector<AcceptCall*>& together) {
      return AcceptIn(&transaction, together, &recent_accounts_);
    });
    std::vector<absl::StatusOr<AcceptedChange>> answers;
    for (AcceptCall& call : calls) {
      call.status.ok() ? answers.emplace_back(std::move(call.accepted)) : answers.emplace_back(call.status);
    }
    return answers;
  }

  absl::StatusOr<JobChange> EndEarly(const VerbContext& context, const std::string& name, EarlyEnd why,
                                     bool forget) override {
    return ChangeJob(context, name, [&](JobTransaction& transaction, const LockedWork& work, JobChange* change) {
      return transaction.EndEarly(work, why, forget, change);
    });
  }

  absl::StatusOr<JobChange> RequestStop(const VerbContext& context, const std::string& name) override {
    return ChangeJob(context, name, [](JobTransaction& transaction, const LockedWork&, JobChange* change) {
      return transaction.Stop(change);
    });
  }

  absl::StatusOr<JobChange> Fail(const VerbContext& context, const std::string& name, const google::rpc::Status& error,
                                 bool forget) override {
    return ChangeJob(context, name, [&](JobTransaction& transaction, const LockedWork&, JobChange* change) {
      if (forget) change->record.clear_request_id();
      return transaction.Fail(error, change);
    });
  }

  absl::StatusOr<JobChange> Detach(const std::string& name) override {
    return ChangeJob({}, name, [](JobTransaction&, const LockedWork&, JobChange* change) {
      change->record.set_attached(false);
      return absl::OkStatus();
    });
  }

  absl::Status KeepCallers(const std::vector<std::string>& names, absl::Duration time) override {
    std::vector<std::string> ordered = names;
    std::sort(ordered.begin(), ordered.end());
    return Change({}, Durability::kLater, [&](JobTransaction& transaction) -> absl::Status {
      PLANISH_ASSIGN_OR_RETURN(const std::int64_t now, transaction.Now());
      const absl::Time until = absl::FromUnixNanos(now) + time;
      for (const std::string& name : ordered) {
        absl::StatusOr<JobTransaction::Locked> locked = transaction.LockJob(name);
        if (absl::IsNotFound(locked.status())) continue;
        PLANISH_RETURN_IF_ERROR(locked.status());
        if (!locked->place.has_value() || !locked->row().record.attached()) continue;
        *locked->row().record.mutable_callers_until() = ToTimestamp(until);
        transaction.Save(&locked->row(), &locked->row().record);
      }
      return absl::OkStatus();
    });
  }

  // ---- workers

  absl::StatusOr<std::vector<ClaimedWork>> Claim(const VerbContext& context, const ClaimRequest& request,
                                                 ClaimWait* wait) override {
    // An attempt that ends the machine must count, if the store is on that machine. A database elsewhere that forgets
    // the last claims has the work waiting again, and what their owners say under the old leases changes nothing: the
    // next attempt has the same number, but another owner. If it is the same owner, JobRunner goes on with the first.
    const Durability durability = database_->is_shared() ? Durability::kLater : Durability::kNow;
    std::vector<ClaimedWork> claimed;
    PLANISH_RETURN_IF_ERROR(Change(context, durability, [&](JobTransaction& transaction) {
      return ClaimIn(&transaction, request, &claimed, wait);
    }));
    return claimed;
  }

  absl::StatusOr<std::vector<Wish>> Renew(const std::vector<Lease>& leases, absl::Duration lease) override {
    std::vector<Wish> wishes(leases.size());
    std::vector<std::size_t> order(leases.size());  // one everywhere, so that no two wait for each other
    std::iota(order.begin(), order.end(), 0);
    std::sort(order.begin(), order.end(),
              [&](std::size_t a, std::size_t b) { return leases[a].work < leases[b].work; });
    const absl::Status status = Change({}, Durability::kLater, [&](JobTransaction& transaction) -> absl::Status {
      PLANISH_ASSIGN_OR_RETURN(const std::int64_t until, LeaseUntil(&transaction, lease));
      RowBatch renewals = RowBatch::Of(
          "UPDATE works SET lease_until = v.column4 FROM (VALUES {rows}) AS v WHERE name = v.column1 AND "
          "owner = v.column2 AND attempt = v.column3 AND running != 0 RETURNING name, attempt, wish");
      for (const std::size_t i : order) {
        renewals.Add({std::string_view(leases[i].work), std::string_view(leases[i].owner), leases[i].attempt, until});
      }
      std::deque<SqlRows> answers;
      PLANISH_RETURN_IF_ERROR(renewals.Send(&transaction.sql(), &answers));
      PLANISH_RETURN_IF_ERROR(transaction.sql().Flush());
      std::map<std::pair<std::string, std::int64_t>, Wish> renewed;
      for (const SqlRows& rows : answers) {
        for (std::size_t i = 0; i < rows.size(); ++i) {
          renewed[{rows.Bytes(i, 0), rows.Int(i, 1)}] = static_cast<Wish>(rows.Int(i, 2));
        }
      }
      for (std::size_t i = 0; i < leases.size(); ++i) {
        const auto found = renewed.find({leases[i].work, leases[i].attempt});
        wishes[i] = found == renewed.end() ? Wish::kGiveUp : found->second;
      }
      return absl::OkStatus();
    });
    PLANISH_RETURN_IF_ERROR(status);
    return wishes;
  }

  absl::StatusOr<std::vector<JobChange>> Report(const VerbContext& context, const Lease& lease,
                                                const std::vector<v1::Progress>& progress) override {
    // A loss of power may take back what was told. So numbers are reserved, and that has to be durable. What a shared
    // database forgets costs no number: its watchers live on, and JobFeed knows what they were told.
    const bool may_reserve = !database_->is_shared();
    bool reserves = false;
    const auto report = [&](Durability durability) {
      return ChangeWork(context, lease, durability,
                        [&](JobTransaction& transaction, const LockedWork&, JobChange* change) -> absl::Status {
                          const std::int64_t reserved = change->record.reserved_sequence();
                          PLANISH_RETURN_IF_ERROR(AddProgress(&transaction, progress, change));
                          reserves = may_reserve && change->record.reserved_sequence() != reserved;
                          if (reserves && durability == Durability::kLater) return absl::AbortedError("not durable");
                          return absl::OkStatus();
                        });
    };
    absl::StatusOr<std::vector<JobChange>> changes = report(Durability::kLater);
    return reserves && !changes.ok() ? report(Durability::kNow) : std::move(changes);
  }

  absl::StatusOr<std::vector<JobChange>> Finish(const VerbContext& context, const Lease& lease,
                                                const AttemptOutcome& outcome) override {
    if (outcome.loss.has_value() || outcome.memory_bytes > 0) {
      return ChangeWork(context, lease, Durability::kNow,
                        [&](JobTransaction& transaction, const LockedWork&, JobChange* change) -> absl::Status {
                          PLANISH_RETURN_IF_ERROR(AddProgress(&transaction, outcome.progress, change));
                          return outcome.loss.has_value() ? Lose(&transaction, *outcome.loss, change)
                                                          : Enlarge(&transaction, outcome.memory_bytes, change);
                        });
    }
    FinishCall call = {lease, outcome, {lease.work}, {}, {}};
    PLANISH_RETURN_IF_ERROR(ChangeTogether(context, &finishes_, &call, FinishIn));
    if (call.is_lost) return LeaseLost(lease);
    return std::move(call.changes);
  }

  absl::StatusOr<std::vector<JobChange>> Release(const VerbContext& context, const std::string& owner,
                                                 const std::string& work) override {
    const auto works = [&](JobTransaction& transaction) {
      return transaction.sql().Run("SELECT name FROM works WHERE running = 1 AND owner = ? AND (? = '' OR name = ?)",
                                   {std::string_view(owner), std::string_view(work), std::string_view(work)});
    };
    return ForWorks(context, works,
                    [&owner](JobTransaction& transaction, const LockedWork& held, JobChange* change) -> absl::Status {
                      if (!held.before.running || held.before.owner != owner) return absl::OkStatus();
                      PLANISH_ASSIGN_OR_RETURN(const bool ended, transaction.EndIfWanted(change));
                      return ended ? absl::OkStatus() : transaction.Requeue(change);
                    });
  }

  // ---- order

  absl::StatusOr<std::vector<JobChange>> Reap(const VerbContext& context, const std::string& sole_owner,
                                              int most) override {
    std::int64_t now = 0;
    const auto is_over = [&](const WorkRow& work) {
      if (!work.running) return false;
      return sole_owner.empty() ? work.lease_until <= now : work.owner != sole_owner;
    };
    // In the order of the index of what runs: without one PostgreSQL may walk through all that wait.
    const auto works = [&](JobTransaction& transaction) -> absl::StatusOr<SqlRows> {
      PLANISH_ASSIGN_OR_RETURN(now, transaction.Now());
      if (!sole_owner.empty()) {
        return transaction.sql().Run(
            "SELECT name FROM works WHERE running = 1 AND owner != ? ORDER BY lease_until LIMIT ?",
            {std::string_view(sole_owner), most});
      }
      return transaction.sql().Run(
          "SELECT name FROM works WHERE running = 1 AND lease_until <= ? ORDER BY lease_until LIMIT ?", {now, most});
    };
    return ForWorks(context, works,
                    [&](JobTransaction& transaction, const LockedWork& work, JobChange* change) -> absl::Status {
                      JobRecord& record = change->record;
                      if (!is_over(work.before) || !IsLeased(record)) return absl::OkStatus();
                      if (!sole_owner.empty()) JobTransaction::SkipReserved(&record);
                      // One without an owner was released by an earlier version of planish.
                      const bool was_lost = !record.owner().empty();
                      if (was_lost) {
                        record.set_crashes(record.crashes() + 1);
                        record.set_server_crashes(record.server_crashes() + 1);
                      }
                      PLANISH_ASSIGN_OR_RETURN(const bool ended, transaction.EndIfWanted(change));
                      if (ended) return absl::OkStatus();
                      if (was_lost && record.crashes() >= context.max_attempts) {
                        return transaction.Fail(ServerCrashed(record.job().attempts()), change);
                      }
                      return transaction.Requeue(change);
                    });
  }

  absl::StatusOr<std::vector<JobChange>> EndOverdue(const VerbContext& context, int most) override {
    const auto works = [&](JobTransaction& transaction) -> absl::StatusOr<SqlRows> {
      PLANISH_ASSIGN_OR_RETURN(const std::int64_t now, transaction.Now());
      return transaction.sql().Run("SELECT work FROM jobs WHERE ended = 0 AND due <= ? ORDER BY due LIMIT ?",
                                   {now, most});
    };
    return ForWorks(context, works, EndIfOverdue);
  }

  absl::StatusOr<JobChange> Expire(const VerbContext& context, const std::string& name) override {
    JobChange change;
    const absl::Status status = Change(context, Durability::kLater, [&](JobTransaction& transaction) -> absl::Status {
      PLANISH_RETURN_IF_ERROR(
          transaction.sql().Run("SELECT 1 FROM jobs WHERE name = ? {lock}", {std::string_view(name)}).status());
      PLANISH_ASSIGN_OR_RETURN(JobRow row, transaction.Find(name));
      change = {std::move(row.record), {}};
      PLANISH_ASSIGN_OR_RETURN(const std::int64_t now, transaction.Now());
      const absl::Time time = absl::FromUnixNanos(now);
      if (!Advance(JobAction::kExpire, time, change.record.mutable_job()).ok()) return absl::OkStatus();
      change.record.clear_request_id();  // a caller that asks again wants UV
      transaction.Save(&row, &change.record);
      return absl::OkStatus();
    });
    PLANISH_RETURN_IF_ERROR(status);
    return change;
  }

  absl::Status Delete(const std::string& name) override {
    return Change({}, Durability::kLater, [&](JobTransaction& transaction) -> absl::Status {
      static const std::string sql = absl::StrCat("SELECT ", kJobColumns, " FROM jobs WHERE name = ? {lock}");
      PLANISH_ASSIGN_OR_RETURN(const SqlRows rows, transaction.sql().Run(sql, {std::string_view(name)}));
      if (rows.empty()) return JobNotFound(name);
      PLANISH_ASSIGN_OR_RETURN(const std::vector<JobRow> jobs, JobRowsOf(rows));
      if (!jobs[0].standing.ended) {
        return MakeError(absl::StatusCode::kFailedPrecondition, "JOB_NOT_FINISHED",
                         absl::StrCat(name, " has not ended: cancel it first"), {{"job", name}});
      }
      return transaction.Delete(jobs);
    });
  }

  absl::StatusOr<std::vector<JobRecord>> DeleteOldest(const std::string& tenant, int most) override {
    std::vector<JobRecord> gone;
    const absl::Status status = Change({}, Durability::kLater, [&](JobTransaction& transaction) -> absl::Status {
      gone.clear();
      const std::string sql =
          absl::StrCat("SELECT ", kJobColumns, " FROM jobs WHERE ended = 1 ", tenant.empty() ? "" : "AND tenant = ? ",
                       "ORDER BY end_time, number LIMIT ? {skip}");
      std::vector<SqlValue> values;
      if (!tenant.empty()) values.emplace_back(std::string_view(tenant));
      values.emplace_back(std::int64_t{most});
      PLANISH_ASSIGN_OR_RETURN(const SqlRows rows, transaction.sql().Run(sql, values));
      PLANISH_ASSIGN_OR_RETURN(std::vector<JobRow> jobs, JobRowsOf(rows));
      PLANISH_RETURN_IF_ERROR(transaction.Delete(jobs));
      for (JobRow& job : jobs) gone.push_back(std::move(job.record));
      return absl::OkStatus();
    });
    PLANISH_RETURN_IF_ERROR(status);
    return gone;
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
  absl::StatusOr<FairAccounts> Accounts() override { return questions_.Accounts(); }
  absl::StatusOr<QueueState> Queue() override { return questions_.Queue(clock_); }
  absl::StatusOr<std::vector<std::pair<std::string, Wish>>> Wishes(const std::string& owner) override {
    return questions_.Wishes(owner);
  }
  absl::StatusOr<bool> IsUnderWay(const std::string& tenant, const std::string& work_key) override {
    return questions_.IsUnderWay(tenant, work_key);
  }
  absl::StatusOr<std::optional<JobRecord>> LastEnded(const std::string& tenant) override {
    return questions_.LastEnded(tenant);
  }
  absl::StatusOr<std::optional<v1::Progress>> LastProgress(std::int64_t number) override {
    return questions_.LastProgress(number);
  }
  absl::StatusOr<std::vector<v1::JobEvent>> Events(std::int64_t number, std::int64_t after) override {
    return questions_.Events(number, after);
  }
  absl::StatusOr<std::vector<JobPosition>> Positions(const std::vector<std::int64_t>& numbers) override {
    return questions_.Positions(numbers);
  }
  absl::StatusOr<bool> UsesBlob(const BlobId& id) override { return questions_.UsesBlob(id); }
  Subscription Subscribe(Listener listener) override { return listeners_.Add(std::move(listener)); }
  bool hears_others() const override { return database_->hears(); }
  BlobRows* rows() override { return database_->outlives_process() ? &questions_ : nullptr; }

 private:
  using OnJob = std::function<absl::Status(JobTransaction&, const LockedWork&, JobChange*)>;

  // A call of Finish().
  struct FinishCall {
    const Lease& lease;
    const AttemptOutcome& outcome;
    std::vector<std::string> keys;  // the work
    absl::Status status;
    std::vector<JobChange> changes;
    bool is_lost = false;  // the lease
  };

  // Runs `body` in a transaction, and tells of it afterwards.
  absl::Status Change(const VerbContext& context, Durability durability,
                      const std::function<absl::Status(JobTransaction&)>& body) {
    StoreNews news;
    const absl::Status status = Transact(database_.get(), durability, [&](SqlConnection& sql) -> absl::Status {
      JobTransaction transaction(&sql, &context, &clock_);
      PLANISH_RETURN_IF_ERROR(body(transaction));
      PLANISH_RETURN_IF_ERROR(transaction.Flush());
      news = std::move(transaction.news());
      return absl::OkStatus();
    });
    // After an error the transaction may still have been done; listeners look by themselves every few seconds.
    if (status.ok()) Tell(std::move(news));
    return status;
  }

  void Tell(StoreNews news) {
    if (!news.work && news.jobs.empty() && news.works.empty()) return;
    news.local = true;
    listeners_.Call(news);
    database_->Publish(EncodeNews(news));
  }

  // Writes what changed of a job that is there.
  static absl::Status Write(JobTransaction* transaction, JobRow* row, JobChange* change) {
    transaction->Save(row, &change->record);
    return transaction->WriteEvents(change);
  }

  // One job that has not ended, whose work is locked.
  absl::StatusOr<JobChange> ChangeJob(const VerbContext& context, const std::string& name, const OnJob& body) {
    JobChange change;
    const absl::Status status = Change(context, Durability::kNow, [&](JobTransaction& transaction) -> absl::Status {
      PLANISH_ASSIGN_OR_RETURN(JobTransaction::Locked locked, transaction.LockJob(name));
      change = {std::move(locked.row().record), {}};
      if (!locked.place.has_value()) return absl::OkStatus();
      PLANISH_RETURN_IF_ERROR(body(transaction, locked.work, &change));
      PLANISH_RETURN_IF_ERROR(Write(&transaction, &locked.row(), &change));
      return transaction.Settle(&locked.work);
    });
    PLANISH_RETURN_IF_ERROR(status);
    return change;
  }

  // All jobs of the work that is held by the lease.
  absl::StatusOr<std::vector<JobChange>> ChangeWork(const VerbContext& context, const Lease& lease,
                                                    Durability durability, const OnJob& body) {
    std::vector<JobChange> changes;
    const absl::Status status = Change(context, durability, [&](JobTransaction& transaction) -> absl::Status {
      changes.clear();
      PLANISH_ASSIGN_OR_RETURN(std::optional<LockedWork> work, transaction.LockWork(lease.work));
      const bool holds =
          work.has_value() && work->row.running && work->row.owner == lease.owner && work->row.attempt == lease.attempt;
      if (!holds) return LeaseLost(lease);
      return ForJobs(&transaction, &*work, body, &changes);
    });
    PLANISH_RETURN_IF_ERROR(status);
    return changes;
  }

  // What comes while others are at it goes by one transaction.
  template <class Call, class OnCalls>
  absl::Status ChangeTogether(const VerbContext& context, CallGroups<Call>* groups, Call* call, const OnCalls& body) {
    groups->Run(call, [&](const std::vector<Call*>& calls) { ChangeAll(context, calls, body); });
    return call->status;
  }

  // All calls by one transaction, or if that fails for another reason than that the database is away, each by its own.
  template <class Call, class OnCalls>
  void ChangeAll(const VerbContext& context, const std::vector<Call*>& all, const OnCalls& body) {
    const auto change = [&](const std::vector<Call*>& calls) {
      return Change(context, Durability::kNow, [&](JobTransaction& transaction) { return body(transaction, calls); });
    };
    const absl::Status status = change(all);
    const bool alone = all.size() == 1 || status.ok() || absl::IsUnavailable(status);
    for (Call* const each : all) each->status = alone ? status : change({each});
  }

  // Of attempts that were not lost: all their jobs end.
  static absl::Status FinishIn(JobTransaction& transaction, const std::vector<FinishCall*>& calls) {
    std::vector<FinishCall*> ordered = calls;
    std::sort(ordered.begin(), ordered.end(),
              [](const FinishCall* a, const FinishCall* b) { return a->lease.work < b->lease.work; });
    std::vector<Lease> leases;
    for (const FinishCall* const call : ordered) leases.push_back(call->lease);
    PLANISH_ASSIGN_OR_RETURN(std::vector<std::optional<LockedWork>> works, transaction.EndWorks(leases));
    for (std::size_t i = 0; i < ordered.size(); ++i) {
      FinishCall& call = *ordered[i];
      call.changes.clear();
      call.is_lost = !works[i].has_value();
      if (call.is_lost) continue;
      transaction.PutBlobs(call.outcome.blobs);
      const auto end = [&call](JobTransaction& changing, const LockedWork&, JobChange* change) -> absl::Status {
        PLANISH_RETURN_IF_ERROR(AddProgress(&changing, call.outcome.progress, change));
        return Deliver(&changing, call.outcome, change);
      };
      PLANISH_RETURN_IF_ERROR(ForJobs(&transaction, &*works[i], end, &call.changes));
    }
    return absl::OkStatus();
  }

  // All jobs of all `works`, in one transaction; those that the body leaves without an event are not among the changes.
  absl::StatusOr<std::vector<JobChange>> ForWorks(const VerbContext& context,
                                                  const std::function<absl::StatusOr<SqlRows>(JobTransaction&)>& works,
                                                  const OnJob& body) {
    std::vector<JobChange> changes;
    {
      // Mostly there is nothing to do, which takes no transaction.
      PLANISH_ASSIGN_OR_RETURN(const SqlDatabase::Lease connection, database_->Connect(SqlDatabase::Use::kRead));
      JobTransaction look(connection.get(), &context, &clock_);
      PLANISH_ASSIGN_OR_RETURN(const SqlRows names, works(look));
      if (names.empty()) return changes;
    }
    const absl::Status status = Change(context, Durability::kNow, [&](JobTransaction& transaction) -> absl::Status {
      changes.clear();
      PLANISH_ASSIGN_OR_RETURN(const SqlRows rows, works(transaction));
      // In one order everywhere, so that no two wait for each other.
      std::set<std::string> names;
      for (std::size_t i = 0; i < rows.size(); ++i) names.insert(rows.Bytes(i, 0));
      for (const std::string& name : names) {
        PLANISH_ASSIGN_OR_RETURN(std::optional<LockedWork> work, transaction.LockWork(name));
        if (work.has_value()) PLANISH_RETURN_IF_ERROR(ForJobs(&transaction, &*work, body, &changes));
      }
      return absl::OkStatus();
    });
    PLANISH_RETURN_IF_ERROR(status);
    return changes;
  }

  static absl::Status ForJobs(JobTransaction* transaction, LockedWork* work, const OnJob& body,
                              std::vector<JobChange>* changes) {
    for (JobRow& row : work->jobs) {
      JobChange change = {std::move(row.record), {}};
      PLANISH_RETURN_IF_ERROR(body(*transaction, *work, &change));
      if (change.events.empty() && IsEndWanted(change.record) == row.standing.end_wanted) continue;
      PLANISH_RETURN_IF_ERROR(Write(transaction, &row, &change));
      changes->push_back(std::move(change));
    }
    return transaction->Settle(work);
  }

  absl::StatusOr<std::int64_t> LeaseUntil(JobTransaction* transaction, absl::Duration lease) const {
    if (lease == absl::InfiniteDuration()) return std::numeric_limits<std::int64_t>::max();
    PLANISH_ASSIGN_OR_RETURN(const std::int64_t now, transaction->Now());
    return now + absl::ToInt64Nanoseconds(lease);
  }

  Listeners<StoreNews> listeners_;
  const std::unique_ptr<SqlDatabase> database_;
  StoreClock clock_;  // constant after the constructor
  JobQuestions questions_;
  RecentAccounts recent_accounts_;
  CallGroups<AcceptCall> accepts_{kAccepting, kGroupedCalls};
  CallGroups<FinishCall> finishes_{kFinishing, kGroupedCalls};
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
