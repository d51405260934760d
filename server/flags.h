// The command line of planishd.
#pragma once

#include <cstdint>
#include <string>
#include <variant>
#include <vector>

#include "server/link/worker_arguments.h"
#include "server/rpc/listen_address.h"

namespace planish {

struct ServerFlags {
  std::vector<ListenAddress> listen;  // at least one

  std::string instance;  // part of the names of jobs and uploads (IdsOf()); empty: none

  std::string data_dir;                // empty: everything is kept in memory and ends with the process
  std::int64_t store_mb = 4096;        // MiB of meshes and UV, kept or waiting, >= 1
  int retain_jobs = 256;               // >= 1
  std::int64_t retain_mb = 1024;       // MiB, >= 0
  double retain_hours = 24;            // > 0
  std::int64_t max_uploads_mb = 4096;  // MiB under way, >= 1

  int workers = 1;       // >= 1
  int threads = 1;       // of a job, in [1, 256]
  bool isolated = true;  // workers are processes
  SandboxMode sandbox = SandboxMode::kAuto;
  int recycle_after = 200;     // jobs, >= 1
  double job_hours = 12;       // a worker may take for a job, > 0
  std::int64_t memory_mb = 0;  // MiB that running jobs may reserve, >= 1

  int queue = 64;                            // jobs, >= 0
  std::int64_t max_mesh_mb = 256;            // MiB, in [1, 2000]
  std::int64_t max_triangles = 100'000'000;  // >= 1
  double reattach_seconds = 10;              // >= 0
  double grace_seconds = 30;                 // >= 0

  std::string log_level = "info";  // as spdlog spells it
  int supervisor_fd = -1;          // -1: none
  bool failpoints = false;
};

// The flags, or the exit code of a command that is over: 0 after --help or --version, 2 after a message on stderr
// about bad usage.
std::variant<ServerFlags, int> ParseFlags(int argc, char** argv);

}  // namespace planish
