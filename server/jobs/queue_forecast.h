// A forecast of the queue: positions of waiting work, and when work will be claimed or room will be free.
#pragma once

#include <list>
#include <map>
#include <optional>
#include <string>
#include <unordered_set>
#include <vector>

#include "server/access/tenant.h"
#include "server/store/job_store.h"

namespace planish {

// A snapshot of the queue, and the work that was added to it since. Assumes that no other work arrives, that work takes
// as long as expected, and, for positions, that no tenant reaches its limit of running work. Not thread-safe; all
// functions are linear in the queue's length.
class QueueForecast {
 public:
  // `limits` null: the default limits for every tenant. `workers`: the number of workers of all servers. `factor`:
  // recent ratio of actual to estimated seconds, > 0.
  QueueForecast(QueueState state, const TenantLimitsSource& limits, int workers, double factor);

  QueueForecast(QueueForecast&&) = default;
  QueueForecast& operator=(QueueForecast&&) = default;

  // The accounts of the snapshot, without added work.
  const FairAccounts& accounts() const { return state_.accounts; }

  // Adds work that arrived since the snapshot. No effect if it is already known.
  void Add(const WorkRow& work);

  // Pieces of work that will be claimed before `work`; 0 if it does not wait.
  int Position(const std::string& work) const;

  // Work that this tenant adds now would be claimed in roughly this many seconds.
  double SecondsUntilTurn(const std::string& tenant) const;

  // Seconds until a tenant without room may have room again; empty if unknown.
  std::optional<double> SecondsUntilRoom(const std::string& tenant, Room why) const;

 private:
  struct Tenant {
    TenantAccount account;
    TenantLimits limits;
    double share = 1;
    double start = 0;                     // virtual start time of the work that is added next, in seconds
    std::vector<const WorkRow*> waiting;  // in the order in which it will be claimed
    std::vector<const WorkRow*> running;
  };

  // The key by which Claim() orders work.
  struct Turn {
    double start = 0;
    std::int64_t time = 0;
    std::int64_t number = 0;

    bool operator<(const Turn& other) const;
  };

  struct Ahead {
    int count = 0;
    double seconds = 0;
  };

  Tenant NewTenant(const std::string& name, const TenantLimitsSource& limits) const;
  double Expected(const WorkRow& work) const;
  double Charge(const WorkRow& work, double share) const;
  double Remaining(const WorkRow& work) const;
  // Remaining seconds of the running work that ends first; of one tenant's work if `tenant` is not null.
  std::optional<double> UntilNextEnd(const Tenant* tenant) const;
  // The waiting work that is claimed before `turn`, without that of the tenant `except`.
  Ahead AheadOf(const Turn& turn, const std::string& except) const;

  QueueState state_;
  std::list<WorkRow> added_;
  std::unordered_set<std::string> names_;  // of the work in state_ and added_
  TenantLimitsSource limits_;
  int workers_ = 1;
  double factor_ = 1;
  std::map<std::string, Tenant> tenants_;  // tenants with work in state_ or added_
  Tenant nobody_;
  int running_ = 0;
};

}  // namespace planish
