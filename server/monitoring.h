// Monitoring of planishd: metrics, probes and gRPC health. Hooks report events; current values are read at each scrape.
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

// The parts of a running server, and limits as in ServerGauges.
struct WatchedServer {
  const JobManager* jobs = nullptr;
  UploadStore* uploads = nullptr;
  const BlobCatalog* blobs = nullptr;
  const StreamCounter* streams = nullptr;
  RpcServer* rpc = nullptr;
  // Checks whether the store can be written; the error is for people. May never return. Null: the store cannot fail.
  std::function<absl::Status()> ask_store;
  int workers = 0;
  std::int64_t memory_limit_bytes = 0;
  std::int64_t store_limit_bytes = 0;
  std::int64_t uploads_limit_bytes = 0;
  std::function<absl::Time()> certificate_end;  // when the certificate in force expires; null: no TLS
  // How far this machine's clock is ahead of the store's. Null: it is the store's clock. Must be quick.
  std::function<absl::Duration()> clock_skew;
};

// Serves over HTTP, if Listen() is called:
//   /metrics  metrics (server/metrics/definitions.h); 503 before Attach() and after Detach(). If the store does not
//             answer, its numbers are those of its last answer.
//   /livez    200 as long as the process serves: its threads run, and the gRPC server answers a call made to it. 503
//             names the part that does not. For probes that restart the process, so the store does not count.
//   /readyz   200 if the server takes new jobs. 503 says why not, for instance the store. For probes that take the
//             server out of service.
// gRPC health reports the same: the service "" is live, "planish.v1.Planish" is ready.
//
// Create it first and destroy it last. Thread-safe.
class Monitoring {
 public:
  // `on_readiness` is called at each change, with the reason why the server is not ready, or "" if it is. May be null.
  explicit Monitoring(const std::string& version,
                      std::function<void(const std::string& why_not)> on_readiness = nullptr)
      : metrics_(version), on_readiness_(std::move(on_readiness)) {}

  // Begins to serve over HTTP. UNAVAILABLE as HttpEndpoint::Start().
  absl::Status Listen(const HttpEndpointOptions& options);
  // The address of /metrics and the probes; nullopt without Listen().
  std::optional<std::string> address() const;

  // ---- hooks; set them before anything starts. Functions that are already set are still called.
  void Hook(JobManagerOptions* options);
  void Hook(WorkerPoolOptions* options);
  CallListener Calls();

  // Workers that are ready, idle or with a job, as counted by the hooks.
  int workers_ready() const { return metrics_.workers_ready(); }

  // Call it when the server begins to serve.
  void Attach(const WatchedServer& server);
  // Call it a few times a second, on a thread that does nothing else. Never blocks.
  void Beat();
  // Call it after each round of upkeep.
  void NoteUpkeep() { last_upkeep_ = std::chrono::steady_clock::now(); }
  // Call it when the server takes no new jobs and is about to exit: it is no longer ready, but still live.
  void SetEnding();
  // Call it before the attached parts are destroyed. Waits for a running question to the store.
  void Detach();

 private:
  HttpAnswer Answer(const std::string& path) const;
  // Figures that the store has about jobs and uploads.
  struct StoreFigures {
    ManagerStats jobs;
    UploadGauges uploads;
  };

  HttpAnswer Metrics() const;
  HttpAnswer Live() const;
  HttpAnswer Ready() const;
  void SetStartError(std::string error);
  // Why the store prevents new jobs; "" if it does not.
  std::string StoreObstacle(std::chrono::steady_clock::time_point now);
  // Updates gRPC's health and calls on_readiness_ if readiness changed.
  void TellReadiness();

  ServerMetrics metrics_;
  const std::function<void(const std::string&)> on_readiness_;
  Readiness readiness_;
  std::atomic<bool> ending_ = false;
  std::atomic<std::chrono::steady_clock::time_point> last_beat_ = {}, last_upkeep_ = {};
  std::chrono::steady_clock::time_point next_probe_;  // used by Beat() only

  std::mutex start_mutex_;
  std::string start_error_;  // why the last start of a worker failed, or ""; guarded by start_mutex_

  mutable std::shared_mutex mutex_;
  std::optional<WatchedServer> server_;  // guarded by mutex_
  // Guarded by mutex_. Null while nothing is attached; `probe_` also if there is nothing to ask.
  std::unique_ptr<PatientQuestion<absl::Status>> probe_;
  std::unique_ptr<PatientQuestion<StoreFigures>> figures_;
  std::mutex telling_;
  bool told_ready_ = true;  // guarded by telling_; gRPC's health begins as SERVING

  std::unique_ptr<HttpEndpoint> endpoint_;  // the last member, so that its threads end before the others are destroyed
};

}  // namespace planish
