// The figures of a JobManager, for operators and metrics.
#pragma once

#include <cstdint>
#include <map>
#include <string>
#include <vector>

#include "absl/time/time.h"
#include "planish/v1/job.pb.h"
#include "server/store/job_store.h"

namespace planish {

struct WaitingJobs {
  int jobs = 0;
  absl::Duration longest;  // time since the oldest of them was accepted; 0 if there are none
};

// Current numbers. `accepted`, `refused` and `shared` count since the start of this process.
struct TenantStats {
  std::string tenant;
  int queued = 0;  // waiting jobs, including those that share work
  // The same by priority, without priorities that have no jobs; UNSPECIFIED counts as NORMAL.
  std::map<v1::Priority, WaitingJobs> waiting;
  int running = 0;              // jobs RUNNING or STOPPING
  std::int64_t accepted = 0;    // new jobs
  std::int64_t refused = 0;     // requests for jobs that were refused
  std::int64_t shared = 0;      // accepted jobs that share another job's work or result
  std::int64_t ended_kept = 0;  // records of ended jobs
  std::int64_t stored_bytes = 0;
};

struct ManagerStats {
  std::string store_id;
  bool store_answered = true;  // if false, the numbers are incomplete
  bool draining = false;
  int workers = 0;       // pieces of work that may run at a time, on all servers that share the store
  int own_workers = 0;   // pieces of work that may run at a time on this server
  int queued = 0;        // waiting jobs
  int running = 0;       // jobs RUNNING or STOPPING
  int queued_work = 0;   // waiting pieces of work; bounded by queue_total
  int running_work = 0;  // pieces of work that workers have
  int queue_total = 0;
  std::int64_t reserved_memory_bytes = 0;  // by work that runs on this server
  std::int64_t all_reserved_bytes = 0;     // by work on all servers that share the store
  std::int64_t all_memory_bytes = 0;       // memory that may be reserved on all these servers
  std::int64_t stored_bytes = 0;
  std::int64_t store_bytes = 0;  // capacity of the store
  absl::Duration oldest_wait;    // 0 if no job waits
  std::map<std::string, std::int64_t> refused_by_reason;
  std::vector<TenantStats> tenants;  // tenants with jobs, bytes or calls; by name

  // Adds a count of unfinished jobs of one tenant. `tenant`: the stats of that tenant.
  void Add(const JobCount& counted, absl::Time now, TenantStats* tenant);
};

}  // namespace planish
