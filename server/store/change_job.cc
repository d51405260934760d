// JobStore's verbs for callers, except Accept().
#include <algorithm>
#include <string>
#include <vector>

#include "absl/time/time.h"
#include "core/base/status_macros.h"
#include "server/store/job_store_parts.h"
#include "server/store/job_transaction.h"

namespace planish {

absl::StatusOr<JobChange> JobStore::EndEarly(const VerbContext& context, const std::string& name, EarlyEnd why,
                                             bool forget) {
  return parts_->transactions.ChangeJob(context, name,
                                        [&](JobTransaction& transaction, const LockedWork& work, JobChange* change) {
                                          return transaction.EndEarly(work, why, forget, change);
                                        });
}

absl::StatusOr<JobChange> JobStore::RequestStop(const VerbContext& context, const std::string& name) {
  return parts_->transactions.ChangeJob(
      context, name,
      [](JobTransaction& transaction, const LockedWork&, JobChange* change) { return transaction.Stop(change); });
}

absl::StatusOr<JobChange> JobStore::Fail(const VerbContext& context, const std::string& name,
                                         const google::rpc::Status& error, bool forget) {
  return parts_->transactions.ChangeJob(context, name,
                                        [&](JobTransaction& transaction, const LockedWork&, JobChange* change) {
                                          if (forget) change->record.clear_request_id();
                                          return transaction.Fail(error, change);
                                        });
}

absl::StatusOr<JobChange> JobStore::Detach(const std::string& name) {
  return parts_->transactions.ChangeJob({}, name, [](JobTransaction&, const LockedWork&, JobChange* change) {
    change->record.set_attached(false);
    return absl::OkStatus();
  });
}

absl::Status JobStore::KeepCallers(const std::vector<std::string>& names, absl::Duration time) {
  std::vector<std::string> ordered = names;
  std::sort(ordered.begin(), ordered.end());
  return parts_->transactions.Change({}, Durability::kLater, [&](JobTransaction& transaction) -> absl::Status {
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

}  // namespace planish
