// One tenant fills the queue, another sends single jobs: how long these wait, with real worker processes.
#pragma once

#include <cstdint>
#include <map>
#include <string>
#include <vector>

namespace planish {

struct TenantFloodOptions {
  int workers = 2;
  int flood = 1000;                      // jobs of the first tenant, all there before the other one comes
  int singles = 20;                      // jobs of the other one, each sent a while after the last one has ended
  int grid = 12;                         // of the bumps that are unwrapped: 2 grid^2 triangles
  std::map<std::string, double> shares;  // "flood", "single"; 1 unless given
  // Instead of single jobs, the other tenant floods the queue as well, until so many jobs of both have ended.
  int both = 0;
};

struct TenantFloodReport {
  std::vector<double> single_wait_seconds;  // from acceptance to the worker
  std::vector<double> flood_run_seconds;    // of the flood's jobs that ended meanwhile
  // Jobs of the flood that got a worker while a single job waited, of each single job.
  std::vector<int> overtaken_by;
  int flood_ended = 0, other_ended = 0;  // with `both`
  double flood_worker_seconds = 0, other_worker_seconds = 0;
};

// The calling program must be a worker when it is started as one (server/worker_main.h). Throws std::runtime_error if a
// job is refused or fails.
TenantFloodReport RunTenantFlood(const TenantFloodOptions& options);

}  // namespace planish
