// JobStore::Claim: chooses work by its order (fair_share.h) and by the memory that the owner has free.
#include <algorithm>
#include <atomic>
#include <bit>
#include <cmath>
#include <cstdint>
#include <deque>
#include <functional>
#include <limits>
#include <map>
#include <optional>
#include <set>
#include <string>
#include <string_view>
#include <utility>
#include <vector>

#include "absl/strings/str_cat.h"
#include "core/base/status_macros.h"
#include "server/store/job_store_parts.h"
#include "server/store/job_transaction.h"
#include "server/store/work_rows.h"

namespace planish {
namespace {

// A call of Claim().
class Claimer {
 public:
  Claimer(JobTransaction* transaction, const ClaimRequest& request, std::vector<ClaimedWork>* claimed, ClaimWait* wait)
      : transaction_(*transaction), sql_(transaction->sql()), request_(request), claimed_(*claimed), wait_(*wait) {}

  absl::Status Run() {
    if (request_.work.empty()) {
      // Takes another lane each time. Claims that used the same lane would queue there while other lanes are empty.
      static std::atomic<std::uint64_t> claims = 0;
      PLANISH_RETURN_IF_ERROR(sql_.TakeTurn(std::hash<std::string>()(request_.owner) + claims++));
    }
    PLANISH_RETURN_IF_ERROR(ReadUsageAndAccounts());
    wait_.gave_up = !sql_.HasTurn();
    if (wait_.gave_up) return absl::OkStatus();
    PLANISH_ASSIGN_OR_RETURN(now_, transaction_.Now());
    if (!request_.work.empty()) {
      PLANISH_ASSIGN_OR_RETURN(std::optional<LockedWork> work, transaction_.LockWork(request_.work, /*wait=*/false));
      if (!work.has_value() || work->row.running) return absl::OkStatus();
      Choose(*std::move(work));
    }
    while (request_.work.empty() && static_cast<int>(chosen_.size()) < request_.most && !runs_alone_) {
      PLANISH_ASSIGN_OR_RETURN(std::optional<LockedWork> next, Next());
      if (!next.has_value() || !Fits(next->row)) break;
      ++running_;
      if (IsLong(next->row) && ++long_ >= request_.most_long) PassLongBy();
      memory_ += next->row.memory_bytes;
      runs_alone_ = next->row.alone;
      Choose(*std::move(next));
    }
    for (LockedWork& work : chosen_) PLANISH_RETURN_IF_ERROR(Start(std::move(work)));
    return absl::OkStatus();
  }

 private:
  TenantLimits LimitsOf(const std::string& tenant) const {
    return request_.tenant_limits == nullptr ? TenantLimits() : request_.tenant_limits(tenant);
  }

  bool IsLong(const WorkRow& work) const { return work.run_time > longest_short_; }

  // Drops the fetched long work, since the owner already has its maximum of it. The rows stay locked until the end of
  // the transaction.
  void PassLongBy() {
    for (auto& [tenant, fetched] : fetched_) {
      std::erase_if(fetched.heads, [this](const LockedWork& head) { return IsLong(head.row); });
    }
  }

  // Reads the running work of the owner and the accounts of all tenants.
  absl::Status ReadUsageAndAccounts() {
    if (request_.long_from < absl::InfiniteDuration()) {
      longest_short_ = absl::ToInt64Nanoseconds(request_.long_from / std::max(request_.seconds_factor, 1e-9));
    }
    SqlRows usage;
    PLANISH_RETURN_IF_ERROR(sql_.RunLater(
        "SELECT count(*), coalesce(max(alone), 0), CAST(coalesce(sum(memory_bytes), 0) AS BIGINT), {now}, "
        "{elapsed}, coalesce(sum(CASE WHEN run_time > ? THEN 1 ELSE 0 END), 0) FROM works "
        "WHERE running = 1 AND owner = ?",
        {longest_short_, std::string_view(request_.owner)}, &usage));
    PLANISH_ASSIGN_OR_RETURN(accounts_, ReadAccounts(&sql_));
    transaction_.SetNow(usage.Int(0, 3));
    // So far the transaction has only waited for its turn, so its age is the time that it queued.
    wait_.queued = absl::Nanoseconds(usage.Int(0, 4));
    running_ = usage.Int(0, 0);
    runs_alone_ = usage.Int(0, 1) != 0;
    memory_ = usage.Int(0, 2);
    long_ = usage.Int(0, 5);
    return absl::OkStatus();
  }

  bool Fits(const WorkRow& work) const {
    if (running_ == 0) return true;
    return !work.alone && (request_.memory_bytes <= 0 || memory_ + work.memory_bytes <= request_.memory_bytes);
  }

  // The work to claim next; nullopt if no waiting work is for this owner. Between equal tenants, the oldest work goes
  // first.
  absl::StatusOr<std::optional<LockedWork>> Next() {
    while (true) {
      const std::vector<std::string> order = TenantsInOrder();
      if (order.empty()) return std::nullopt;
      PLANISH_RETURN_IF_ERROR(Fetch(order));
      std::string first;
      for (const std::string& tenant : order) {
        if (TurnOf(tenant) > TurnOf(order.front())) break;
        std::deque<LockedWork>& heads = fetched_[tenant].heads;
        if (heads.empty()) {
          passed_by_.insert(tenant);  // concurrent claims have locked all work of the tenant
        } else if (first.empty() || IsOlder(heads.front().row, fetched_[first].heads.front().row)) {
          first = tenant;
        }
      }
      if (first.empty()) continue;
      PLANISH_ASSIGN_OR_RETURN(const bool may_run, MayRun(fetched_[first].heads.front().row));
      if (!may_run) {
        passed_by_.insert(first);
        continue;
      }
      std::deque<LockedWork>& heads = fetched_[first].heads;
      LockedWork head = std::move(heads.front());
      heads.pop_front();
      return head;
    }
  }

  static bool IsOlder(const WorkRow& one, const WorkRow& other) {
    return std::pair(one.turn_time, one.number) < std::pair(other.turn_time, other.number);
  }

  std::int64_t TurnOf(const std::string& tenant) {
    return StartOf(accounts_.tenants[tenant], ShareOf(LimitsOf(tenant)), Now());
  }

  // Tenants whose work may be next, in the order of fair queueing.
  std::vector<std::string> TenantsInOrder() {
    std::vector<std::pair<std::int64_t, std::string>> order;
    for (const auto& [tenant, account] : accounts_.tenants) {
      if (account.waiting <= 0 || passed_by_.contains(tenant) || !MayRunMore(LimitsOf(tenant), account.running)) {
        continue;
      }
      order.emplace_back(TurnOf(tenant), tenant);
    }
    std::sort(order.begin(), order.end());
    std::vector<std::string> tenants;
    for (auto& [start, tenant] : order) tenants.push_back(std::move(tenant));
    return tenants;
  }

  // Locks the next work of the first tenants in `order` and reads its jobs, in one round trip. Takes as much from each
  // of these tenants: all that are equal to the first one, and enough others for the number of pieces to claim.
  absl::Status Fetch(const std::vector<std::string>& order) {
    const std::int64_t first_turn = TurnOf(order.front());
    const auto lacks = [this](const std::string& tenant) {
      return fetched_[tenant].heads.empty() && !fetched_[tenant].all;
    };
    if (std::none_of(order.begin(), order.end(),
                     [&](const std::string& tenant) { return TurnOf(tenant) == first_turn && lacks(tenant); })) {
      return absl::OkStatus();
    }
    const std::size_t wanted = static_cast<std::size_t>(request_.most) - chosen_.size();
    const std::size_t part = (wanted + order.size() - 1) / order.size();
    const std::int64_t most =
        request_.memory_bytes > 0 ? request_.memory_bytes : std::numeric_limits<std::int64_t>::max();
    RowBatch questions = RowBatch::Select(absl::StrCat(
        "SELECT heads.*, coalesce(jobs.number, 0), jobs.due, jobs.record, jobs.report FROM (SELECT ", kWorkColumns,
        " FROM works WHERE tenant = ? AND running = 0 AND memory_bytes <= ? AND run_time <= ? ORDER BY turn_time, "
        "number "
        "LIMIT ? {skip}) AS heads {with_jobs}"));
    const std::int64_t longest = long_ < request_.most_long ? std::numeric_limits<std::int64_t>::max() : longest_short_;
    std::map<std::string, std::size_t> missing;  // rows that were requested and not found
    for (std::size_t i = 0; i < order.size(); ++i) {
      if (i >= wanted && TurnOf(order[i]) > first_turn) break;
      if (!lacks(order[i])) continue;
      // The query also finds the rows that this transaction has locked before.
      const std::size_t limit = fetched_[order[i]].names.size() + part;
      questions.Add({std::string_view(order[i]), most, longest, static_cast<std::int64_t>(limit)});
      missing[order[i]] = limit;
    }
    std::deque<SqlRows> answers;
    PLANISH_RETURN_IF_ERROR(questions.Send(&sql_, &answers));
    PLANISH_RETURN_IF_ERROR(sql_.Flush());
    for (const SqlRows& rows : answers) {
      std::vector<WorkRow> works = WorkRowsOf(rows);  // each piece of work once for each of its jobs
      std::size_t next = 0;
      for (std::size_t begin = 0; begin < works.size(); begin = next) {
        WorkRow& work = works[begin];
        next = begin + 1;
        while (next < works.size() && works[next].name == work.name) ++next;
        --missing[work.tenant];
        Fetched& fetched = fetched_[work.tenant];
        if (!fetched.names.insert(work.name).second) continue;
        std::vector<JobRow> jobs;
        for (std::size_t i = begin; i < next; ++i) {
          if (rows.Int(i, kWorkColumnCount) == 0) continue;
          PLANISH_ASSIGN_OR_RETURN(JobRow job, JobRowOf(rows, i, kWorkColumnCount));
          jobs.push_back(std::move(job));
        }
        fetched.heads.push_back(transaction_.LockedWorkOf(std::move(work), std::move(jobs)));
      }
    }
    for (const auto& [tenant, count] : missing) fetched_[tenant].all = count > 0;
    return absl::OkStatus();
  }

  // Whether the tenant's own limits let this work run. Takes the tenant's lock until the transaction ends, so that one
  // transaction at a time counts against the limits. False also if another transaction holds the lock.
  absl::StatusOr<bool> MayRun(const WorkRow& work) {
    const std::string& tenant = work.tenant;
    const TenantLimits limits = LimitsOf(tenant);
    if (limits.running < 0 && limits.memory_bytes < 0) return true;
    if (!counted_.contains(tenant)) {
      PLANISH_ASSIGN_OR_RETURN(const bool is_alone, sql_.TrySerialize(absl::StrCat("running of ", tenant)));
      if (!is_alone) return false;
      PLANISH_ASSIGN_OR_RETURN(
          const SqlRows rows, sql_.Run("SELECT CAST(coalesce(sum(running), 0) AS BIGINT) FROM tenants WHERE tenant = ?",
                                       {std::string_view(tenant)}));
      accounts_.tenants[tenant].running = rows.Int(0, 0);
      if (limits.memory_bytes >= 0) {
        PLANISH_ASSIGN_OR_RETURN(
            const SqlRows memory,
            sql_.Run(
                "SELECT CAST(coalesce(sum(memory_bytes), 0) AS BIGINT) FROM works WHERE running = 1 AND tenant = ?",
                {std::string_view(tenant)}));
        reserved_[tenant] = memory.Int(0, 0);
      }
      counted_.insert(tenant);
    }
    // Work that needs more than the limit, which was higher when it was accepted, runs only alone.
    const std::int64_t reserved = reserved_[tenant];
    const bool has_memory =
        limits.memory_bytes < 0 || reserved == 0 || reserved + work.memory_bytes <= limits.memory_bytes;
    return has_memory && MayRunMore(limits, accounts_.tenants[tenant].running);
  }

  // Assigns waiting work to this owner.
  void Choose(LockedWork work) {
    const WorkRow& row = work.row;
    const std::string& tenant = row.tenant;
    const TenantLimits limits = LimitsOf(tenant);
    const double share = ShareOf(limits);
    const std::int64_t charge = ChargeFor(absl::Nanoseconds(row.run_time) * request_.seconds_factor, share);
    TenantAccount& account = accounts_.tenants[tenant];
    // If this work takes the tenant to its own limit, the tenant may have been waiting for one of its attempts to end.
    std::int64_t& reserved = reserved_[tenant];
    reserved += row.memory_bytes;
    const bool was_held_back = (limits.running >= 0 && account.running + 1 >= limits.running) ||
                               (limits.memory_bytes >= 0 && reserved + row.memory_bytes > limits.memory_bytes);
    const std::int64_t lift = was_held_back ? LiftOf(accounts_, tenant, share, Now()) : 0;
    account.received += lift;
    transaction_.accounts().of(tenant).received += lift;
    accounts_.virtual_time = std::max(accounts_.virtual_time, ReceivedBy(account, share, Now()));
    transaction_.accounts().RaiseVirtualTime(accounts_.virtual_time);
    // Later decisions in this transaction must count this work.
    account.waiting -= 1;
    account.running += 1;
    account.started += now_ / 1'000'000;
    account.charged += charge;
    chosen_.push_back(std::move(work));
  }

  // Starts all jobs of chosen work.
  absl::Status Start(LockedWork work) {
    const double share = ShareOf(LimitsOf(work.row.tenant));
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
      transaction_.Save(&job, &change.record);
      PLANISH_RETURN_IF_ERROR(transaction_.WriteEvents(&change));
      taken.jobs.push_back(std::move(change));
    }
    PLANISH_RETURN_IF_ERROR(transaction_.Settle(&work));
    taken.wish = row.wish;
    claimed_.push_back(std::move(taken));
    return absl::OkStatus();
  }

  absl::Time Now() const { return absl::FromUnixNanos(now_); }

  JobTransaction& transaction_;
  SqlConnection& sql_;
  const ClaimRequest& request_;
  std::vector<ClaimedWork>& claimed_;
  ClaimWait& wait_;

  std::int64_t now_ = 0;
  FairAccounts accounts_;  // includes the chosen work
  std::vector<LockedWork> chosen_;
  std::set<std::string> passed_by_, counted_;     // names of tenants
  std::map<std::string, std::int64_t> reserved_;  // reserved memory of the counted tenants
  // Locked work of a tenant.
  struct Fetched {
    std::deque<LockedWork> heads;  // not chosen yet, in order
    std::set<std::string> names;   // of all locked work
    bool all = false;              // whether the tenant has no more waiting work
  };
  std::map<std::string, Fetched> fetched_;
  std::int64_t longest_short_ = std::numeric_limits<std::int64_t>::max();  // nanoseconds
  // The running and chosen work of this owner.
  std::int64_t running_ = 0;
  std::int64_t memory_ = 0;
  std::int64_t long_ = 0;  // pieces of long work
  bool runs_alone_ = false;
};

}  // namespace

absl::StatusOr<std::vector<ClaimedWork>> JobStore::Claim(const VerbContext& context, const ClaimRequest& request,
                                                         ClaimWait* wait) {
  // If the store is on this machine, an attempt that takes the machine down must count, so the claim must be durable. A
  // shared database that forgets the last claims queues the work again. Writes under the old leases then change
  // nothing: the next attempt has the same number but another owner. If it has the same owner, JobRunner continues the
  // first attempt.
  const Durability durability = parts_->database->is_shared() ? Durability::kLater : Durability::kNow;
  std::vector<ClaimedWork> claimed;
  ClaimWait unwanted;
  if (wait == nullptr) wait = &unwanted;
  PLANISH_RETURN_IF_ERROR(parts_->transactions.Change(context, durability, [&](JobTransaction& transaction) {
    claimed.clear();
    return Claimer(&transaction, request, &claimed, wait).Run();
  }));
  return claimed;
}

}  // namespace planish
