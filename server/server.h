// A planishd that serves: its parts, what connects them, and how they end.
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

// For one thread.
class Server {
 public:
  // `arguments`: of the command line, for reloads. `service_manager` and `events`, which were made before any thread,
  // outlive the object.
  Server(const ServerConfig& config, std::vector<std::string> arguments, const ServiceManager* service_manager,
         ShutdownEvents* events);
  // Ends in the reverse order of the members, which each need those before them.
  ~Server() = default;
  Server(const Server&) = delete;
  Server& operator=(const Server&) = delete;

  // Opens everything and begins to serve; once. Errors are for people, and say why it cannot.
  absl::Status Start(const FarmOpener& open_farm);
  // Serves until a signal, the supervisor or the lack of workers ends that, then ends or leaves the jobs and takes no
  // more calls (server/README.md, Shutdown). Whether there were workers to the end.
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
  std::optional<Farm> farm_;  // empty: the store is this server's own
  std::unique_ptr<JobManager> manager_;
  StreamCounter streams_;
  Reloader reloader_;
  std::optional<Admin> admin_;
  std::unique_ptr<RpcService> service_, admin_service_;
  std::unique_ptr<RpcServer> rpc_;  // null: a worker of a farm answers nobody
  std::optional<Upkeep> ticking_, beating_, tidying_, announcing_, watching_files_;
  NoWorkers no_workers_;
  std::optional<OutputLines> worker_output_;
  std::unique_ptr<WorkerPool> pool_;  // null: a front of a farm runs nothing
};

}  // namespace planish
