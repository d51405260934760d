// The command line of planishd.
#pragma once

#include <cstdint>
#include <string>
#include <variant>
#include <vector>

#include "server/rpc/listen_address.h"

namespace planish {

struct ServerFlags {
  std::vector<ListenAddress> listen;  // at least one
  int workers = 1;                    // >= 1
  int threads = 1;                    // of a job, in [1, 256]
  int queue = 64;                     // jobs, >= 0
  std::int64_t max_mesh_mb = 256;     // MiB, in [1, 2000]
  int retain_jobs = 256;              // >= 1
  std::int64_t retain_mb = 1024;      // MiB, >= 0
  double grace_seconds = 30;          // >= 0
  std::string log_level = "info";     // as spdlog spells it
  int supervisor_fd = -1;             // -1: none
};

// The flags, or the exit code of a command that is over: 0 after --help or --version, 2 after a message on stderr
// about bad usage.
std::variant<ServerFlags, int> ParseFlags(int argc, char** argv);

}  // namespace planish
