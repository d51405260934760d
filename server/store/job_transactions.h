// Runs JobStore's verbs as transactions.
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

// Thread-safe. Notifies the subscribers of all processes of each committed transaction.
class JobTransactions {
 public:
  // The arguments outlive the object.
  JobTransactions(SqlDatabase* database, const StoreClock* clock, const Listeners<StoreNews>* listeners)
      : database_(*database), clock_(*clock), listeners_(*listeners) {}

  // Runs `body` in a transaction.
  absl::Status Change(const VerbContext& context, Durability durability,
                      const std::function<absl::Status(JobTransaction&)>& body);

  // Changes one unfinished job, whose work is locked. No effect on a job that has ended.
  absl::StatusOr<JobChange> ChangeJob(const VerbContext& context, const std::string& name, const OnJob& body);

  // Changes all jobs of the leased work. ABORTED with LEASE_LOST.
  absl::StatusOr<std::vector<JobChange>> ChangeWork(const VerbContext& context, const Lease& lease,
                                                    Durability durability, const OnJob& body);

  // Changes all jobs of all works whose names `works` selects, in one transaction. Returns only jobs for which `body`
  // adds an event.
  absl::StatusOr<std::vector<JobChange>> ForWorks(const VerbContext& context,
                                                  const std::function<absl::StatusOr<SqlRows>(JobTransaction&)>& works,
                                                  const OnJob& body);

  // Runs all calls in one transaction or, if that fails while the database is available, each call in its own. Sets
  // Call::status.
  template <class Call, class OnCalls>
  void ChangeAll(const VerbContext& context, const std::vector<Call*>& all, const OnCalls& body) {
    const auto change = [&](const std::vector<Call*>& calls) {
      return Change(context, Durability::kNow, [&](JobTransaction& transaction) { return body(transaction, calls); });
    };
    const absl::Status status = change(all);
    const bool is_answer = all.size() == 1 || status.ok() || absl::IsUnavailable(status);
    for (Call* const each : all) each->status = is_answer ? status : change({each});
  }

  // Runs the call in a transaction that concurrent calls of the same `groups` share. Returns the status of the call.
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

// Runs `body` for each job of the work, writes the changes, and settles the work.
absl::Status ChangeJobs(JobTransaction* transaction, LockedWork* work, const OnJob& body,
                        std::vector<JobChange>* changes);

}  // namespace planish
