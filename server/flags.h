// What planishd runs with: the command line over the environment (PLANISHD_QUEUE for --queue) over a YAML file.
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

// Of settings that count in MiB.
inline constexpr std::int64_t kMiB = std::int64_t{1} << 20;

struct ServerFlags {
  std::vector<ListenAddress> listen;                  // at least one, of a worker none
  std::optional<HttpEndpointOptions> metrics_listen;  // nothing: no metrics and probes over HTTP

  StoreFlags store;
  std::int64_t store_mb = 4096;          // MiB of meshes and UV, kept or waiting, >= 1
  std::int64_t retain_mb = 1024;         // MiB, >= 0
  double retain_hours = 24;              // > 0
  std::int64_t retain_records_mb = 256;  // MiB, >= 1
  double retain_records_hours = 168;     // > 0
  std::int64_t max_uploads_mb = 4096;    // MiB under way, >= 1

  int workers = 1;       // >= 1, of a front 0
  int threads = 1;       // of a job, in [1, 256]
  bool isolated = true;  // workers are processes
  SandboxMode sandbox = SandboxMode::kAuto;
  int recycle_after = 200;     // jobs, >= 1
  double job_hours = 12;       // a worker may take for a job, > 0
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
  int supervisor_fd = -1;  // -1: none
  bool failpoints = false;
  std::string worker_program;  // empty: this program
};

struct ServerConfig {
  ServerFlags flags;
  std::vector<Setting> settings;      // all that a file may hold, as they are in effect
  std::vector<std::string> warnings;  // sentences about what was overlooked
};

// What such a command line (without the program's name) gives with this environment and the file that either names.
// INVALID_ARGUMENT with all that is wrong, one sentence a line. Call it again to see what changed.
absl::StatusOr<ServerConfig> ReadConfig(const std::vector<std::string>& arguments, const Environment& environment);

// ReadConfig() with the environment of the process. Or the exit code of a command that is over: 0 after --help,
// --version, --print-config and --check-config, 2 after a message on stderr about what is wrong.
std::variant<ServerConfig, int> ParseFlags(int argc, char** argv);

// Variables of planishd begin so.
inline constexpr char kEnvironmentPrefix[] = "PLANISHD_";

}  // namespace planish
