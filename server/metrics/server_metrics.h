// The numbers of a server, and their text at /metrics.
#pragma once

#include <cstdint>
#include <memory>
#include <string>
#include <string_view>

#include "absl/status/status.h"
#include "absl/time/time.h"
#include "server/jobs/job_observer.h"
#include "server/jobs/manager_stats.h"
#include "server/jobs/upload_store.h"
#include "server/jobs/worker_pool.h"

namespace planish {

// Values that are read when a scrape arrives. Names and units: server/metrics/definitions.h.
struct ServerGauges {
  ManagerStats jobs;
  UploadGauges uploads;
  int workers = 0;
  std::int64_t memory_limit_bytes = 0;
  std::int64_t store_bytes = 0;
  std::int64_t store_limit_bytes = 0;
  std::int64_t uploads_limit_bytes = 0;
  std::int64_t uv_sent_bytes = 0;
  int streams = 0;
  bool ready = false;
  absl::Duration clock_skew;
  bool store_answers = true;                       // false: `jobs` and `uploads` are from its last answer
  absl::Time certificate_end = absl::UnixEpoch();  // the epoch: no certificate
};

// Counts events as they happen. Thread-safe; each function takes about a microsecond, and waits only for other threads
// that count.
class ServerMetrics : public JobObserver {
 public:
  explicit ServerMetrics(const std::string& version);
  ~ServerMetrics() override;
  ServerMetrics(const ServerMetrics&) = delete;
  ServerMetrics& operator=(const ServerMetrics&) = delete;

  // ---- jobs
  void OnAccepted(const v1::Job& job, JobOrigin origin) override;
  void OnWorkEnded(const v1::Job& job, const worker::v1::WorkResult& result, absl::Duration duration) override;
  void OnWorkLost(const v1::Job& job, const WorkerLoss& loss, int retried, absl::Duration duration) override;
  // Counts a change of state. For JobManagerOptions::on_transition.
  void OnTransition(const v1::Job& job);
  void OnStoreError();

  // ---- workers
  void OnWorkerStarted();
  void OnWorkerStartFailed();
  void OnWorkerEnded(WorkerEndCause cause);
  // Workers that have started and not ended.
  int workers_ready() const;

  // ---- calls
  struct CallTraits {
    bool streams = false;  // lasts as long as the job or the caller does
    bool submits = false;  // makes a job or an upload, or adds to an upload
  };
  // `call` is the name of one of the server's methods, or "OTHER": otherwise each name that a caller invents would
  // become a label. `reason`: the reason of the call's error; "" if it has none.
  void OnCallEnded(const std::string& call, absl::StatusCode code, const std::string& reason, absl::Duration duration,
                   const CallTraits& traits);

  // All metrics in Prometheus's text format 0.0.4.
  std::string Text(const ServerGauges& gauges) const;

 private:
  struct Families;
  const std::unique_ptr<Families> families_;
};

}  // namespace planish
