// Fair queueing: decides whose work is next and who may queue more, from the tenants' accounts.
//
// Start-time fair queueing for several servers (Goyal, Vin, Cheng: "Start-time Fair Queueing", SIGCOMM 1996; SFQ(D) of
// Jin, Chase, Kaur: "Interposed Proportional Sharing for a Storage Service Utility", SIGMETRICS 2004). There, costs are
// known; here they are estimated at first and corrected when attempts end:
//   Received(t)  worker time of tenant t divided by its share; running work counts with its time so far
//   Start(t)     the same, but running work counts with its expected time if that is longer, and always with slightly
//                more than its time so far
//   v            virtual time: Received(t) of the tenant whose work was claimed last, at that time; never decreases
//                while there is work
// The next work is that of the tenant with the least Start(t), among the tenants that have waiting work and may run
// more. A tenant that had no waiting work begins at max(Start(t), v), and so does one that was held back by its own
// limit on running work. So no tenant gains credit while it does not compete, and the time that it used while others
// waited is remembered. Since v <= Received(t) < Start(t) for the tenant that got the last worker, a new tenant is
// ahead of a tenant that has been served all the time, however much work the latter has waiting.
//
// Within a tenant, age and priority decide (QueueTime).
#pragma once

#include <cstdint>
#include <map>
#include <string>

#include "absl/time/time.h"
#include "planish/v1/job.pb.h"
#include "server/access/tenant.h"

namespace planish {

// The time from which a job counts as waiting: earlier for a higher priority (planish.v1.Priority).
absl::Time QueueTime(absl::Time create_time, v1::Priority priority);

// The account of one tenant. Times in nanoseconds, unless noted.
struct TenantAccount {
  std::int64_t waiting = 0;        // pieces of work
  std::int64_t waiting_bytes = 0;  // of the meshes of waiting work
  std::int64_t running = 0;        // pieces of work
  std::int64_t started = 0;        // sum of the claim times of running work, milliseconds since 1970
  std::int64_t charged = 0;        // sum of the expected times of running work, divided by the share
  std::int64_t received = 0;       // worker time of ended attempts, divided by the share
  std::int64_t ended = 0;          // jobs in terminal states
  std::int64_t result_bytes = 0;   // UV of jobs that SUCCEEDED
  std::int64_t record_bytes = 0;   // records, reports and events of ended jobs

  TenantAccount& operator+=(const TenantAccount& other);
  bool operator==(const TenantAccount&) const = default;
};

struct FairAccounts {
  std::map<std::string, TenantAccount> tenants;
  std::int64_t virtual_time = 0;  // v
};

// Whether no work waits or runs.
bool IsIdle(const FairAccounts& accounts);

std::int64_t ReceivedBy(const TenantAccount& account, double share, absl::Time now);
std::int64_t StartOf(const TenantAccount& account, double share, absl::Time now);
// The charge for work that is expected to take `run_time`.
std::int64_t ChargeFor(absl::Duration run_time, double share);
// What an attempt of length `elapsed` adds to TenantAccount::received.
std::int64_t SettledFor(absl::Duration elapsed, double share);

// What to add to the tenant's `received` to raise its Start(t) to v; 0 if it is not below v.
std::int64_t LiftOf(const FairAccounts& accounts, const std::string& tenant, double share, absl::Time now);

double ShareOf(const TenantLimits& limits);
bool MayRunMore(const TenantLimits& limits, std::int64_t running);

// Limits on waiting work.
struct QueueLimits {
  int tenant_jobs = 64;                              // pieces of work of one tenant
  int total_jobs = 1024;                             // of all tenants
  std::int64_t total_bytes = std::int64_t{1} << 30;  // of the waiting meshes
  double share = 1;                                  // of the tenant
  int workers = 0;  // of all servers; as many more pieces may wait as workers are idle, since these take them at once
};

enum class Room {
  kYes,
  kTenantFull,  // the tenant has reached its limit
  kServerFull,  // the limit for all tenants is reached, and this tenant has its equal part of it
};

// Whether work with a mesh of `bytes` may be added. A tenant without waiting work may add a mesh of any size, so that
// it is not refused for ever. The waiting meshes of n tenants have at most total_bytes (1 + 1/2 + ... + 1/n) bytes,
// plus n times the largest mesh.
Room RoomFor(const FairAccounts& accounts, const QueueLimits& limits, const std::string& tenant, std::int64_t bytes);

}  // namespace planish
