#include "server/store/fair_share.h"

#include <algorithm>

#include "server/access/fair_part.h"

namespace planish {
namespace {

// The waiting time that one step of priority is worth.
constexpr absl::Duration kPriorityStep = absl::Minutes(10);

// The least cost of work. If nothing is known about run times, all work costs this.
constexpr absl::Duration kLeastCost = absl::Milliseconds(10);

std::int64_t OverShare(double nanoseconds, double share) {
  return static_cast<std::int64_t>(nanoseconds / share);
}

// Time that the tenant's running work has taken so far.
double Elapsed(const TenantAccount& account, absl::Time now) {
  const double milliseconds = static_cast<double>(account.running) * static_cast<double>(absl::ToUnixMillis(now)) -
                              static_cast<double>(account.started);
  return std::max(milliseconds, 0.0) * 1e6;
}

}  // namespace

absl::Time QueueTime(absl::Time create_time, v1::Priority priority) {
  if (priority == v1::PRIORITY_HIGH) return create_time - kPriorityStep;
  if (priority == v1::PRIORITY_LOW) return create_time + kPriorityStep;
  return create_time;
}

TenantAccount& TenantAccount::operator+=(const TenantAccount& other) {
  waiting += other.waiting;
  waiting_bytes += other.waiting_bytes;
  running += other.running;
  started += other.started;
  charged += other.charged;
  received += other.received;
  ended += other.ended;
  result_bytes += other.result_bytes;
  record_bytes += other.record_bytes;
  return *this;
}

bool IsIdle(const FairAccounts& accounts) {
  return std::all_of(accounts.tenants.begin(), accounts.tenants.end(),
                     [](const auto& each) { return each.second.waiting <= 0 && each.second.running <= 0; });
}

std::int64_t ReceivedBy(const TenantAccount& account, double share, absl::Time now) {
  return account.received + OverShare(Elapsed(account, now), share);
}

std::int64_t StartOf(const TenantAccount& account, double share, absl::Time now) {
  const double least = static_cast<double>(account.running) * absl::ToDoubleNanoseconds(kLeastCost);
  return account.received + std::max(OverShare(Elapsed(account, now) + least, share), account.charged);
}

std::int64_t ChargeFor(absl::Duration run_time, double share) {
  return OverShare(absl::ToDoubleNanoseconds(std::max(run_time, kLeastCost)), share);
}

std::int64_t SettledFor(absl::Duration elapsed, double share) {
  return ChargeFor(elapsed, share);
}

std::int64_t LiftOf(const FairAccounts& accounts, const std::string& tenant, double share, absl::Time now) {
  const auto found = accounts.tenants.find(tenant);
  const TenantAccount account = found == accounts.tenants.end() ? TenantAccount() : found->second;
  return std::max<std::int64_t>(accounts.virtual_time - StartOf(account, share, now), 0);
}

double ShareOf(const TenantLimits& limits) {
  return limits.share > 0 ? limits.share : 1;
}

bool MayRunMore(const TenantLimits& limits, std::int64_t running) {
  return limits.running < 0 || running < limits.running;
}

Room RoomFor(const FairAccounts& accounts, const QueueLimits& limits, const std::string& tenant, std::int64_t bytes) {
  TenantAccount all, own;
  std::int64_t among = 0;  // tenants with waiting work, and this one
  for (const auto& [name, account] : accounts.tenants) {
    all += account;
    if (name == tenant) own = account;
    among += account.waiting > 0 ? 1 : 0;
  }
  among += own.waiting > 0 ? 0 : 1;
  const std::int64_t idle = std::max<std::int64_t>(limits.workers - all.running, 0);
  // Idle workers take the waiting work of other tenants first.
  const std::int64_t idle_for_own = std::max<std::int64_t>(idle - (all.waiting - own.waiting), 0);
  if (own.waiting >= limits.tenant_jobs + idle_for_own) return Room::kTenantFull;
  const std::int64_t total = std::max<std::int64_t>(limits.total_jobs, among) + idle;
  if (!HasFairPart(own.waiting, all.waiting, 1, total, among)) return Room::kServerFull;
  if (own.waiting > 0 && !HasFairPart(own.waiting_bytes, all.waiting_bytes, bytes, limits.total_bytes, among)) {
    return Room::kServerFull;
  }
  return Room::kYes;
}

}  // namespace planish
