// JobStore::Accept and AcceptAll.
#include <algorithm>
#include <cstddef>
#include <deque>
#include <map>
#include <optional>
#include <set>
#include <string>
#include <string_view>
#include <tuple>
#include <utility>
#include <vector>

#include "absl/strings/str_cat.h"
#include "core/base/status_macros.h"
#include "server/store/job_store_parts.h"
#include "server/store/job_transaction.h"
#include "server/store/work_rows.h"

namespace planish {

// A call of JobStore::Accept.
struct AcceptCall {
  NewJob job;
  std::vector<std::string> keys;  // KeysOf(job)
  absl::Status status;
  AcceptedChange accepted;
};

namespace {

// Whether a new job may still join work with these jobs.
bool MayJoin(const std::vector<JobRow>& jobs) {
  return std::any_of(jobs.begin(), jobs.end(), [](const JobRow& row) {
    const bool stops = row.standing.leased && row.standing.stop_requested;
    return !stops && !row.standing.end_wanted;
  });
}

absl::StatusOr<std::optional<JobRecord>> Result(JobTransaction* transaction, const NewJob& job) {
  PLANISH_RETURN_IF_ERROR(
      transaction->sql().Run("SELECT 1 FROM jobs WHERE name = ? {lock}", {std::string_view(job.result_of)}).status());
  absl::StatusOr<JobRow> source = transaction->Find(job.result_of);
  if (absl::IsNotFound(source.status())) return std::nullopt;
  PLANISH_RETURN_IF_ERROR(source.status());
  const bool is_kept = source->record.job().state() == v1::JOB_STATE_SUCCEEDED;
  if (!is_kept || source->record.work_key() != job.record.work_key()) return std::nullopt;
  return std::move(source->record);
}

// Whether the job would have room even with twice the waiting work of these accounts.
bool HasAmpleRoom(FairAccounts accounts, const NewJob& job) {
  if (!job.limits.has_value()) return true;
  for (auto& [tenant, account] : accounts.tenants) {
    account.waiting *= 2;
    account.waiting_bytes *= 2;
  }
  const v1::Job& asked = job.record.job();
  return RoomFor(accounts, *job.limits, asked.tenant(), asked.mesh_bytes()) == Room::kYes;
}

// Reads the accounts that decide whether jobs have room, and at which virtual time their tenants begin (fair_share.h).
// They are read together with the next query. While a long queue has ample room, reads only the accounts of the jobs'
// own tenants, without tenants that have many waiting jobs: the virtual time matters only for a tenant with no waiting
// work.
class AccountsToRead {
 public:
  AccountsToRead(JobTransaction* transaction, RecentAccounts* recent) : sql_(transaction->sql()), recent_(*recent) {}

  absl::Status Ask(const std::vector<AcceptCall*>& calls) {
    known_ = recent_.Get();
    const auto is_tight = [this](const AcceptCall* call) { return !HasAmpleRoom(*known_, call->job); };
    if (known_.has_value() && std::any_of(calls.begin(), calls.end(), is_tight)) known_.reset();
    if (!known_.has_value()) return sql_.RunLater(AccountsSql(), {}, &all_);
    for (const AcceptCall* call : calls) {
      const std::string& tenant = call->job.record.job().tenant();
      if (known_->tenants[tenant].waiting >= kManyWaiting || own_.contains(tenant)) continue;
      PLANISH_RETURN_IF_ERROR(sql_.RunLater(OwnAccountSql(), {std::string_view(tenant)}, &own_[tenant]));
    }
    return absl::OkStatus();
  }

  // The accounts. Call it after the queries have been answered.
  FairAccounts Take() {
    if (!known_.has_value()) {
      known_ = AccountsOf(all_);
      recent_.Put(*known_);
    }
    for (const auto& [tenant, rows] : own_) known_->tenants[tenant] = AccountsOf(rows).tenants[tenant];
    return *std::move(known_);
  }

 private:
  static constexpr std::int64_t kManyWaiting = 200;  // more than are claimed before recent accounts expire

  SqlConnection& sql_;
  RecentAccounts& recent_;
  std::optional<FairAccounts> known_;
  SqlRows all_;
  std::map<std::string, SqlRows> own_;  // by tenant
};

// What the store has for a call: a new job number, the name of a job with the same name or request id, and the newest
// work with the same key; "" if there is none. One query finds this for all calls, in one round trip.
struct Found {
  AcceptCall* call;
  std::int64_t number = 0;
  std::string same, work;
};

RowBatch Questions() {
  return RowBatch::Of(
      "SELECT {next_number}, coalesce((SELECT name FROM jobs WHERE name = column1), "
      "(SELECT name FROM jobs WHERE tenant = column2 AND request_id = column3)), "
      "(SELECT work FROM jobs WHERE column5 = 0 AND work_key = column4 AND tenant = column2 AND ended = 0 "
      "ORDER BY number DESC LIMIT 1), {now}, column6 FROM (VALUES {rows}) AS calls");
}

absl::StatusOr<std::vector<Found>> Ask(JobTransaction* transaction, const std::vector<AcceptCall*>& calls) {
  RowBatch questions = Questions();
  std::int64_t place = 0;
  for (const AcceptCall* call : calls) {
    const JobRecord& record = call->job.record;
    SqlValue request_id;
    if (!record.request_id().empty()) request_id = std::string_view(record.request_id());
    questions.Add({std::string_view(record.job().name()), std::string_view(record.job().tenant()), request_id,
                   SqlBytes{record.work_key()}, std::int64_t{record.job().scheduling().fresh()}, place++});
  }
  std::deque<SqlRows> answers;
  PLANISH_RETURN_IF_ERROR(questions.Send(&transaction->sql(), &answers));
  PLANISH_RETURN_IF_ERROR(transaction->sql().Flush());
  std::vector<Found> found;
  for (const SqlRows& rows : answers) {
    for (std::size_t i = 0; i < rows.size(); ++i) {
      found.push_back({calls[found.size()], rows.Int(i, 0), rows.Bytes(i, 1), rows.Bytes(i, 2)});
      transaction->SetNow(rows.Int(i, 3));
    }
  }
  // All transactions lock work in the same order, which prevents deadlocks.
  std::stable_sort(found.begin(), found.end(), [](const Found& a, const Found& b) {
    return std::tie(a.work, a.call->job.result_of) < std::tie(b.work, b.call->job.result_of);
  });
  return found;
}

absl::Status AcceptOne(JobTransaction* transaction, const Found& found, std::optional<JobRecord> result,
                       FairAccounts* accounts) {
  const NewJob& job = found.call->job;
  const v1::Job& asked = job.record.job();
  AcceptedChange* const accepted = &found.call->accepted;
  JobChange& change = accepted->change;
  change.record = job.record;
  change.record.set_work(asked.name());
  change.record.set_number(found.number);
  PLANISH_ASSIGN_OR_RETURN(const std::int64_t nanoseconds, transaction->Now());
  const absl::Time now = absl::FromUnixNanos(nanoseconds);
  if (!asked.has_create_time()) *change.record.mutable_job()->mutable_create_time() = ToTimestamp(now);
  if (job.record.attached() && job.callers_for > absl::ZeroDuration()) {
    *change.record.mutable_callers_until() = ToTimestamp(now + job.callers_for);
  }
  std::optional<LockedWork> others;
  if (!result.has_value() && !found.work.empty()) {
    PLANISH_ASSIGN_OR_RETURN(others, transaction->LockWork(found.work));
    if (others.has_value() && !MayJoin(others->jobs)) others.reset();
  }
  accepted->shares = result.has_value() || others.has_value();
  if (!accepted->shares && job.limits.has_value()) {
    accepted->room = RoomFor(*accounts, *job.limits, asked.tenant(), asked.mesh_bytes());
    if (accepted->room != Room::kYes) {
      change = {};
      return absl::OkStatus();
    }
  }
  PLANISH_RETURN_IF_ERROR(transaction->Announce(&change));
  if (result.has_value()) {
    const v1::Job& source = result->job();
    v1::Job* own = change.record.mutable_job();
    own->set_result_of(source.result_of().empty() ? source.name() : source.result_of());
    *own->mutable_report() = source.report();
    *own->mutable_uv() = source.uv();
    PLANISH_RETURN_IF_ERROR(transaction->Act(JobAction::kSucceed, &change));
  } else if (others.has_value()) {
    const WorkRow& work = others->row;
    change.record.set_work(work.name);
    change.record.mutable_job()->set_result_of(work.name);
    // The job's first event must name the work too.
    change.events.front().mutable_job()->set_result_of(work.name);
    if (work.running) PLANISH_RETURN_IF_ERROR(transaction->Start({work.name, work.attempt, work.owner}, &change));
  }
  accepted->created = true;
  JobRow row;
  row.record = std::move(change.record);
  transaction->Insert(&row);
  if (!accepted->shares) {
    if (IsIdle(*accounts)) {
      *accounts = {};
      PLANISH_RETURN_IF_ERROR(BeginAnew(&transaction->sql()));
    }
    const double share = job.limits.has_value() ? job.limits->share : 1;
    PLANISH_RETURN_IF_ERROR(transaction->LiftIn(*accounts, asked.tenant(), share));
    transaction->AddWork(row, job.run_time);
    // Later calls in this transaction must count this job.
    TenantAccount& account = accounts->tenants[asked.tenant()];
    account.waiting += 1;
    account.waiting_bytes += asked.mesh_bytes();
  }
  change.record = std::move(row.record);
  if (others.has_value()) {
    others->jobs.push_back(std::move(row));
    PLANISH_RETURN_IF_ERROR(transaction->Settle(&*others));
  }
  transaction->PutBlobs(job.blobs);
  return transaction->WriteEvents(&change);
}

// Removes the next round from *left and returns it: the calls, in order, that share no key with an earlier call. Calls
// of a later round find the jobs that were accepted in earlier rounds.
std::vector<AcceptCall*> TakeRound(std::vector<AcceptCall*>* left) {
  std::vector<AcceptCall*> round, later;
  std::set<std::string_view> taken;
  for (AcceptCall* const call : *left) {
    const bool shares =
        std::any_of(call->keys.begin(), call->keys.end(), [&](const std::string& key) { return taken.contains(key); });
    taken.insert(call->keys.begin(), call->keys.end());
    (shares ? later : round).push_back(call);
  }
  *left = std::move(later);
  return round;
}

absl::Status AcceptRound(JobTransaction* transaction, const std::vector<Found>& all, FairAccounts* accounts) {
  for (const Found& found : all) {
    std::optional<JobRecord> result;
    if (!found.same.empty()) {  // a known job needs no room
      absl::StatusOr<JobRow> known = transaction->Find(found.same);
      if (absl::IsNotFound(known.status()))
        return StoreUnavailable("a job with its request id has just gone; try again");
      PLANISH_RETURN_IF_ERROR(known.status());
      found.call->accepted.change.record = std::move(known->record);
      continue;
    }
    if (!found.call->job.result_of.empty() && !found.call->job.record.job().scheduling().fresh()) {
      PLANISH_ASSIGN_OR_RETURN(result, Result(transaction, found.call->job));
    }
    PLANISH_RETURN_IF_ERROR(AcceptOne(transaction, found, std::move(result), accounts));
  }
  return absl::OkStatus();
}

// The keys of a call: its name, request id and work (unless the job is fresh). Calls with a common key must not run at
// the same time.
std::vector<std::string> KeysOf(const NewJob& job) {
  const v1::Job& asked = job.record.job();
  std::vector<std::string> keys = {asked.name()};
  if (!job.record.request_id().empty()) keys.push_back(absl::StrCat(asked.tenant(), "/", job.record.request_id()));
  if (!asked.scheduling().fresh()) keys.push_back(job.record.work_key());
  return keys;
}

// Accepts several calls. Those that share a key are accepted in their order.
absl::Status AcceptIn(JobTransaction* transaction, const std::vector<AcceptCall*>& calls, RecentAccounts* recent) {
  // Transactions with a common key run one after the other, so that the later one finds the job of the earlier one.
  std::vector<std::string> keys;
  for (AcceptCall* const call : calls) {
    call->accepted = {};
    keys.insert(keys.end(), call->keys.begin(), call->keys.end());
  }
  PLANISH_RETURN_IF_ERROR(transaction->sql().Serialize(keys));
  AccountsToRead read(transaction, recent);
  PLANISH_RETURN_IF_ERROR(read.Ask(calls));
  std::optional<FairAccounts> accounts;
  for (std::vector<AcceptCall*> left = calls; !left.empty();) {
    const std::vector<AcceptCall*> round = TakeRound(&left);
    PLANISH_ASSIGN_OR_RETURN(const std::vector<Found> all, Ask(transaction, round));
    if (!accounts.has_value()) accounts = read.Take();
    PLANISH_RETURN_IF_ERROR(AcceptRound(transaction, all, &*accounts));
    if (!left.empty()) PLANISH_RETURN_IF_ERROR(transaction->FlushRows());
  }
  return absl::OkStatus();
}

}  // namespace

absl::StatusOr<AcceptedChange> JobStore::Accept(const VerbContext& context, NewJob job) {
  std::vector<std::string> keys = KeysOf(job);
  AcceptCall call = {std::move(job), std::move(keys), {}, {}};
  PLANISH_RETURN_IF_ERROR(parts_->transactions.ChangeTogether(
      context, &parts_->accepts, &call, [&](JobTransaction& transaction, const auto& calls) {
        return AcceptIn(&transaction, calls, &parts_->recent_accounts);
      }));
  return std::move(call.accepted);
}

std::vector<absl::StatusOr<AcceptedChange>> JobStore::AcceptAll(const VerbContext& context, std::vector<NewJob> jobs) {
  std::vector<AcceptCall> calls;
  std::vector<AcceptCall*> pointers;
  calls.reserve(jobs.size());
  for (NewJob& job : jobs) {
    std::vector<std::string> keys = KeysOf(job);
    calls.push_back({std::move(job), std::move(keys), {}, {}});
    pointers.push_back(&calls.back());
  }
  parts_->transactions.ChangeAll(context, pointers,
                                 [&](JobTransaction& transaction, const std::vector<AcceptCall*>& together) {
                                   return AcceptIn(&transaction, together, &parts_->recent_accounts);
                                 });
  std::vector<absl::StatusOr<AcceptedChange>> answers;
  for (AcceptCall& call : calls) {
    call.status.ok() ? answers.emplace_back(std::move(call.accepted)) : answers.emplace_back(call.status);
  }
  return answers;
}

}  // namespace planish
