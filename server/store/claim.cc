// JobStore::Claim: whose turn it is (fair_share.h), and what fits.
#include <algorithm>
#include <cmath>
#include <functional>
#include <limits>
#include <optional>
#include <set>
#include <string>
#include <string_view>
#include <utility>
#include <vector>

#include "absl/strings/str_cat.h"
#include "core/base/status_macros.h"
#include "server/store/job_verbs.h"

namespace planish {
namespace {

// One Claim().
class Claimer {
 public:
  Claimer(JobTransaction* transaction, const ClaimRequest& request, std::vector<ClaimedWork>* claimed)
      : transaction_(*transaction), sql_(transaction->sql()), request_(request), claimed_(*claimed) {}

  absl::Status Run() {
    if (request_.work.empty()) PLANISH_RETURN_IF_ERROR(sql_.TakeTurn(std::hash<std::string>()(request_.owner)));
    SqlRows accounts;
    PLANISH_RETURN_IF_ERROR(transaction_.AskLeaseNow());
    PLANISH_RETURN_IF_ERROR(sql_.RunLater(AccountsSql(), {}, &accounts));
    PLANISH_RETURN_IF_ERROR(ReadUsage());
    PLANISH_ASSIGN_OR_RETURN(now_, transaction_.LeaseNow());
    accounts_ = AccountsOf(accounts);
    if (!request_.work.empty()) {
      PLANISH_ASSIGN_OR_RETURN(std::optional<LockedWork> work, transaction_.LockWork(request_.work, /*wait=*/false));
      return work.has_value() && !work->row.running ? Take(*std::move(work)) : absl::OkStatus();
    }
    while (static_cast<int>(claimed_.size()) < request_.most && !runs_alone_) {
      PLANISH_ASSIGN_OR_RETURN(std::optional<WorkRow> next, Next());
      if (!next.has_value() || !Fits(*next)) break;
      PLANISH_ASSIGN_OR_RETURN(LockedWork work, transaction_.LoadJobs(*std::move(next)));
      ++running_;
      memory_ += work.row.memory_bytes;
      runs_alone_ = work.row.alone;
      PLANISH_RETURN_IF_ERROR(Take(std::move(work)));
    }
    return absl::OkStatus();
  }

 private:
  TenantLimits LimitsOf(const std::string& tenant) const {
    return request_.tenant_limits == nullptr ? TenantLimits() : request_.tenant_limits(tenant);
  }

  // What the owner has already.
  absl::Status ReadUsage() {
    PLANISH_ASSIGN_OR_RETURN(
        const SqlRows rows,
        sql_.Run("SELECT count(*), coalesce(max(alone), 0), CAST(coalesce(sum(memory_bytes), 0) AS BIGINT) "
                 "FROM works WHERE running = 1 AND owner = ?",
                 {std::string_view(request_.owner)}));
    running_ = rows.Int(0, 0);
    runs_alone_ = rows.Int(0, 1) != 0;
    memory_ = rows.Int(0, 2);
    return absl::OkStatus();
  }

  bool Fits(const WorkRow& work) const {
    if (running_ == 0) return true;
    return !work.alone && (request_.memory_bytes <= 0 || memory_ + work.memory_bytes <= request_.memory_bytes);
  }

  // Locked; empty: none waits that this owner may have. Between tenants that are equal, the oldest goes first.
  absl::StatusOr<std::optional<WorkRow>> Next() {
    while (true) {
      PLANISH_ASSIGN_OR_RETURN(const std::optional<std::string> tenant, NextTenant());
      if (!tenant.has_value()) return std::nullopt;
      PLANISH_ASSIGN_OR_RETURN(const bool may_run, MayRun(*tenant));
      if (may_run) {
        static const std::string sql = absl::StrCat(HeadSql(), " {skip}");
        PLANISH_ASSIGN_OR_RETURN(std::optional<WorkRow> head, Head(sql, *tenant));
        if (head.has_value()) return head;
      }
      passed_by_.insert(*tenant);  // others are about to take what it has
    }
  }

  absl::StatusOr<std::optional<std::string>> NextTenant() {
    std::int64_t least = std::numeric_limits<std::int64_t>::max();
    std::vector<std::string> equal;
    for (const auto& [tenant, account] : accounts_.tenants) {
      const TenantLimits limits = LimitsOf(tenant);
      if (account.waiting <= 0 || passed_by_.contains(tenant) || !MayRunMore(limits, account.running)) continue;
      const std::int64_t start = StartOf(account, ShareOf(limits), Now());
      if (start > least) continue;
      if (start < least) equal.clear();
      least = start;
      equal.push_back(tenant);
    }
    if (equal.empty()) return std::nullopt;
    std::string first = equal.front();
    std::optional<WorkRow> oldest;
    for (std::size_t i = 0; equal.size() > 1 && i < equal.size(); ++i) {
      static const std::string sql = HeadSql();
      PLANISH_ASSIGN_OR_RETURN(std::optional<WorkRow> head, Head(sql, equal[i]));
      if (!head.has_value()) continue;
      const bool is_older = !oldest.has_value() || head->turn_time < oldest->turn_time ||
                            (head->turn_time == oldest->turn_time && head->number < oldest->number);
      if (!is_older) continue;
      oldest = std::move(head);
      first = equal[i];
    }
    return first;
  }

  static std::string HeadSql() {
    return absl::StrCat("SELECT ", kWorkColumns,
                        " FROM works WHERE tenant = ? AND running = 0 AND memory_bytes <= ? "
                        "ORDER BY turn_time, number LIMIT 1");
  }

  absl::StatusOr<std::optional<WorkRow>> Head(const std::string& sql, const std::string& tenant) {
    const std::int64_t most =
        request_.memory_bytes > 0 ? request_.memory_bytes : std::numeric_limits<std::int64_t>::max();
    PLANISH_ASSIGN_OR_RETURN(const SqlRows rows, sql_.Run(sql, {std::string_view(tenant), most}));
    if (rows.empty()) return std::nullopt;
    return std::move(WorkRowsOf(rows).front());
  }

  // Whoever counts against a limit is the only one that does so, to the end of the transaction.
  absl::StatusOr<bool> MayRun(const std::string& tenant) {
    const TenantLimits limits = LimitsOf(tenant);
    if (limits.running < 0) return true;
    if (!counted_.contains(tenant)) {
      PLANISH_ASSIGN_OR_RETURN(const bool is_alone,
                               sql_.Serialize(absl::StrCat("running of ", tenant), /*wait=*/false));
      if (!is_alone) return false;
      PLANISH_ASSIGN_OR_RETURN(
          const SqlRows rows, sql_.Run("SELECT CAST(coalesce(sum(running), 0) AS BIGINT) FROM tenants WHERE tenant = ?",
                                       {std::string_view(tenant)}));
      accounts_.tenants[tenant].running = rows.Int(0, 0);
      counted_.insert(tenant);
    }
    return MayRunMore(limits, accounts_.tenants[tenant].running);
  }

  // Starts all jobs of work that is locked and waits.
  absl::Status Take(LockedWork work) {
    const std::string tenant = work.row.tenant;
    const TenantLimits limits = LimitsOf(tenant);
    const double share = ShareOf(limits);
    WorkRow& row = work.row;
    ++row.attempt;
    row.owner = request_.owner;
    row.lease_until = request_.lease == absl::InfiniteDuration() ? std::numeric_limits<std::int64_t>::max()
                                                                 : now_ + absl::ToInt64Nanoseconds(request_.lease);
    row.start_time = now_;
    row.share = std::llround(share * 1e6);
    row.charge = ChargeFor(absl::Nanoseconds(row.run_time) * request_.seconds_factor, share);
    ClaimedWork taken;
    taken.lease = {row.name, row.attempt, row.owner};
    taken.run_time = absl::Nanoseconds(row.run_time);
    taken.memory_bytes = row.memory_bytes;
    for (JobRow& job : work.jobs) {
      JobChange change = {std::move(job.record), {}};
      PLANISH_RETURN_IF_ERROR(transaction_.Start(taken.lease, &change));
      PLANISH_RETURN_IF_ERROR(transaction_.Save(&job, &change.record));
      PLANISH_RETURN_IF_ERROR(transaction_.WriteEvents(&change));
      taken.jobs.push_back(std::move(change));
    }
    PLANISH_RETURN_IF_ERROR(transaction_.Settle(&work));
    taken.wish = row.wish;

    // As it is from now on for this transaction, too.
    TenantAccount& account = accounts_.tenants[tenant];
    // Until one of its attempts ended its own limit may have kept it back.
    const bool was_held_back = limits.running >= 0 && account.running + 1 >= limits.running;
    const std::int64_t lift = was_held_back ? LiftOf(accounts_, tenant, share, Now()) : 0;
    account.received += lift;
    transaction_.accounts().of(tenant).received += lift;
    accounts_.virtual_time = std::max(accounts_.virtual_time, ReceivedBy(account, share, Now()));
    transaction_.accounts().RaiseVirtualTime(accounts_.virtual_time);
    account.waiting -= 1;
    account.running += 1;
    account.started += row.start_time / 1'000'000;
    account.charged += row.charge;
    claimed_.push_back(std::move(taken));
    return absl::OkStatus();
  }

  absl::Time Now() const { return absl::FromUnixNanos(now_); }

  JobTransaction& transaction_;
  SqlConnection& sql_;
  const ClaimRequest& request_;
  std::vector<ClaimedWork>& claimed_;

  std::int64_t now_ = 0;
  FairAccounts accounts_;
  std::set<std::string> passed_by_, counted_;  // tenants
  // Of this owner.
  std::int64_t running_ = 0;
  std::int64_t memory_ = 0;
  bool runs_alone_ = false;
};

}  // namespace

absl::Status ClaimIn(JobTransaction* transaction, const ClaimRequest& request, std::vector<ClaimedWork>* claimed) {
  return Claimer(transaction, request, claimed).Run();
}

}  // namespace planish
