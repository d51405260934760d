// JobStore::Finish.
#include <algorithm>
#include <optional>
#include <string>
#include <utility>
#include <vector>

#include "core/base/status_macros.h"
#include "server/store/endings.h"
#include "server/store/job_store_parts.h"
#include "server/store/job_transaction.h"

namespace planish {
// A call of JobStore::Finish for an attempt that was not lost.
struct FinishCall {
  const Lease& lease;
  const AttemptOutcome& outcome;
  std::vector<std::string> keys;  // the name of the work
  absl::Status status;
  std::vector<JobChange> changes;
  bool is_lost = false;  // whether the lease was lost
};

namespace {

// Ends all jobs of the works.
absl::Status FinishIn(JobTransaction& transaction, const std::vector<FinishCall*>& calls) {
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
    PLANISH_RETURN_IF_ERROR(ChangeJobs(&transaction, &*works[i], end, &call.changes));
  }
  return absl::OkStatus();
}

}  // namespace

absl::StatusOr<std::vector<JobChange>> JobStore::Finish(const VerbContext& context, const Lease& lease,
                                                        const AttemptOutcome& outcome) {
  if (outcome.loss.has_value() || outcome.memory_bytes > 0) {
    return parts_->transactions.ChangeWork(
        context, lease, Durability::kNow,
        [&](JobTransaction& transaction, const LockedWork&, JobChange* change) -> absl::Status {
          PLANISH_RETURN_IF_ERROR(AddProgress(&transaction, outcome.progress, change));
          return outcome.loss.has_value() ? Lose(&transaction, *outcome.loss, change)
                                          : Enlarge(&transaction, outcome.memory_bytes, change);
        });
  }
  FinishCall call = {lease, outcome, {lease.work}, {}, {}};
  PLANISH_RETURN_IF_ERROR(parts_->transactions.ChangeTogether(context, &parts_->finishes, &call, FinishIn));
  if (call.is_lost) return LeaseLost(lease);
  return std::move(call.changes);
}

}  // namespace planish
