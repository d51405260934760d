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

absl::StatusOr<std::optional<JobRecord>> Known(SqlConnection* sql, const JobRecord& record) {
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

// The newest work with this key; empty if there is none to join.
absl::StatusOr<std::optional<LockedWork>> WorkToJoin(JobTransaction* transaction, const JobRecord& record) {
  PLANISH_ASSIGN_OR_RETURN(
      const SqlRows works,
      transaction->sql().Run(
          "SELECT work FROM jobs WHERE work_key = ? AND tenant = ? AND ended = 0 ORDER BY number DESC LIMIT 1",
          {SqlBytes{record.work_key()}, std::string_view(record.job().tenant())}));
  if (works.empty()) return std::nullopt;
  PLANISH_ASSIGN_OR_RETURN(std::optional<LockedWork> work, transaction->LockWork(works.Bytes(0, 0)));
  if (work.has_value() && !MayJoin(work->jobs)) work.reset();
  return work;
}

}  // namespace

absl::Status AcceptIn(JobTransaction* transaction, const NewJob& job, AcceptedChange* accepted) {
  SqlConnection& sql = transaction->sql();
  const v1::Job& asked = job.record.job();
  JobChange& change = accepted->change;
  change.record = job.record;
  change.record.set_work(asked.name());
  if (!asked.has_create_time()) {
    *change.record.mutable_job()->mutable_create_time() = ToTimestamp(transaction->context().now);
  }
  JobRow row;
  std::optional<JobRecord> result;
  std::optional<LockedWork> others;
  SqlRows account_rows;
  PLANISH_RETURN_IF_ERROR(transaction->AskLeaseNow());
  if (!asked.scheduling().fresh()) {
    // Of two that come at the same time the second one finds the first.
    PLANISH_RETURN_IF_ERROR(sql.Serialize(job.record.work_key(), /*wait=*/true).status());
    PLANISH_ASSIGN_OR_RETURN(result, Result(transaction, job));
    if (!result.has_value()) {
      PLANISH_RETURN_IF_ERROR(sql.RunLater(AccountsSql(), {}, &account_rows));
      PLANISH_ASSIGN_OR_RETURN(others, WorkToJoin(transaction, job.record));
    }
  }
  accepted->shares = result.has_value() || others.has_value();
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
  std::optional<FairAccounts> accounts;
  if (!accepted->shares && asked.scheduling().fresh()) {
    PLANISH_ASSIGN_OR_RETURN(accounts, ReadAccounts(&sql));
  } else if (!accepted->shares) {
    accounts = AccountsOf(account_rows);
  }
  if (accounts.has_value() && job.limits.has_value()) {
    const Room room = RoomFor(*accounts, *job.limits, asked.tenant(), asked.mesh_bytes());
    if (room != Room::kYes) {
      // A job that is there needs none.
      PLANISH_ASSIGN_OR_RETURN(std::optional<JobRecord> known, Known(&sql, job.record));
      *accepted = known.has_value() ? AcceptedChange{false, false, Room::kYes, {*std::move(known), {}}}
                                    : AcceptedChange{false, false, room, {}};
      return absl::OkStatus();
    }
  }
  row.record = std::move(change.record);
  PLANISH_ASSIGN_OR_RETURN(accepted->created, transaction->Insert(&row));
  if (accepted->created) {
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
  // Its name or its request id is taken.
  PLANISH_ASSIGN_OR_RETURN(std::optional<JobRecord> known, Known(&sql, job.record));
  if (!known.has_value()) return StoreUnavailable("two jobs came at the same time; try again");
  *accepted = {false, false, Room::kYes, {*std::move(known), {}}};
  return absl::OkStatus();
}

}  // namespace planish
