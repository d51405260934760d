// What a server's jobs are accepted and run by, and what may change of it.
#pragma once

#include <cstddef>
#include <cstdint>
#include <functional>
#include <mutex>
#include <string>
#include <utility>

#include "absl/status/status.h"
#include "absl/time/time.h"
#include "planish/v1/job.pb.h"
#include "server/access/tenant.h"
#include "server/blobs/blob_catalog.h"
#include "server/jobs/claim_pace.h"
#include "server/jobs/job_observer.h"
#include "server/jobs/job_request.h"
#include "server/jobs/steady_clock.h"
#include "server/store/ids.h"
#include "server/store/job_store.h"

namespace planish {

// What may change while the server runs.
struct JobLimits {
  int queue_capacity = 64;  // jobs of a tenant that may wait beside those that run, >= 0
  // Of each tenant: bytes of the UV of ended jobs, and how long these stay. The tenant's oldest go first; those of its
  // last job that ended always stay.
  std::int64_t retained_bytes = std::int64_t{1} << 30;
  absl::Duration retained_time = absl::InfiniteDuration();
  // Likewise of ended jobs themselves: their records, reports and events. A job that goes takes its UV with it.
  std::int64_t retained_record_bytes = std::int64_t{256} << 20;
  absl::Duration retained_record_time = absl::InfiniteDuration();
  absl::Duration reattach_grace = absl::Seconds(10);  // that a job outlives its last caller by
};

// Where jobs may run.
struct JobCapacity {
  int workers = 0;                                    // of all servers that share the store
  int servers = 1;                                    // that have workers
  std::int64_t memory_bytes = std::int64_t{1} << 60;  // that one job may take: the most that any of them has
  std::int64_t total_memory_bytes = memory_bytes;     // of all of them
};

struct JobManagerOptions {
  JobLimits limits;                                       // at first
  int workers = 1;                                        // pieces of work that run at a time
  int threads = 1;                                        // that a job may use
  int queue_total = 1024;                                 // jobs that may wait, of all tenants: QueueLimits
  std::int64_t max_queued_bytes = std::int64_t{1} << 30;  // of the meshes that wait, likewise
  // Of all servers that share the store; null: this one's `workers` and `memory_bytes`. Must be quick and thread-safe.
  std::function<JobCapacity()> capacity;
  TenantLimitsSource tenant_limits;  // null: the defaults for everybody
  std::int64_t max_mesh_bytes = std::int64_t{256} << 20;
  std::int64_t max_triangles = std::int64_t{1} << 40;  // as declared and as decoded
  std::int64_t memory_bytes = std::int64_t{1} << 60;   // that running jobs may reserve together
  std::size_t events_per_job = 256;                    // JobEventLog capacity
  absl::Duration obey_limit = absl::Seconds(5);        // from a cancellation to the worker's end
  int max_attempts = 3;                                // that a job may lose with their worker or server, >= 1
  absl::Duration retry_delay = absl::Seconds(1);       // advice with refusals where nothing better is known
  absl::Duration lease = absl::Seconds(15);            // of work that runs; renewed kRenewalsPerLease times as often
  // Of one job's progress to the store; longer where many workers share a store; 0: at once, always.
  absl::Duration report_interval = absl::Milliseconds(200);
  absl::Duration forecast_age = absl::Milliseconds(100);  // what is said of the queue may be as old
  OptionsValidator validate_options;                      // null: everything goes
  NeedsEstimator estimate;                                // null: jobs need nothing
  std::function<bool(const BlobId& id)> is_blob_used;     // by somebody else; null: nobody. Must not call back
  // Hears of every change of state that this process makes, after it was written, on any thread; of one job in order
  // unless several threads change it at the same moment. Must be quick and thread-safe.
  std::function<void(const v1::Job&)> on_transition;
  // Hears of verbs of the store that failed and of meshes that could not be read, likewise. They are tried again by
  // Tick().
  std::function<void(const absl::Status&)> on_store_error;
  JobObserver* observer = nullptr;                       // may be null; outlives the manager
  std::function<absl::Time()> steady_clock = SteadyNow;  // of how long work takes; all other times are the store's
  std::function<std::string()> new_id = RandomId;
};

// Where jobs are, what they are handled by, and who hears of it: common to the parts of a JobManager. Thread-safe.
class JobContext {
 public:
  // Both stores outlive the object.
  JobContext(JobManagerOptions manager_options, JobStore* job_store, BlobCatalog* blob_store)
      : options(std::move(manager_options)), store(*job_store), blobs(*blob_store), limits_(options.limits) {}

  JobLimits Limits() const {
    const std::lock_guard lock(mutex_);
    return limits_;
  }
  void SetLimits(const JobLimits& limits) {
    const std::lock_guard lock(mutex_);
    limits_ = limits;
  }

  // For each verb of the store.
  VerbContext Verb() const { return {Limits().retained_time, options.max_attempts}; }

  JobCapacity Capacity() const {
    return options.capacity != nullptr ? options.capacity()
                                       : JobCapacity{options.workers, 1, options.memory_bytes, options.memory_bytes};
  }

  // SharedPace() of this server; zero where nobody shares its store.
  absl::Duration Pace(double per_second, absl::Duration least) const {
    return store.is_shared() ? SharedPace(Capacity().servers, per_second, least) : absl::ZeroDuration();
  }

  void TellError(const absl::Status& status) const {
    if (options.on_store_error) options.on_store_error(status);
  }

  const JobManagerOptions options;  // but for `limits`
  JobStore& store;
  BlobCatalog& blobs;
  // Jobs may be due to be ended: EndOverdue(); and an attempt has ended. Set before the parts are used.
  std::function<void()> on_due, on_end;

 private:
  mutable std::mutex mutex_;
  JobLimits limits_;  // guarded by mutex_
};

}  // namespace planish
