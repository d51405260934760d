// What a JobManager is doing, for operators and for metrics.
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
  absl::Duration longest;  // since the first of them was accepted; 0 if none waits
};

// Numbers of now; counts are since the start of this process.
struct TenantStats {
  std::string tenant;
  int queued = 0;                               // jobs that wait, also for work they share
  std::map<v1::Priority, WaitingJobs> waiting;  // the same by priority, those with jobs; UNSPECIFIED counts as NORMAL
  int running = 0;                              // jobs RUNNING or STOPPING
  std::int64_t accepted = 0;                    // new jobs
  std::int64_t refused = 0;                     // requests for jobs that became none
  std::int64_t shared = 0;                      // of those accepted: share another job's work or result
  std::int64_t ended_kept = 0;                  // records of ended jobs
  std::int64_t stored_bytes = 0;
};

struct ManagerStats {
  std::string store_id;
  bool store_answered = true;  // every question; otherwise the numbers are not complete
  bool draining = false;
  int workers = 0;       // pieces of work that may run at a time, on all servers that share the store
  int own_workers = 0;   // on this one
  int queued = 0;        // jobs
  int running = 0;       // jobs
  int queued_work = 0;   // pieces of work: what queue_total bounds
  int running_work = 0;  // that workers have
  int queue_total = 0;
  std::int64_t reserved_memory_bytes = 0;  // by what runs on this server
  std::int64_t all_reserved_bytes = 0;     // on all servers that share the store
  std::int64_t all_memory_bytes = 0;       // that may be reserved there
  std::int64_t stored_bytes = 0;
  std::int64_t store_bytes = 0;  // that there may be
  absl::Duration oldest_wait;    // 0 if none waits
  std::map<std::string, std::int64_t> refused_by_reason;
  std::vector<TenantStats> tenants;  // with jobs, bytes or calls; by name

  // `tenant`: that of the jobs.
  void Add(const JobCount& counted, absl::Time now, TenantStats* tenant);
};

}  // namespace planish
