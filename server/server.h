// A running planishd: its parts, their connections, and the shutdown.
#pragma once

#include <memory>
#include <optional>
#include <string>
#include <vector>

#include "absl/status/status.h"
#include "absl/status/statusor.h"
#include "server/admin.h"
#include "server/farm.h"
#include "server/flags.h"
#include "server/front_door.h"
#include "server/jobs/job_manager.h"
#include "server/jobs/worker_pool.h"
#include "server/log/output_lines.h"
#include "server/monitoring.h"
#include "server/no_workers.h"
#include "server/reload.h"
#include "server/rpc/rpc_server.h"
#include "server/rpc/service.h"
#include "server/service_manager.h"
#include "server/shutdown_events.h"
#include "server/stores.h"
#include "server/upkeep.h"

namespace planish {

// Use it from one thread.
class Server {
 public:
  // `arguments`: the command line, for reloads. `service_manager` and `events` outlive the object; create them before
  // any thread.
  Server(const ServerConfig& config, std::vector<std::string> arguments, const ServiceManager* service_manager,
         ShutdownEvents* events);
  // Destroys the members in reverse order, since each uses earlier ones.
  ~Server() = default;
  Server(const Server&) = delete;
  Server& operator=(const Server&) = delete;

  // Opens everything and begins to serve. Call it once. Errors are for people.
  absl::Status Start(const FarmOpener& open_farm);
  // Serves until a signal, the end of the supervisor, or a lack of workers. Then ends the jobs or leaves them to
  // another server, and stops taking calls (server/README.md, Shutdown). False if no workers could be started.
  bool Run();

 private:
  absl::Status OpenJobs();
  absl::Status OpenRpc();
  void StartWorkers();
  void StartUpkeep();
  void AddReloadHooks();
  WatchedServer Watched();
  std::function<absl::Status()> StoreQuestion();
  std::string Description() const;
  bool WaitUntilIdle(absl::Duration limit);
  bool EndJobs(absl::Duration grace);

  const ServerConfig config_;
  const std::vector<std::string> arguments_;
  const ServiceManager& service_manager_;
  ShutdownEvents& events_;
  double grace_seconds_;
  Monitoring monitoring_;  // first, so that probes are answered while stores are opened
  std::unique_ptr<FrontDoor> door_;
  Stores stores_;
  std::optional<Farm> farm_;  // empty: no other server shares the store
  std::unique_ptr<JobManager> manager_;
  StreamCounter streams_;
  Reloader reloader_;
  std::optional<Admin> admin_;
  std::unique_ptr<RpcService> service_, admin_service_;
  std::unique_ptr<RpcServer> rpc_;  // null for a worker of a farm, which answers no callers
  std::optional<Upkeep> ticking_, beating_, tidying_, announcing_, watching_files_;
  NoWorkers no_workers_;
  std::optional<OutputLines> worker_output_;
  std::unique_ptr<WorkerPool> pool_;  // null for a front of a farm, which runs no jobs
};

}  // namespace planish
