// Whose turn it is, and who may have more waiting: decisions over what each tenant has and had.
//
// Start-time fair queueing for several servers (Goyal, Vin, Cheng: "Start-time Fair Queueing", SIGCOMM 1996; SFQ(D) of
// Jin, Chase, Kaur: "Interposed Proportional Sharing for a Storage Service Utility", SIGMETRICS 2004). There, costs are
// known; here they are expected at first and put right as attempts end:
//   Received(t)  worker time that tenant t had, over its share; work that runs counts with what it took so far
//   Start(t)     the same, but all work that runs counts with what it is expected to take, if that is more, and with a
//                little more than it took in any case
//   v            Received(t), as it was then, of the tenant whose work was claimed last; never decreases while there is
//                work
// The next work is that of the tenant with the least Start(t) of those that have work waiting and may run one more. A
// tenant that had nothing waiting begins at max(Start(t), v), and so does one that its own limit of running work kept
// back: neither earns it anything, and what it took while others waited is remembered. Since v <= Received(t) <
// Start(t) for whoever got the last worker, a tenant that comes is ahead of one that has been served all the time,
// however much work that one has waiting.
//
// Within a tenant: by age and priority (QueueTime).
#pragma once

#include <cstdint>
#include <map>
#include <string>

#include "absl/time/time.h"
#include "planish/v1/job.pb.h"
#include "server/access/tenant.h"

namespace planish {

// When a job that came at `create_time` counts as having come (planish.v1.Priority).
absl::Time QueueTime(absl::Time create_time, v1::Priority priority);

// What one tenant has in the store. Times in nanoseconds, unless said.
struct TenantAccount {
  std::int64_t waiting = 0;        // pieces of work
  std::int64_t waiting_bytes = 0;  // of their meshes
  std::int64_t running = 0;        // pieces of work
  std::int64_t started = 0;        // sum of the times when these were claimed, milliseconds since 1970
  std::int64_t charged = 0;        // sum of what these are expected to take, over the tenant's share
  std::int64_t received = 0;       // worker time of attempts that ended, over the tenant's share
  std::int64_t ended = 0;          // jobs in terminal states
  std::int64_t result_bytes = 0;   // of the UV of those that SUCCEEDED
  std::int64_t record_bytes = 0;   // of the records, reports and events of those that ended

  TenantAccount& operator+=(const TenantAccount& other);
  bool operator==(const TenantAccount&) const = default;
};

struct FairAccounts {
  std::map<std::string, TenantAccount> tenants;
  std::int64_t virtual_time = 0;  // v
};

// Whether nothing waits and nothing runs.
bool IsIdle(const FairAccounts& accounts);

std::int64_t ReceivedBy(const TenantAccount& account, double share, absl::Time now);
std::int64_t StartOf(const TenantAccount& account, double share, absl::Time now);
// What work counts with that is expected to take `run_time`.
std::int64_t ChargeFor(absl::Duration run_time, double share);
// What an attempt that took `elapsed` adds to TenantAccount::received.
std::int64_t SettledFor(absl::Duration elapsed, double share);

// What to add to `received` of a tenant that begins at v.
std::int64_t LiftOf(const FairAccounts& accounts, const std::string& tenant, double share, absl::Time now);

double ShareOf(const TenantLimits& limits);
bool MayRunMore(const TenantLimits& limits, std::int64_t running);

// How much may wait.
struct QueueLimits {
  int tenant_jobs = 64;                              // pieces of work of one tenant
  int total_jobs = 1024;                             // of all tenants
  std::int64_t total_bytes = std::int64_t{1} << 30;  // of the meshes that wait
  double share = 1;                                  // of the tenant
  int workers = 0;                                   // that take work at once if they are idle: as many more may wait
};

enum class Room {
  kYes,
  kTenantFull,  // the tenant has as many as it may
  kServerFull,  // all tenants together have, and this one an equal part of it (HasFairPart)
};

// Whether work with a mesh of `bytes` may be added. A tenant that has nothing waiting may add a mesh of any size, so
// that nobody is refused for ever. The meshes of n tenants that wait have at most total_bytes (1 + 1/2 + ... + 1/n)
// bytes, and the largest mesh n times.
Room RoomFor(const FairAccounts& accounts, const QueueLimits& limits, const std::string& tenant, std::int64_t bytes);

}  // namespace planish
