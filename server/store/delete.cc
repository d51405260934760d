// JobStore::Expire, Delete and DeleteOldest.
#include <cstdint>
#include <string>
#include <string_view>
#include <utility>
#include <vector>

#include "absl/strings/str_cat.h"
#include "absl/time/time.h"
#include "core/base/error.h"
#include "core/base/status_macros.h"
#include "server/store/job_store_parts.h"
#include "server/store/job_transaction.h"
#include "server/store/lifecycle.h"

namespace planish {

absl::StatusOr<JobChange> JobStore::Expire(const VerbContext& context, const std::string& name) {
  JobChange change;
  const absl::Status status =
      parts_->transactions.Change(context, Durability::kLater, [&](JobTransaction& transaction) -> absl::Status {
        PLANISH_RETURN_IF_ERROR(
            transaction.sql().Run("SELECT 1 FROM jobs WHERE name = ? {lock}", {std::string_view(name)}).status());
        PLANISH_ASSIGN_OR_RETURN(JobRow row, transaction.Find(name));
        change = {std::move(row.record), {}};
        PLANISH_ASSIGN_OR_RETURN(const std::int64_t now, transaction.Now());
        const absl::Time time = absl::FromUnixNanos(now);
        if (!Advance(JobAction::kExpire, time, change.record.mutable_job()).ok()) return absl::OkStatus();
        change.record.clear_request_id();  // a repeated request must compute UV again
        transaction.Save(&row, &change.record);
        return absl::OkStatus();
      });
  PLANISH_RETURN_IF_ERROR(status);
  return change;
}

absl::Status JobStore::Delete(const std::string& name) {
  return parts_->transactions.Change({}, Durability::kLater, [&](JobTransaction& transaction) -> absl::Status {
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

absl::StatusOr<std::vector<JobRecord>> JobStore::DeleteOldest(const std::string& tenant, int most) {
  std::vector<JobRecord> gone;
  const absl::Status status =
      parts_->transactions.Change({}, Durability::kLater, [&](JobTransaction& transaction) -> absl::Status {
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

}  // namespace planish
