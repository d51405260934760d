// The transactions that JobStore's verbs are.
#pragma once

#include <functional>
#include <string>
#include <vector>

#include "absl/status/status.h"
#include "absl/status/statusor.h"
#include "server/store/call_groups.h"
#include "server/store/job_store.h"
#include "server/store/job_transaction.h"
#include "server/store/sql.h"
#include "server/store/store_news.h"

namespace planish {

// What a verb does to one job of locked work.
using OnJob = std::function<absl::Status(JobTransaction&, const LockedWork&, JobChange*)>;

// Thread-safe. Whoever subscribed, in any process, hears of each transaction once it is committed.
class JobTransactions {
 public:
  // All outlive the object.
  JobTransactions(SqlDatabase* database, const StoreClock* clock, const Listeners<StoreNews>* listeners)
      : database_(*database), clock_(*clock), listeners_(*listeners) {}

  // Runs `body` in a transaction.
  absl::Status Change(const VerbContext& context, Durability durability,
                      const std::function<absl::Status(JobTransaction&)>& body);

  // One job that has not ended, whose work is locked. No effect on one that has.
  absl::StatusOr<JobChange> ChangeJob(const VerbContext& context, const std::string& name, const OnJob& body);

  // All jobs of the work that is held by the lease. ABORTED with LEASE_LOST.
  absl::StatusOr<std::vector<JobChange>> ChangeWork(const VerbContext& context, const Lease& lease,
                                                    Durability durability, const OnJob& body);

  // All jobs of all works whose names `works` selects, in one transaction; jobs that `body` leaves without an event are
  // not among the changes.
  absl::StatusOr<std::vector<JobChange>> ForWorks(const VerbContext& context,
                                                  const std::function<absl::StatusOr<SqlRows>(JobTransaction&)>& works,
                                                  const OnJob& body);

  // All calls by one transaction, or if that fails for another reason than that the database is away, each by its own.
  // Sets Call::status.
  template <class Call, class OnCalls>
  void ChangeAll(const VerbContext& context, const std::vector<Call*>& all, const OnCalls& body) {
    const auto change = [&](const std::vector<Call*>& calls) {
      return Change(context, Durability::kNow, [&](JobTransaction& transaction) { return body(transaction, calls); });
    };
    const absl::Status status = change(all);
    const bool is_answer = all.size() == 1 || status.ok() || absl::IsUnavailable(status);
    for (Call* const each : all) each->status = is_answer ? status : change({each});
  }

  // Calls that come while others are under way share a transaction.
  template <class Call, class OnCalls>
  absl::Status ChangeTogether(const VerbContext& context, CallGroups<Call>* groups, Call* call, const OnCalls& body) {
    groups->Run(call, [&](const std::vector<Call*>& calls) { ChangeAll(context, calls, body); });
    return call->status;
  }

 private:
  void Tell(StoreNews news);

  SqlDatabase& database_;
  const StoreClock& clock_;
  const Listeners<StoreNews>& listeners_;
};

// Runs `body` for each job of the work, writes what changed, and settles the work.
absl::Status ChangeJobs(JobTransaction* transaction, LockedWork* work, const OnJob& body,
                        std::vector<JobChange>* changes);

}  // namespace planish
