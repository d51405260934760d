// For operators of a planish server: statistics, configuration, and draining.
//
//   planish::AdminClient admin("farm:7741");
//   admin.Drain();                                                        // the server accepts no new jobs
//   while (!admin.GetStats().IsIdle()) std::this_thread::sleep_for(1s);   // its accepted jobs go on
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
  int workers = 0;        // jobs that may run at the same time
  int workers_ready = 0;  // idle or with a job
  int queued = 0;         // waiting jobs
  int running = 0;        // running jobs, including those being stopped
  // Memory reserved by running jobs, and the limit of all reservations together.
  std::int64_t reserved_memory_bytes = 0, memory_bytes = 0;
  // Bytes of stored meshes and UV, and the capacity of the store.
  std::int64_t stored_bytes = 0, store_bytes = 0;
  Seconds oldest_wait{0};       // of the job that has waited longest; 0 if no job waits
  std::vector<Tenant> tenants;  // by name

  bool IsIdle() const { return queued == 0 && running == 0; }
};

struct ServerConfig {
  // The settings in effect as a configuration file of planishd, with the source of each value as a comment.
  std::string yaml;
  std::chrono::system_clock::time_point load_time;  // when the server last read its configuration without an error
};

// A connection to one server. Movable; all calls are thread-safe. They throw planish::Error, with RIGHT_MISSING
// (kPermissionDenied) for callers without the right "admin". Calls are not retried; the caller may repeat them.
class AdminClient {
 public:
  // `target`: "host:port" or "unix:/path". Of `options`, only those about the connection, TLS and the token are used.
  explicit AdminClient(const std::string& target, const ClientOptions& options = {});
  AdminClient(AdminClient&&) = default;
  AdminClient& operator=(AdminClient&&) = default;

  // The constructor without exceptions. As in Client, calls with std::nothrow throw nothing.
  static Result<AdminClient> Make(const std::string& target, const ClientOptions& options = {});

  // Returns at once. Until Undrain(), the server refuses new jobs (DRAINING) and reports that it is not ready.
  Result<void> Drain(std::nothrow_t);
  void Drain() { Drain(std::nothrow).value(); }
  // Undoes Drain(). Throws SHUTTING_DOWN (kFailedPrecondition) if the server is shutting down.
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
