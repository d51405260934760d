// All jobs of a server: what callers, operators and workers ask of them. The store has them; the parts that this class
// puts together accept them, run them, show them and drop them.
#pragma once

#include <atomic>
#include <cstdint>
#include <functional>
#include <memory>
#include <mutex>
#include <string>
#include <vector>

#include "absl/status/statusor.h"
#include "absl/time/time.h"
#include "planish/v1/planish.pb.h"
#include "server/access/caller.h"
#include "server/jobs/event_log.h"
#include "server/jobs/job_admission.h"
#include "server/jobs/job_callers.h"
#include "server/jobs/job_feed.h"
#include "server/jobs/job_options.h"
#include "server/jobs/job_retention.h"
#include "server/jobs/job_runner.h"
#include "server/jobs/manager_stats.h"

namespace planish {

struct WatchedJob {
  std::shared_ptr<const JobEventLog> events;
  JobAttachment attachment;  // empty unless asked for
};

// The UV of a job that SUCCEEDED.
struct JobResult {
  v1::UvDescription description;
  StoredBlobPtr uv;
};

struct JobPage {
  std::vector<v1::Job> jobs;
  std::string next_page_token;
};

// Thread-safe. All functions but SetLimits() and Limits() may ask the store, and wait for it. Errors carry an ErrorInfo
// (core/base/error.h); unknown names are NOT_FOUND with JOB_NOT_FOUND, and so are jobs that the caller may not see,
// word for word.
class JobManager {
 public:
  // Goes on where the process before left off: where nobody else uses `store`, jobs that ran are queued again.
  // INTERNAL, STORAGE_FULL if `store` cannot be read. Both stores must outlive the manager.
  static absl::StatusOr<std::unique_ptr<JobManager>> Open(JobManagerOptions options, JobStore* store,
                                                          BlobCatalog* blobs);

  // ---- for callers

  // Queues a job, or finds the one that has the same request id. A job that was abandoned by its caller gives its
  // request id free, so that a retry after a lost connection starts anew. A job whose mesh and options are those of
  // another one of the same tenant shares its work or its result, unless Scheduling.fresh. Request ids are unique
  // within a tenant.
  // Errors of ValidateJobRequest and of the estimator; ALREADY_EXISTS with REQUEST_ID_REUSED; RESOURCE_EXHAUSTED with
  // QUEUE_FULL, STORAGE_FULL, both with a retry delay, MESH_TOO_LARGE and MEMORY_LIMIT; UNAVAILABLE with DRAINING and a
  // retry delay.
  absl::StatusOr<AcceptedJob> Create(const Caller& caller, JobRequest request);
  // The same for each, in this order; those that are accepted are committed together.
  std::vector<absl::StatusOr<AcceptedJob>> CreateAll(const Caller& caller, std::vector<JobRequest> requests);

  // `may_follow`: also if the caller may only submit, and the same credentials created the job.
  absl::StatusOr<v1::Job> Get(const Caller& caller, const std::string& name, bool may_follow = false) const;

  // Newest first, with reports if the view is FULL; the caller's own tenant's, or with all-jobs those of the tenant
  // asked for or of all. INVALID_ARGUMENT with REQUEST_INVALID.
  absl::StatusOr<JobPage> List(const Caller& caller, const v1::ListJobsRequest& request) const;

  // The job's events and, at their end, its UV. They stay as long as the caller holds them. `attach`: the job belongs
  // to this caller as well. With `include_uv`, NOT_FOUND with RESULT_EXPIRED if the UV are gone. Whoever may only
  // submit can watch, stop and cancel what the same credentials created.
  absl::StatusOr<WatchedJob> Watch(const Caller& caller, const std::string& name, bool attach, bool include_uv);

  // NOT_FOUND with RESULT_EXPIRED if the UV are gone, FAILED_PRECONDITION with JOB_NOT_FINISHED or NO_RESULT. Who may
  // ask: as for Watch().
  absl::StatusOr<JobResult> OpenResult(const Caller& caller, const std::string& name);

  // A queued job is CANCELLED at once. A running one is STOPPING, its worker is told, and whatever it delivers is
  // discarded. One that ended stays as it is. UNAVAILABLE with DRAINING after Suspend(): the next process will do it.
  // RESOURCE_EXHAUSTED with STORAGE_FULL if it cannot be written: then nothing has changed. Both with a retry delay.
  absl::StatusOr<v1::Job> Cancel(const Caller& caller, const std::string& name);

  // A running job is STOPPING and its worker is told, if every job that shares the work was stopped; a queued one will
  // be. One that ended stays as it is. Errors as of Cancel().
  absl::StatusOr<v1::Job> Stop(const Caller& caller, const std::string& name);

  // FAILED_PRECONDITION with JOB_NOT_FINISHED.
  absl::Status Delete(const Caller& caller, const std::string& name);

  // `mesh_bytes` and `size` as in planish.v1.EstimateJobRequest. INVALID_ARGUMENT as Create(); what else Create() would
  // refuse now is in the answer.
  absl::StatusOr<v1::JobEstimate> Estimate(const Caller& caller, const JobRequest& request, std::int64_t mesh_bytes,
                                           const v1::MeshSize& size) const;

  // Jobs of the caller's tenant that may wait.
  int QueueCapacity(const Caller& caller) const;

  // ---- for operators

  ManagerStats Stats() const;
  // Whether new jobs are refused.
  bool IsDraining() const { return draining_; }
  // What waits or is kept beyond a lower limit stays until its turn comes, or goes with the next Tick().
  void SetLimits(const JobLimits& limits);
  JobLimits Limits() const { return context_.Limits(); }
  JobCapacity Capacity() const { return context_.Capacity(); }

  // ---- for UploadStore

  // Gives up old results so that the tenant may keep `bytes` more: its own, or where it has little those of the tenant
  // that has most. False if there is nothing left to give up. Not while holding a lock that `is_blob_used` takes.
  bool MakeRoom(const std::string& tenant, std::int64_t bytes);

  // ---- for WorkerPool

  JobSource* source() { return &runner_; }

  // ---- for upkeep

  // Does what is due by now: renews leases, ends jobs that ran out of time or were left by their callers, takes work
  // from servers that are gone, reads what other servers did, writes what could not be written. Where nobody else uses
  // the store, Tidy() as well. Call it a few times a second, from one thread: the more servers share the store, the
  // less often each of them looks for the jobs of others.
  void Tick();
  // Drops what was kept long enough, and looks at some blobs whether anybody needs them, likewise. May take long where
  // servers share the store. Call it about as often, from another thread.
  void Tidy();

  // ---- for the server's shutdown, in this order. Where others use the store, they have the jobs that wait: this
  // process takes no more of them, is idle when it runs none, and CancelAll() and FailAll() have no effect.

  // Refuses new jobs from now on; those that wait may still start. Calls `on_idle` once, when no job waits or runs, in
  // Tick() at the latest. With a null one Undrain() takes it back; with any other the server is about to end.
  void Drain(std::function<void()> on_idle);
  // Takes jobs again. FAILED_PRECONDITION with SHUTTING_DOWN if the server is about to end.
  absl::Status Undrain();
  // Either: cancels every job that has not ended; after Suspend() none, the next process has them.
  void CancelAll();
  // Or: leaves every job that has not ended to the next process. Their workers are given up, their watchers are told
  // that the server is UNAVAILABLE with DRAINING, their attempts do not count, and nothing is written any more.
  void Suspend();
  // Or: ends every job that has not ended as FAILED, for instance because no worker can be started.
  void FailAll(const absl::Status& error);
  // Gives up all workers that are still at it.
  void CloseLinks() { runner_.CloseLinks(); }
  // Makes JobSource::TakeNext() return.
  void StopWorkers() { runner_.Stop(); }

 private:
  JobManager(JobManagerOptions options, JobStore* store, BlobCatalog* blobs);

  absl::Status Recover();
  // Fails a job that cannot run any more: its mesh is lost, or the limits are lower than they were.
  absl::Status RecoverJob(const JobRecord& record);
  // If the caller may see it, or `may_follow`, may submit, and the same credentials created it.
  absl::StatusOr<JobRecord> Find(const Caller& caller, const std::string& name, bool may_follow = false) const;
  // With its place in the queue and its progress.
  absl::StatusOr<v1::Job> Snapshot(const JobRecord& record) const;
  absl::StatusOr<v1::Job> Change(const Caller& caller, const std::string& name,
                                 const std::function<absl::StatusOr<JobChange>()>& verb);
  // Tells of what verbs made of jobs, and has workers obey.
  void Adopt(const std::vector<JobChange>& changes);
  void EndOverdue();
  void Reap();
  bool IsIdle() const;
  void CheckIdle();
  absl::Status Draining() const;

  JobContext context_;
  JobFeed feed_;
  JobCallers callers_;
  JobRetention retention_;
  JobRunner runner_;
  JobAdmission admission_;

  std::atomic<bool> draining_ = false;
  std::atomic<bool> ending_ = false;  // never to be taken back
  std::atomic<bool> suspended_ = false;

  absl::Time next_look_ = absl::InfinitePast();     // of Tick(), whose thread alone uses it
  absl::Time next_tidying_ = absl::InfinitePast();  // likewise, of Tidy()

  std::mutex mutex_;
  std::function<void()> on_idle_;  // guarded by mutex_
};

}  // namespace planish
