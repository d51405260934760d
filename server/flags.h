// The settings of planishd. The command line overrides the environment (PLANISHD_QUEUE for --queue), which overrides a
// YAML file.
#pragma once

#include <cstdint>
#include <optional>
#include <string>
#include <variant>
#include <vector>

#include "absl/status/statusor.h"
#include "server/config/setting.h"
#include "server/config/settings.h"
#include "server/link/worker_arguments.h"
#include "server/log/log.h"
#include "server/metrics/http_endpoint.h"
#include "server/rpc/listen_address.h"
#include "server/security_flags.h"
#include "server/store_flags.h"

namespace planish {

// The unit of settings in MiB.
inline constexpr std::int64_t kMiB = std::int64_t{1} << 20;

struct ServerFlags {
  std::vector<ListenAddress> listen;                  // at least one; none for a worker
  std::optional<HttpEndpointOptions> metrics_listen;  // empty: no metrics and probes over HTTP

  StoreFlags store;
  std::int64_t store_mb = 4096;          // MiB of stored meshes and UV, >= 1
  std::int64_t headroom_mb = 256;        // MiB of the disk that new meshes leave free, >= 0
  std::int64_t retain_mb = 1024;         // MiB, >= 0
  double retain_hours = 24;              // > 0
  std::int64_t retain_records_mb = 256;  // MiB, >= 1
  double retain_records_hours = 168;     // > 0
  std::int64_t max_uploads_mb = 4096;    // MiB under way, >= 1

  int workers = 1;            // >= 1; 0 for a front
  int short_workers = 0;      // of `workers`; >= 0 and less than `workers`
  double short_seconds = 10;  // > 0
  int threads = 1;            // of a job, in [1, 256]
  bool isolated = true;       // workers are processes
  SandboxMode sandbox = SandboxMode::kAuto;
  int recycle_after = 200;     // jobs, >= 1
  double job_hours = 12;       // longest time of a worker for a job, > 0
  std::int64_t memory_mb = 0;  // MiB that running jobs may reserve, >= 1

  int queue = 64;                            // jobs of a tenant, >= 0
  int queue_total = 1024;                    // jobs of all tenants, >= 1
  std::int64_t max_mesh_mb = 256;            // MiB, in [1, 2000]
  std::int64_t max_triangles = 100'000'000;  // >= 1
  double reattach_seconds = 10;              // >= 0
  double grace_seconds = 30;                 // >= 0

  SecurityFlags security;

  LogLevel log_level = LogLevel::kInfo;
  LogFormat log_format = LogFormat::kHuman;
  int supervisor_fd = -1;  // a socket: the server ends when the other side closes it; -1: none
  bool failpoints = false;
  std::string worker_program;  // empty: this program
};

struct ServerConfig {
  ServerFlags flags;
  std::vector<Setting> settings;      // all settings that a file may have, with the values in effect
  std::vector<std::string> warnings;  // sentences about unknown variables, for instance
};

// The settings from a command line (without the program's name), an environment, and the file that either of them
// names. INVALID_ARGUMENT with all errors, one on each line. Call it again for a reload.
absl::StatusOr<ServerConfig> ReadConfig(const std::vector<std::string>& arguments, const Environment& environment);

// ReadConfig() with the environment of the process. Returns an exit code if the program should end now: 0 after --help,
// --version, --print-config and --check-config, 2 after an error, which it prints on stderr.
std::variant<ServerConfig, int> ParseFlags(int argc, char** argv);

// The prefix of planishd's environment variables.
inline constexpr char kEnvironmentPrefix[] = "PLANISHD_";

}  // namespace planish
