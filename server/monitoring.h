// Everything by which others watch planishd: numbers, probes, health. It hears of what happens by hooks, and asks for
// what is at the moment it is asked itself.
#pragma once

#include <atomic>
#include <chrono>
#include <cstdint>
#include <functional>
#include <memory>
#include <mutex>
#include <optional>
#include <shared_mutex>
#include <string>
#include <utility>

#include "absl/status/status.h"
#include "absl/time/time.h"
#include "server/blobs/blob_catalog.h"
#include "server/jobs/job_manager.h"
#include "server/jobs/upload_store.h"
#include "server/jobs/worker_pool.h"
#include "server/metrics/http_endpoint.h"
#include "server/metrics/patient_question.h"
#include "server/metrics/readiness.h"
#include "server/metrics/server_metrics.h"
#include "server/rpc/call.h"
#include "server/rpc/rpc_server.h"
#include "server/rpc/stream_counter.h"

namespace planish {

// The parts of a server that serves, and limits as ServerGauges has them.
struct WatchedServer {
  const JobManager* jobs = nullptr;
  UploadStore* uploads = nullptr;
  const BlobCatalog* blobs = nullptr;
  const StreamCounter* streams = nullptr;
  RpcServer* rpc = nullptr;
  // Whether the store takes what is written to it, for people; may take for ever. Null: nothing can go wrong with it.
  std::function<absl::Status()> ask_store;
  int workers = 0;
  std::int64_t memory_limit_bytes = 0;
  std::int64_t store_limit_bytes = 0;
  std::int64_t uploads_limit_bytes = 0;
  std::function<absl::Time()> certificate_end;  // of the certificate in force; null: there is no TLS
  // How far this machine's clock is ahead of the store's; null: it is the store's. Quick.
  std::function<absl::Duration()> clock_skew;
};

// Serves over HTTP, where asked to:
//   /metrics  numbers (server/metrics/definitions.h); 503 before Attach() and after Detach(). Where the store does not
//             answer, its numbers are those of its last answer.
//   /livez    200 as long as the process serves: its threads run, and the gRPC server answers a call made to it. 503
//             says what does not. For probes that restart: a restart helps no store, so the store does not count.
//   /readyz   200 where new jobs are welcome. 503 says why not, the store for instance. For probes that take out of
//             service.
// and says the same by gRPC health: the service "" is live, "planish.v1.Planish" is ready.
//
// Made first and destroyed last. Thread-safe.
class Monitoring {
 public:
  // `on_readiness` hears of each change: why the server is not ready, or "" if it is; null: nobody listens.
  explicit Monitoring(const std::string& version,
                      std::function<void(const std::string& why_not)> on_readiness = nullptr)
      : metrics_(version), on_readiness_(std::move(on_readiness)) {}

  // Serves from its return on. UNAVAILABLE as HttpEndpoint::Start().
  absl::Status Listen(const HttpEndpointOptions& options);
  // Where, if anywhere.
  std::optional<std::string> address() const;

  // ---- hooks, to be set before anything starts. What is in them already goes on to be called.
  void Hook(JobManagerOptions* options);
  void Hook(WorkerPoolOptions* options);
  CallListener Calls();

  // Workers that are there for jobs, idle or with one. From the hooks.
  int workers_ready() const { return metrics_.workers_ready(); }

  // The server serves from now on.
  void Attach(const WatchedServer& server);
  // To be called a few times a second, on a thread that does nothing else. Waits for nobody.
  void Beat();
  // Upkeep has come round.
  void NoteUpkeep() { last_upkeep_ = std::chrono::steady_clock::now(); }
  // The server takes no new jobs and is about to end: not ready any more, live as before.
  void SetEnding();
  // What was attached may go. Waits for a question to the store that is under way.
  void Detach();

 private:
  HttpAnswer Answer(const std::string& path) const;
  // What the store says of jobs and uploads.
  struct StoreFigures {
    ManagerStats jobs;
    UploadGauges uploads;
  };

  HttpAnswer Metrics() const;
  HttpAnswer Live() const;
  HttpAnswer Ready() const;
  void SetStartError(std::string error);
  // Why the store is in the way of new jobs, "": it is not.
  std::string StoreObstacle(std::chrono::steady_clock::time_point now);
  // Tells gRPC's health and on_readiness_ if it changed.
  void TellReadiness();

  ServerMetrics metrics_;
  const std::function<void(const std::string&)> on_readiness_;
  Readiness readiness_;
  std::atomic<bool> ending_ = false;
  std::atomic<std::chrono::steady_clock::time_point> last_beat_ = {}, last_upkeep_ = {};
  std::chrono::steady_clock::time_point next_probe_;  // touched by Beat() only

  std::mutex start_mutex_;
  std::string start_error_;  // of the last start of a worker, "": it went well; guarded by start_mutex_

  mutable std::shared_mutex mutex_;
  std::optional<WatchedServer> server_;  // guarded by mutex_
  // Guarded by mutex_, null while nothing is attached. `probe_` also where there is nothing to ask.
  std::unique_ptr<PatientQuestion<absl::Status>> probe_;
  std::unique_ptr<PatientQuestion<StoreFigures>> figures_;
  std::mutex telling_;
  bool told_ready_ = true;  // guarded by telling_; as gRPC's health begins

  std::unique_ptr<HttpEndpoint> endpoint_;  // last: its threads end first
};

}  // namespace planish
