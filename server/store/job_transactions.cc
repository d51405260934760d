#include "server/store/job_transactions.h"

#include <optional>
#include <set>
#include <string>
#include <utility>
#include <vector>

#include "core/base/status_macros.h"

namespace planish {
namespace {

// Writes the changes of an existing job.
absl::Status WriteChange(JobTransaction* transaction, JobRow* row, JobChange* change) {
  transaction->Save(row, &change->record);
  return transaction->WriteEvents(change);
}

}  // namespace

absl::Status JobTransactions::Change(const VerbContext& context, Durability durability,
                                     const std::function<absl::Status(JobTransaction&)>& body) {
  StoreNews news;
  const absl::Status status = Transact(&database_, durability, [&](SqlConnection& sql) -> absl::Status {
    JobTransaction transaction(&sql, &context, &clock_);
    PLANISH_RETURN_IF_ERROR(body(transaction));
    PLANISH_RETURN_IF_ERROR(transaction.Flush());
    news = std::move(transaction.news());
    return absl::OkStatus();
  });
  // After an error the transaction may still have been committed; listeners poll every few seconds anyway.
  if (status.ok()) Tell(std::move(news));
  return status;
}

void JobTransactions::Tell(StoreNews news) {
  if (!news.work && news.jobs.empty() && news.works.empty()) return;
  news.local = true;
  listeners_.Call(news);
  database_.Publish(EncodeNews(news));
}

absl::StatusOr<JobChange> JobTransactions::ChangeJob(const VerbContext& context, const std::string& name,
                                                     const OnJob& body) {
  JobChange change;
  const absl::Status status = Change(context, Durability::kNow, [&](JobTransaction& transaction) -> absl::Status {
    PLANISH_ASSIGN_OR_RETURN(JobTransaction::Locked locked, transaction.LockJob(name));
    change = {std::move(locked.row().record), {}};
    if (!locked.place.has_value()) return absl::OkStatus();
    PLANISH_RETURN_IF_ERROR(body(transaction, locked.work, &change));
    PLANISH_RETURN_IF_ERROR(WriteChange(&transaction, &locked.row(), &change));
    return transaction.Settle(&locked.work);
  });
  PLANISH_RETURN_IF_ERROR(status);
  return change;
}

absl::StatusOr<std::vector<JobChange>> JobTransactions::ChangeWork(const VerbContext& context, const Lease& lease,
                                                                   Durability durability, const OnJob& body) {
  std::vector<JobChange> changes;
  const absl::Status status = Change(context, durability, [&](JobTransaction& transaction) -> absl::Status {
    changes.clear();
    PLANISH_ASSIGN_OR_RETURN(std::optional<LockedWork> work, transaction.LockWork(lease.work));
    const bool holds =
        work.has_value() && work->row.running && work->row.owner == lease.owner && work->row.attempt == lease.attempt;
    if (!holds) return LeaseLost(lease);
    return ChangeJobs(&transaction, &*work, body, &changes);
  });
  PLANISH_RETURN_IF_ERROR(status);
  return changes;
}

absl::StatusOr<std::vector<JobChange>> JobTransactions::ForWorks(
    const VerbContext& context, const std::function<absl::StatusOr<SqlRows>(JobTransaction&)>& works,
    const OnJob& body) {
  std::vector<JobChange> changes;
  {
    // Usually there is nothing to do; finding that out takes no transaction.
    PLANISH_ASSIGN_OR_RETURN(const SqlDatabase::Lease connection, database_.Connect(SqlDatabase::Use::kRead));
    JobTransaction look(connection.get(), &context, &clock_);
    PLANISH_ASSIGN_OR_RETURN(const SqlRows names, works(look));
    if (names.empty()) return changes;
  }
  const absl::Status status = Change(context, Durability::kNow, [&](JobTransaction& transaction) -> absl::Status {
    changes.clear();
    PLANISH_ASSIGN_OR_RETURN(const SqlRows rows, works(transaction));
    // Locks work in the same order everywhere, which prevents deadlocks.
    std::set<std::string> names;
    for (std::size_t i = 0; i < rows.size(); ++i) names.insert(rows.Bytes(i, 0));
    for (const std::string& name : names) {
      PLANISH_ASSIGN_OR_RETURN(std::optional<LockedWork> work, transaction.LockWork(name));
      if (work.has_value()) PLANISH_RETURN_IF_ERROR(ChangeJobs(&transaction, &*work, body, &changes));
    }
    return absl::OkStatus();
  });
  PLANISH_RETURN_IF_ERROR(status);
  return changes;
}

absl::Status ChangeJobs(JobTransaction* transaction, LockedWork* work, const OnJob& body,
                        std::vector<JobChange>* changes) {
  for (JobRow& row : work->jobs) {
    JobChange change = {std::move(row.record), {}};
    PLANISH_RETURN_IF_ERROR(body(*transaction, *work, &change));
    if (change.events.empty() && IsEndWanted(change.record) == row.standing.end_wanted) continue;
    PLANISH_RETURN_IF_ERROR(WriteChange(transaction, &row, &change));
    changes->push_back(std::move(change));
  }
  return transaction->Settle(work);
}

}  // namespace planish
