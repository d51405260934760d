// The settings by which a server accepts and runs jobs.
#pragma once

#include <algorithm>
#include <cstddef>
#include <cstdint>
#include <functional>
#include <mutex>
#include <string>
#include <utility>

#include "absl/status/status.h"
#include "absl/status/statusor.h"
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

// Settings that may change while the server runs.
struct JobLimits {
  int queue_capacity = 64;  // waiting jobs of a tenant, >= 0; running jobs do not count
  // Retention of the UV of ended jobs: bytes for each tenant, and time. A tenant's oldest UV are dropped first; the UV
  // of its last ended job are always kept.
  std::int64_t retained_bytes = std::int64_t{1} << 30;
  absl::Duration retained_time = absl::InfiniteDuration();
  // Retention of the ended jobs themselves (records, reports and events), in the same way. A dropped job's UV are
  // dropped too.
  std::int64_t retained_record_bytes = std::int64_t{256} << 20;
  absl::Duration retained_record_time = absl::InfiniteDuration();
  absl::Duration reattach_grace = absl::Seconds(10);  // how long a job waits for a caller after its last one left
};

// Where jobs may run.
struct JobCapacity {
  int workers = 0;                                    // of all servers that share the store
  int servers = 1;                                    // servers that have workers
  std::int64_t memory_bytes = std::int64_t{1} << 60;  // largest memory of any of the servers: the bound for one job
  std::int64_t total_memory_bytes = memory_bytes;     // memory of all servers together
};

struct JobManagerOptions {
  JobLimits limits;  // initial values; JobManager::SetLimits() changes them
  int workers = 1;   // pieces of work that run concurrently
  int threads = 1;   // most threads of a job
  // How many of `workers` are reserved for work that is expected to take at most `short_time`.
  int short_workers = 0;
  absl::Duration short_time = absl::Seconds(10);
  int queue_total = 1024;                                 // waiting jobs of all tenants: QueueLimits
  std::int64_t max_queued_bytes = std::int64_t{1} << 30;  // meshes of waiting jobs of all tenants
  // Capacity of all servers that share the store; null: this server's `workers` and `memory_bytes`. Must be quick and
  // thread-safe.
  std::function<JobCapacity()> capacity;
  TenantLimitsSource tenant_limits;  // null: the default limits for every tenant
  std::int64_t max_mesh_bytes = std::int64_t{256} << 20;
  std::int64_t max_triangles = std::int64_t{1} << 40;  // declared or decoded triangles of a mesh
  std::int64_t memory_bytes = std::int64_t{1} << 60;   // reserved by all running jobs together
  std::size_t events_per_job = 256;                    // JobEventLog capacity
  absl::Duration obey_limit = absl::Seconds(5);        // longest time from a cancellation to the worker's end
  int max_attempts = 3;                                // >= 1; a job fails after so many lost workers or servers
  absl::Duration retry_delay = absl::Seconds(1);       // in refusals for which no better delay is known
  // Duration of the lease of running work, within which it is renewed kRenewalsPerLease times.
  absl::Duration lease = absl::Seconds(15);
  // Interval at which one job's progress is written; longer if many workers share the store; 0: every report at once.
  absl::Duration report_interval = absl::Milliseconds(200);
  absl::Duration forecast_age = absl::Milliseconds(100);  // largest age of the data behind queue estimates
  OptionsValidator validate_options;                      // null: all options are valid
  NeedsEstimator estimate;                                // null: jobs reserve nothing
  std::function<bool(const BlobId& id)> is_blob_used;     // by uploads, for instance; null: never. Must not call back
  // disk_shortage: how many bytes must be freed before `more` bytes can be stored and the results of accepted jobs
  // still have room (0 or less: none), or why nothing new can be stored at all. has_room_for_results: if false, no work
  // starts. Null: disk space is not limited.
  std::function<absl::StatusOr<std::int64_t>(std::int64_t more)> disk_shortage;
  std::function<bool()> has_room_for_results;
  // Called after every change of state that this process has written, on any thread. Calls for one job are in order,
  // unless several threads change it at the same moment. Must be quick and thread-safe.
  std::function<void(const v1::Job&)> on_transition;
  // Called after a store operation failed or a mesh could not be read, on any thread. Tick() tries again.
  std::function<void(const absl::Status&)> on_store_error;
  JobObserver* observer = nullptr;  // may be null; outlives the manager
  // Measures how long work takes; all other times are the store's.
  std::function<absl::Time()> steady_clock = SteadyNow;
  std::function<std::string()> new_id = RandomId;
};

// What the parts of a JobManager share: options, stores and callbacks. Thread-safe.
class JobContext {
 public:
  // `job_store` and `blob_store` outlive the object.
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

  // The context that each verb of the store is called with.
  VerbContext Verb() const { return {Limits().retained_time, options.max_attempts}; }

  JobCapacity Capacity() const {
    return options.capacity != nullptr ? options.capacity()
                                       : JobCapacity{options.workers, 1, options.memory_bytes, options.memory_bytes};
  }

  // SharedPace() of this server; zero if no other server shares the store.
  absl::Duration Pace(double per_second, absl::Duration least) const {
    return store.is_shared() ? SharedPace(Capacity().servers, per_second, least) : absl::ZeroDuration();
  }

  // Memory that a job of this tenant may reserve.
  std::int64_t MostMemory(const std::string& tenant) const {
    const std::int64_t own = options.tenant_limits == nullptr ? -1 : options.tenant_limits(tenant).memory_bytes;
    const std::int64_t most = Capacity().memory_bytes;
    return own < 0 ? most : std::min(own, most);
  }

  void TellError(const absl::Status& status) const {
    if (options.on_store_error) options.on_store_error(status);
  }

  const JobManagerOptions options;  // `limits` is only the initial value
  JobStore& store;
  BlobCatalog& blobs;
  // on_due: some job may be overdue (JobManager::EndOverdue()). on_end: an attempt has ended. Both are set before the
  // parts are used.
  std::function<void()> on_due, on_end;

 private:
  mutable std::mutex mutex_;
  JobLimits limits_;  // guarded by mutex_
};

}  // namespace planish
