// JobStore::Reap and EndOverdue: lost work, and jobs past their time limits.
#include <cstdint>
#include <string>
#include <vector>

#include "core/base/status_macros.h"
#include "server/store/endings.h"
#include "server/store/job_store_parts.h"
#include "server/store/job_transaction.h"

namespace planish {

absl::StatusOr<std::vector<JobChange>> JobStore::Reap(const VerbContext& context, const std::string& sole_owner,
                                                      int most) {
  std::int64_t now = 0;
  const auto is_over = [&](const WorkRow& work) {
    if (!work.running) return false;
    return sole_owner.empty() ? work.lease_until <= now : work.owner != sole_owner;
  };
  // The order makes PostgreSQL use the index of running work; without an order it may scan all waiting work.
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
  return parts_->transactions.ForWorks(
      context, works, [&](JobTransaction& transaction, const LockedWork& work, JobChange* change) -> absl::Status {
        JobRecord& record = change->record;
        if (!is_over(work.before) || !IsLeased(record)) return absl::OkStatus();
        if (!sole_owner.empty()) JobTransaction::SkipReserved(&record);
        record.set_crashes(record.crashes() + 1);
        record.set_server_crashes(record.server_crashes() + 1);
        PLANISH_ASSIGN_OR_RETURN(const bool ended, transaction.EndIfWanted(change));
        if (ended) return absl::OkStatus();
        if (record.crashes() >= context.max_attempts) {
          return transaction.Fail(ServerCrashed(record.job().attempts()), change);
        }
        return transaction.Requeue(change);
      });
}

absl::StatusOr<std::vector<JobChange>> JobStore::EndOverdue(const VerbContext& context, int most) {
  const auto works = [&](JobTransaction& transaction) -> absl::StatusOr<SqlRows> {
    PLANISH_ASSIGN_OR_RETURN(const std::int64_t now, transaction.Now());
    return transaction.sql().Run("SELECT work FROM jobs WHERE ended = 0 AND due <= ? ORDER BY due LIMIT ?",
                                 {now, most});
  };
  return parts_->transactions.ForWorks(context, works, EndIfOverdue);
}

}  // namespace planish
