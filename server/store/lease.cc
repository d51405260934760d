// JobStore::Renew, Report and Release: the verbs for an owner that keeps its leases or gives them up.
#include <algorithm>
#include <cstdint>
#include <deque>
#include <limits>
#include <map>
#include <numeric>
#include <string>
#include <utility>
#include <vector>

#include "absl/time/time.h"
#include "core/base/status_macros.h"
#include "server/store/endings.h"
#include "server/store/job_store_parts.h"
#include "server/store/job_transaction.h"

namespace planish {
namespace {

absl::StatusOr<std::int64_t> LeaseUntil(JobTransaction* transaction, absl::Duration lease) {
  if (lease == absl::InfiniteDuration()) return std::numeric_limits<std::int64_t>::max();
  PLANISH_ASSIGN_OR_RETURN(const std::int64_t now, transaction->Now());
  return now + absl::ToInt64Nanoseconds(lease);
}

}  // namespace

absl::StatusOr<std::vector<Wish>> JobStore::Renew(const std::vector<Lease>& leases, absl::Duration lease) {
  std::vector<Wish> wishes(leases.size());
  std::vector<std::size_t> order(leases.size());  // by name of the work, as everywhere, which prevents deadlocks
  std::iota(order.begin(), order.end(), 0);
  std::sort(order.begin(), order.end(), [&](std::size_t a, std::size_t b) { return leases[a].work < leases[b].work; });
  const absl::Status status =
      parts_->transactions.Change({}, Durability::kLater, [&](JobTransaction& transaction) -> absl::Status {
        PLANISH_ASSIGN_OR_RETURN(const std::int64_t until, LeaseUntil(&transaction, lease));
        RowBatch renewals = RowBatch::Of(
            "UPDATE works SET lease_until = v.column4 FROM (VALUES {rows}) AS v WHERE name = v.column1 AND "
            "owner = v.column2 AND attempt = v.column3 AND running != 0 RETURNING name, attempt, wish");
        for (const std::size_t i : order) {
          renewals.Add({std::string_view(leases[i].work), std::string_view(leases[i].owner), leases[i].attempt, until});
        }
        std::deque<SqlRows> answers;
        PLANISH_RETURN_IF_ERROR(renewals.Send(&transaction.sql(), &answers));
        PLANISH_RETURN_IF_ERROR(transaction.sql().Flush());
        std::map<std::pair<std::string, std::int64_t>, Wish> renewed;
        for (const SqlRows& rows : answers) {
          for (std::size_t i = 0; i < rows.size(); ++i) {
            renewed[{rows.Bytes(i, 0), rows.Int(i, 1)}] = static_cast<Wish>(rows.Int(i, 2));
          }
        }
        for (std::size_t i = 0; i < leases.size(); ++i) {
          const auto found = renewed.find({leases[i].work, leases[i].attempt});
          wishes[i] = found == renewed.end() ? Wish::kGiveUp : found->second;
        }
        return absl::OkStatus();
      });
  PLANISH_RETURN_IF_ERROR(status);
  return wishes;
}

absl::StatusOr<std::vector<JobChange>> JobStore::Report(const VerbContext& context, const Lease& lease,
                                                        const std::vector<v1::Progress>& progress) {
  // A loss of power may undo progress events that watchers have seen. So sequence numbers are reserved, durably, and
  // never used twice. With a shared database this is not needed: the servers and their watchers survive the loss, and
  // JobFeed knows which events the watchers have seen.
  const bool may_reserve = !parts_->database->is_shared();
  bool reserves = false;
  const auto report = [&](Durability durability) {
    return parts_->transactions.ChangeWork(
        context, lease, durability,
        [&](JobTransaction& transaction, const LockedWork&, JobChange* change) -> absl::Status {
          const std::int64_t reserved = change->record.reserved_sequence();
          PLANISH_RETURN_IF_ERROR(AddProgress(&transaction, progress, change));
          reserves = may_reserve && change->record.reserved_sequence() != reserved;
          if (reserves && durability == Durability::kLater) return absl::AbortedError("not durable");
          return absl::OkStatus();
        });
  };
  absl::StatusOr<std::vector<JobChange>> changes = report(Durability::kLater);
  return reserves && !changes.ok() ? report(Durability::kNow) : std::move(changes);
}

absl::StatusOr<std::vector<JobChange>> JobStore::Release(const VerbContext& context, const std::string& owner,
                                                         const std::string& work) {
  const auto works = [&](JobTransaction& transaction) {
    return transaction.sql().Run("SELECT name FROM works WHERE running = 1 AND owner = ? AND (? = '' OR name = ?)",
                                 {std::string_view(owner), std::string_view(work), std::string_view(work)});
  };
  return parts_->transactions.ForWorks(
      context, works, [&owner](JobTransaction& transaction, const LockedWork& held, JobChange* change) -> absl::Status {
        if (!held.before.running || held.before.owner != owner) return absl::OkStatus();
        PLANISH_ASSIGN_OR_RETURN(const bool ended, transaction.EndIfWanted(change));
        return ended ? absl::OkStatus() : transaction.Requeue(change);
      });
}

}  // namespace planish
