// JobStore::Accept.
#include <algorithm>
#include <optional>
#include <string>
#include <string_view>
#include <utility>
#include <vector>

#include "absl/strings/str_cat.h"
#include "core/base/status_macros.h"
#include "server/store/job_verbs.h"

namespace planish {
namespace {

// Whether a job that comes may still join this work, all of whose jobs are given.
bool MayJoin(const std::vector<JobRow>& jobs) {
  return std::any_of(jobs.begin(), jobs.end(), [](const JobRow& row) {
    const bool stops = row.standing.leased && row.standing.stop_requested;
    return !stops && !row.standing.end_wanted;
  });
}

absl::StatusOr<std::optional<JobRecord>> Result(JobTransaction* transaction, const NewJob& job) {
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

// The next number, and the newest work with the key of the job, "": none.
absl::StatusOr<SqlRows> NumberAndWork(SqlConnection* sql, const JobRecord& record) {
  if (record.job().scheduling().fresh()) return sql->Run("SELECT {next_number}, ''", {});
  return sql->Run(
      "SELECT {next_number}, (SELECT work FROM jobs WHERE work_key = ? AND tenant = ? AND ended = 0 "
      "ORDER BY number DESC LIMIT 1)",
      {SqlBytes{record.work_key()}, std::string_view(record.job().tenant())});
}

// Whether the job had room if twice as much were waiting as these accounts say.
bool HasAmpleRoom(FairAccounts accounts, const NewJob& job) {
  if (!job.limits.has_value()) return true;
  for (auto& [tenant, account] : accounts.tenants) {
    account.waiting *= 2;
    account.waiting_bytes *= 2;
  }
  const v1::Job& asked = job.record.job();
  return RoomFor(accounts, *job.limits, asked.tenant(), asked.mesh_bytes()) == Room::kYes;
}

// The accounts that decide whether a job has room and where its tenant begins. They are read with what is asked next;
// of a long queue with ample room, the tenant's own alone, and not even that if it has many waiting: where it begins
// matters to one that has none.
class AccountsToRead {
 public:
  AccountsToRead(JobTransaction* transaction, RecentAccounts* recent)
      : transaction_(*transaction), sql_(transaction->sql()), recent_(*recent) {}

  absl::Status Ask(const NewJob& job) {
    tenant_ = job.record.job().tenant();
    known_ = recent_.Get();
    if (known_.has_value() && !HasAmpleRoom(*known_, job)) known_.reset();
    reads_own_ = known_.has_value() && known_->tenants[tenant_].waiting < kManyWaiting;
    if (known_.has_value() && !reads_own_) return absl::OkStatus();
    PLANISH_RETURN_IF_ERROR(transaction_.AskLeaseNow());  // for LiftIn()
    return reads_own_ ? sql_.RunLater(OwnAccountSql(), {std::string_view(tenant_)}, &rows_)
                      : sql_.RunLater(AccountsSql(), {}, &rows_);
  }

  // After the answer has come.
  FairAccounts Take() {
    if (!known_.has_value()) {
      FairAccounts read = AccountsOf(rows_);
      recent_.Put(read);
      return read;
    }
    if (reads_own_) known_->tenants[tenant_] = AccountsOf(rows_).tenants[tenant_];
    return *std::move(known_);
  }

 private:
  static constexpr std::int64_t kManyWaiting = 200;  // more than are claimed while accounts are recent

  JobTransaction& transaction_;
  SqlConnection& sql_;
  RecentAccounts& recent_;
  std::string tenant_;
  std::optional<FairAccounts> known_;
  bool reads_own_ = false;
  SqlRows rows_;
};

}  // namespace

absl::Status AcceptIn(JobTransaction* transaction, const NewJob& job, RecentAccounts* recent,
                      AcceptedChange* accepted) {
  *accepted = {};
  SqlConnection& sql = transaction->sql();
  const v1::Job& asked = job.record.job();
  JobChange& change = accepted->change;
  change.record = job.record;
  change.record.set_work(asked.name());
  if (!asked.has_create_time()) {
    *change.record.mutable_job()->mutable_create_time() = ToTimestamp(transaction->context().now);
  }
  std::optional<JobRecord> result;
  std::optional<LockedWork> others;
  AccountsToRead read(transaction, recent);
  if (!asked.scheduling().fresh()) {
    // Of two that come at the same time the second one finds the first.
    PLANISH_RETURN_IF_ERROR(sql.Serialize(job.record.work_key(), /*wait=*/true).status());
    PLANISH_ASSIGN_OR_RETURN(result, Result(transaction, job));
  }
  if (!result.has_value()) PLANISH_RETURN_IF_ERROR(read.Ask(job));
  PLANISH_ASSIGN_OR_RETURN(const SqlRows found, NumberAndWork(&sql, job.record));
  change.record.set_number(found.Int(0, 0));
  if (!result.has_value() && !found.Bytes(0, 1).empty()) {
    PLANISH_ASSIGN_OR_RETURN(others, transaction->LockWork(found.Bytes(0, 1)));
    if (others.has_value() && !MayJoin(others->jobs)) others.reset();
  }
  accepted->shares = result.has_value() || others.has_value();
  std::optional<FairAccounts> accounts;
  if (!accepted->shares) {
    accounts = read.Take();
    if (job.limits.has_value()) {
      accepted->room = RoomFor(*accounts, *job.limits, asked.tenant(), asked.mesh_bytes());
      if (accepted->room != Room::kYes) return absl::OkStatus();
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
    // As its first event says, too.
    change.events.front().mutable_job()->set_result_of(work.name);
    if (work.running) PLANISH_RETURN_IF_ERROR(transaction->Start({work.name, work.attempt, work.owner}, &change));
  }
  accepted->created = true;
  JobRow row;
  row.record = std::move(change.record);
  PLANISH_RETURN_IF_ERROR(transaction->Insert(&row));
  if (accounts.has_value()) {
    if (IsIdle(*accounts)) {
      accounts.emplace();
      PLANISH_RETURN_IF_ERROR(BeginAnew(&sql));
    }
    const double share = job.limits.has_value() ? job.limits->share : 1;
    PLANISH_RETURN_IF_ERROR(transaction->LiftIn(*accounts, asked.tenant(), share));
    PLANISH_RETURN_IF_ERROR(transaction->AddWork(row, job.run_time));
  }
  change.record = std::move(row.record);
  if (others.has_value()) {
    others->jobs.push_back(std::move(row));
    PLANISH_RETURN_IF_ERROR(transaction->Settle(&*others));
  }
  PLANISH_RETURN_IF_ERROR(transaction->PutBlobs(job.blobs));
  return transaction->WriteEvents(&change);
}

}  // namespace planish
