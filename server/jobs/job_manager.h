// The jobs of a server, as callers, operators and workers use them. The jobs themselves are in the store; this class
// combines the parts that accept, run, show and drop them.
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

// Thread-safe. All functions except SetLimits() and Limits() may wait for the store. Errors carry an ErrorInfo
// (core/base/error.h); unknown names are NOT_FOUND with JOB_NOT_FOUND; jobs that the caller may not see get exactly the
// same answer.
class JobManager {
 public:
  // Continues with the jobs that an earlier process left. If no other process uses `store`, jobs that were running are
  // queued again. INTERNAL, STORAGE_FULL if `store` cannot be read. Both stores must outlive the manager.
  static absl::StatusOr<std::unique_ptr<JobManager>> Open(JobManagerOptions options, JobStore* store,
                                                          BlobCatalog* blobs);

  // ---- for callers

  // Queues a job, or finds the job that has the same request id. An abandoned job frees its request id, so that a retry
  // after a lost connection makes a new job. A job that has the mesh and options of another job of the same tenant
  // shares that job's work or result, unless Scheduling.fresh is set. Request ids are unique within a tenant. Errors of
  // ValidateJobRequest and of the estimator; ALREADY_EXISTS with REQUEST_ID_REUSED; RESOURCE_EXHAUSTED with QUEUE_FULL,
  // STORAGE_FULL, both with a retry delay, MESH_TOO_LARGE and MEMORY_LIMIT; UNAVAILABLE with DRAINING and a retry
  // delay.
  absl::StatusOr<AcceptedJob> Create(const Caller& caller, JobRequest request);
  // Create() for each request, in this order. The accepted jobs are committed together.
  std::vector<absl::StatusOr<AcceptedJob>> CreateAll(const Caller& caller, std::vector<JobRequest> requests);

  // The job. `may_follow`: also allowed if the caller has only the right to submit, and the same credentials created
  // the job.
  absl::StatusOr<v1::Job> Get(const Caller& caller, const std::string& name, bool may_follow = false) const;

  // A page of jobs, newest first, with reports if the view is FULL. Callers get the jobs of their own tenant; a caller
  // with the right all-jobs gets those of the tenant it asks for, or of all tenants. INVALID_ARGUMENT with
  // REQUEST_INVALID.
  absl::StatusOr<JobPage> List(const Caller& caller, const v1::ListJobsRequest& request) const;

  // The job's events and, after the last one, its UV. Both stay valid as long as the caller holds them. `attach`: the
  // job belongs to this caller as well. With `include_uv`, NOT_FOUND with RESULT_EXPIRED if the UV are gone. A caller
  // with only the right to submit can watch, stop and cancel jobs that the same credentials created.
  absl::StatusOr<WatchedJob> Watch(const Caller& caller, const std::string& name, bool attach, bool include_uv);

  // The UV of a job. NOT_FOUND with RESULT_EXPIRED if they are gone, FAILED_PRECONDITION with JOB_NOT_FINISHED or
  // NO_RESULT. Allowed for the same callers as Watch().
  absl::StatusOr<JobResult> OpenResult(const Caller& caller, const std::string& name);

  // A queued job becomes CANCELLED at once. A running job becomes STOPPING, its worker is told to cancel, and any
  // result is discarded. A job that has ended does not change. UNAVAILABLE with DRAINING after Suspend(): the caller
  // can cancel it at the next process. RESOURCE_EXHAUSTED with STORAGE_FULL if the change cannot be written; then
  // nothing has changed. Both errors have a retry delay.
  absl::StatusOr<v1::Job> Cancel(const Caller& caller, const std::string& name);

  // A running job becomes STOPPING; its worker is told to stop once every job that shares the work was stopped. A
  // queued job is stopped when it runs. A job that has ended does not change. Errors as of Cancel().
  absl::StatusOr<v1::Job> Stop(const Caller& caller, const std::string& name);

  // Deletes a job that has ended, with its result. FAILED_PRECONDITION with JOB_NOT_FINISHED for other jobs.
  absl::Status Delete(const Caller& caller, const std::string& name);

  // Estimates a job without creating it. `mesh_bytes` and `size` as in planish.v1.EstimateJobRequest. INVALID_ARGUMENT
  // as Create(); other reasons for which Create() would refuse the job now are in the answer.
  absl::StatusOr<v1::JobEstimate> Estimate(const Caller& caller, const JobRequest& request, std::int64_t mesh_bytes,
                                           const v1::MeshSize& size) const;

  // How many jobs of the caller's tenant may wait.
  int QueueCapacity(const Caller& caller) const;

  // ---- for operators

  ManagerStats Stats() const;
  // Whether new jobs are refused.
  bool IsDraining() const { return draining_; }
  // Changes the limits. If a limit becomes lower, jobs beyond it stay queued until they run; results and records beyond
  // it are dropped by the next Tick().
  void SetLimits(const JobLimits& limits);
  JobLimits Limits() const { return context_.Limits(); }
  JobCapacity Capacity() const { return context_.Capacity(); }

  // ---- for UploadStore

  // Evicts old results so that the tenant may keep `bytes` more: the tenant's own, or, if it has less than an equal
  // part of the store, those of the tenant that has most. False if there is nothing left to evict. Do not call it while
  // holding a lock that JobManagerOptions::is_blob_used takes.
  bool MakeRoom(const std::string& tenant, std::int64_t bytes);
  // As JobRetention::CheckDisk().
  absl::Status CheckDisk(const std::string& tenant, std::int64_t bytes) { return retention_.CheckDisk(tenant, bytes); }

  // ---- for WorkerPool

  JobSource* source() { return &runner_; }

  // ---- for upkeep

  // Does what is due: renews leases, ends jobs that ran out of time or were left by their callers, takes over work of
  // dead servers, reads changes by other servers, and writes what could not be written before. Also does Tidy() if no
  // other process uses the store. Call it a few times a second, from one thread: with more servers at one store, each
  // looks for expired leases less often.
  void Tick();
  // Drops results and records whose retention has ended, and checks some blobs for whether anything still refers to
  // them. May take long if servers share the store. Call it about as often as Tick(), from another thread.
  void Tidy();

  // ---- for the server's shutdown, in this order. If other servers share the store, queued jobs are left to them: this
  // process claims no more work, counts as idle when it runs none, and CancelAll() and FailAll() have no effect.

  // Refuses new jobs from now on; queued jobs may still start. Calls `on_idle` once, when no job waits or runs, at the
  // latest in Tick(). Undrain() can take this back only if `on_idle` is null; otherwise the server is about to exit.
  void Drain(std::function<void()> on_idle);
  // Accepts jobs again. FAILED_PRECONDITION with SHUTTING_DOWN if the server is about to exit.
  absl::Status Undrain();
  // Either: cancels all unfinished jobs. No effect after Suspend(), since they then belong to the next process.
  void CancelAll();
  // Or: leaves all unfinished jobs to the next process. Their workers are closed, their watchers get UNAVAILABLE with
  // DRAINING, their attempts do not count, and nothing is written any more.
  void Suspend();
  // Or: ends all unfinished jobs as FAILED, for instance because no worker can be started.
  void FailAll(const absl::Status& error);
  // Closes the links of all workers that still have a job.
  void CloseLinks() { runner_.CloseLinks(); }
  // Makes JobSource::TakeNext() return.
  void StopWorkers() { runner_.Stop(); }

 private:
  JobManager(JobManagerOptions options, JobStore* store, BlobCatalog* blobs);

  absl::Status Recover();
  // Fails a job that cannot run any more: its mesh is lost, or the limits are lower than they were.
  absl::Status RecoverJob(const JobRecord& record);
  // The job, if the caller may see it; with `may_follow`, also if the caller may submit and the same credentials
  // created the job.
  absl::StatusOr<JobRecord> Find(const Caller& caller, const std::string& name, bool may_follow = false) const;
  // The job as callers see it: with its place in the queue and its progress.
  absl::StatusOr<v1::Job> Snapshot(const JobRecord& record) const;
  absl::StatusOr<v1::Job> Change(const Caller& caller, const std::string& name,
                                 const std::function<absl::StatusOr<JobChange>()>& verb);
  // Passes changes on to watchers, and to the workers of this process.
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
  std::atomic<bool> ending_ = false;  // drains for the shutdown, so Undrain() fails
  std::atomic<bool> suspended_ = false;

  absl::Time next_look_ = absl::InfinitePast();     // used by the thread of Tick() only
  absl::Time next_tidying_ = absl::InfinitePast();  // used by the thread of Tidy() only

  std::mutex mutex_;
  std::function<void()> on_idle_;  // guarded by mutex_
};

}  // namespace planish
