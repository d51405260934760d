// What waits for workers, and whose turn it is.
//
// Between tenants: start-time fair queueing for several servers (Goyal, Vin, Cheng: "Start-time Fair Queueing", SIGCOMM
// 1996; SFQ(D) of Jin, Chase, Kaur: "Interposed Proportional Sharing for a Storage Service Utility", SIGMETRICS 2004).
// There, costs are known; here they are expected at first and put right as workers go on:
//   received(t)  seconds of workers that tenant t had, over its share; a job that runs counts with what it took so far
//   start(t)     the same, but a job that runs counts with what it is expected to take, if that is more
//   v            received(t), as it was then, of the tenant that got a worker last; never decreases while jobs are here
// The next worker is for the tenant with the least start(t) of those that have jobs waiting and may run one more. A
// tenant whose queue was empty begins at max(start(t), v): its absence earns it nothing, and what it took while others
// waited is remembered. Since v <= received(t) < start(t) for whoever got the last worker, a tenant that comes is ahead
// of one that has been served all the time, however many jobs that one has waiting.
//
// Within a tenant: by age and priority (QueueTime).
#pragma once

#include <cstdint>
#include <map>
#include <optional>
#include <set>
#include <string>
#include <tuple>
#include <unordered_map>
#include <utility>

#include "absl/time/time.h"
#include "planish/v1/job.pb.h"
#include "server/access/tenant.h"
#include "server/store/fair_share.h"

namespace planish {

struct JobQueueOptions {
  int workers = 1;                                 // pieces of work that run at a time
  int capacity = 64;                               // that may wait, of a tenant whose TenantLimits::queue is unset
  int total = 1024;                                // of all tenants
  std::int64_t max_bytes = std::int64_t{1} << 30;  // of the meshes that wait
  TenantLimitsSource limits = nullptr;             // null: the defaults for everybody
};

struct QueueEntry {
  std::string name;  // no two are alike
  std::string tenant;
  absl::Time time;          // QueueTime()
  std::int64_t number = 0;  // decides between equal times, the lower first
  std::int64_t bytes = 0;   // of the mesh
  double seconds = 0;       // that a worker is expected to take, before SetSecondsFactor(); 0: not known
};

// Not thread-safe. `now` is that of a clock which nobody sets.
class JobQueue {
 public:
  explicit JobQueue(JobQueueOptions options) : options_(std::move(options)) {}

  // What waits stays, also beyond a lower capacity.
  void set_capacity(int capacity) { options_.capacity = capacity; }

  // Entries of this tenant that may wait.
  int Capacity(const std::string& tenant) const;

  // Whether an entry with a mesh of `bytes` may be pushed: idle workers are about to take as many off. A tenant that
  // has nothing waiting may push a mesh of any size, so that nobody is refused for ever. The meshes of n tenants that
  // wait have at most max_bytes (1 + 1/2 + ... + 1/n) bytes, and the largest mesh n times.
  Room RoomFor(const std::string& tenant, std::int64_t bytes) const;

  // An entry of that name which waits already is put in its new place.
  void Push(QueueEntry entry, absl::Time now);

  // The name that is next; empty if none waits, or none whose tenant may run one more.
  std::optional<std::string> Front(absl::Time now) const;

  // An entry that waits is given to a worker, which has it until End().
  void Start(const std::string& name, absl::Time now);
  void End(const std::string& name, absl::Time now);

  // It waits no more. No effect if it does not wait.
  void Remove(const std::string& name);

  // What work takes over what is expected of it, lately; > 0.
  void SetSecondsFactor(double factor) { factor_ = factor; }

  // Entries that will start before `name`, if nobody else comes, work takes as long as expected, and limits of running
  // jobs are not met; 0 if it does not wait. Linear in the queue's length, as what follows.
  int Position(const std::string& name, absl::Time now) const;

  // Seconds until an entry of this tenant would start that is pushed now; roughly.
  double SecondsUntilTurn(const std::string& tenant, absl::Time now) const;

  // Seconds until there may be room again for a tenant for which there is none; empty: not known.
  std::optional<double> SecondsUntilRoom(const std::string& tenant, Room why, absl::Time now) const;

  // Waiting; given to workers; a tenant's of both.
  bool empty() const { return size_ == 0; }
  int size() const { return size_; }
  int running() const { return static_cast<int>(running_.size()); }
  int size(const std::string& tenant) const;
  int running(const std::string& tenant) const;

 private:
  struct Entry : QueueEntry {
    bool operator<(const Entry& other) const { return time != other.time ? time < other.time : number < other.number; }
  };

  struct Running {
    std::string tenant;
    absl::Time start;
    double share = 1;
    double seconds = 0;  // QueueEntry::seconds
  };

  struct Tenant {
    std::set<Entry> entries;
    std::set<std::string> running;
    std::int64_t bytes = 0;  // of the entries
    double received = 0;     // by jobs that ended
  };

  // When an entry starts, in the terms above.
  struct Turn {
    double start = 0;
    absl::Time time;
    std::int64_t number = 0;

    bool operator<(const Turn& other) const {
      return std::tie(start, time, number) < std::tie(other.start, other.time, other.number);
    }
  };

  struct Ahead {
    int count = 0;
    double seconds = 0;
  };

  TenantLimits LimitsOf(const std::string& tenant) const;
  double ShareOf(const std::string& tenant) const;
  bool MayRun(const std::string& name, const Tenant& tenant) const;
  double Expected(double seconds) const;
  double Charge(double seconds) const;
  double Remaining(const Running& running, absl::Time now) const;
  // The least of the jobs that run; of one tenant's, if it is not null.
  std::optional<double> UntilNextEnd(const Tenant* tenant, absl::Time now) const;
  double Received(const Tenant& tenant, absl::Time now) const;
  double StartOf(const Tenant& tenant, absl::Time now) const;
  const Tenant* Find(const std::string& tenant) const;
  // Takes away what it earned by being away.
  void Lift(Tenant* tenant, absl::Time now) const;
  // What starts before `turn` of the other tenants' entries.
  Ahead AheadOf(const Turn& turn, const std::string& except, absl::Time now) const;
  // Where nobody waits for anybody, all begin anew.
  void ForgetIfIdle();

  JobQueueOptions options_;
  std::map<std::string, Tenant> tenants_;  // that have entries, running jobs, or more than v
  std::unordered_map<std::string, Entry> places_;
  std::unordered_map<std::string, Running> running_;
  double virtual_time_ = 0;  // v
  double factor_ = 1;
  int size_ = 0;
  std::int64_t bytes_ = 0;
};

}  // namespace planish
