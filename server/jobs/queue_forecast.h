// What is to come of what waits now: places in the queue, and when there will be a turn or room.
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

// Of one moment, and what was added to it. Assumes that nobody else comes, that work takes as long as expected, and,
// for places, that limits of running work are not met. Not thread-safe; all functions are linear in the queue's length.
class QueueForecast {
 public:
  // `limits` null: the defaults for everybody. `workers` of all that run work. `factor`: what work takes over what was
  // expected of it, lately; > 0.
  QueueForecast(QueueState state, const TenantLimitsSource& limits, int workers, double factor);

  QueueForecast(QueueForecast&&) = default;
  QueueForecast& operator=(QueueForecast&&) = default;

  // As they were, without what was added.
  const FairAccounts& accounts() const { return state_.accounts; }

  // Counts work that has come since. No effect if it is known.
  void Add(const WorkRow& work);

  // Pieces of work that will be claimed before `work`; 0 if it does not wait.
  int Position(const std::string& work) const;

  // Seconds until work of this tenant would be claimed that is added now; roughly.
  double SecondsUntilTurn(const std::string& tenant) const;

  // Seconds until there may be room again for a tenant for which there is none; empty: not known.
  std::optional<double> SecondsUntilRoom(const std::string& tenant, Room why) const;

 private:
  struct Tenant {
    TenantAccount account;
    TenantLimits limits;
    double share = 1;
    double start = 0;                     // seconds; what is added next begins so
    std::vector<const WorkRow*> waiting;  // in their order
    std::vector<const WorkRow*> running;
  };

  // When work is claimed: as Claim() decides.
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
  // The least of the work that runs; of one tenant's, if it is not null.
  std::optional<double> UntilNextEnd(const Tenant* tenant) const;
  // What is claimed before `turn` of the other tenants' work.
  Ahead AheadOf(const Turn& turn, const std::string& except) const;

  QueueState state_;
  std::list<WorkRow> added_;
  std::unordered_set<std::string> names_;  // of the work in both
  TenantLimitsSource limits_;
  int workers_ = 1;
  double factor_ = 1;
  std::map<std::string, Tenant> tenants_;  // that have work, which is in state_ or added_
  Tenant nobody_;
  int running_ = 0;
};

}  // namespace planish
