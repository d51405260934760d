// For operators of a planish server: what it is doing, with what configuration, and the way down.
//
//   planish::AdminClient admin("farm:7741");
//   admin.Drain();                                  // the server is not ready, and takes no new jobs
//   while (!admin.GetStats().IsIdle()) ...          // those it has go on
#pragma once

#include <chrono>
#include <cstdint>
#include <memory>
#include <string>
#include <vector>

#include "planish/client.h"

namespace planish::inline abi0 {

struct ServerStats {
  struct Tenant {
    std::string name;
    int queued = 0, running = 0;
    std::int64_t accepted = 0, refused = 0;  // since the start of the server
  };

  std::string version;
  std::chrono::system_clock::time_point start_time;
  bool draining = false;
  int workers = 0;        // jobs that may run at a time
  int workers_ready = 0;  // for them, idle or with a job
  int queued = 0;         // jobs that wait
  int running = 0;        // jobs that run or are being stopped
  // Memory that running jobs reserve, and may reserve together.
  std::int64_t reserved_memory_bytes = 0, memory_bytes = 0;
  // Meshes and UV that are kept, and that may be.
  std::int64_t stored_bytes = 0, store_bytes = 0;
  Seconds oldest_wait{0};       // of the job that waits longest; 0 if none waits
  std::vector<Tenant> tenants;  // by name

  bool IsIdle() const { return queued == 0 && running == 0; }
};

struct ServerConfig {
  // In the form of planishd's configuration file, with where each value comes from as a comment.
  std::string yaml;
  std::chrono::system_clock::time_point load_time;  // when it was read last
};

// A connection to one server. Movable; all calls are thread-safe. They throw planish::Error, with RIGHT_MISSING
// (kPermissionDenied) for callers without the right "admin", and are made once each: repeating them is the caller's
// choice.
class AdminClient {
 public:
  // `target`: "host:port" or "unix:/path". Of the options those about the connection count.
  explicit AdminClient(const std::string& target, const ClientOptions& options = {});
  AdminClient(AdminClient&&) = default;
  AdminClient& operator=(AdminClient&&) = default;

  // The constructor without exceptions. As in Client, calls with std::nothrow throw nothing.
  static Result<AdminClient> Make(const std::string& target, const ClientOptions& options = {});

  // Returns at once. The server refuses new jobs (DRAINING) and says that it is not ready, until Undrain().
  Result<void> Drain(std::nothrow_t);
  void Drain() { Drain(std::nothrow).value(); }
  // SHUTTING_DOWN (kFailedPrecondition) if the server is about to end.
  Result<void> Undrain(std::nothrow_t);
  void Undrain() { Undrain(std::nothrow).value(); }
  Result<ServerStats> GetStats(std::nothrow_t);
  ServerStats GetStats() { return GetStats(std::nothrow).value(); }
  Result<ServerConfig> GetConfig(std::nothrow_t);
  ServerConfig GetConfig() { return GetConfig(std::nothrow).value(); }

 private:
  struct Impl;
  std::shared_ptr<Impl> impl_;
};

}  // namespace planish::inline abi0
