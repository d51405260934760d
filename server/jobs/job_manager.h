// All jobs of a server: accepts them, hands them to workers, remembers how they ended.
#pragma once

#include <condition_variable>
#include <cstddef>
#include <cstdint>
#include <functional>
#include <list>
#include <map>
#include <memory>
#include <mutex>
#include <optional>
#include <set>
#include <string>
#include <unordered_map>
#include <utility>
#include <vector>

#include "absl/status/statusor.h"
#include "absl/time/clock.h"
#include "absl/time/time.h"
#include "planish/v1/planish.pb.h"
#include "planish/worker/v1/worker.pb.h"
#include "server/access/caller.h"
#include "server/access/tenant.h"
#include "server/blobs/blob_catalog.h"
#include "server/jobs/event_log.h"
#include "server/jobs/job_observer.h"
#include "server/jobs/job_queue.h"
#include "server/jobs/job_request.h"
#include "server/jobs/job_source.h"
#include "server/jobs/manager_stats.h"
#include "server/jobs/work.h"
#include "server/link/worker_link.h"
#include "server/store/ids.h"
#include "server/store/job_store.h"
#include "server/store/lifecycle.h"

namespace planish {

// The time of a clock that nobody sets, from an arbitrary beginning.
absl::Time SteadyNow();

// What may change while the server runs.
struct JobLimits {
  int queue_capacity = 64;  // jobs of a tenant that may wait beside those that run, >= 0
  // Of each tenant: ended jobs kept, and bytes of their UV. How long these stay. The tenant's oldest go first; its last
  // one that ended always stays.
  int retained_jobs = 256;
  std::int64_t retained_bytes = std::int64_t{1} << 30;
  absl::Duration retained_time = absl::InfiniteDuration();
  absl::Duration reattach_grace = absl::Seconds(10);  // that a job outlives its last caller by
};

struct JobManagerOptions {
  JobLimits limits;                                       // at first
  int workers = 1;                                        // pieces of work that run at a time
  int threads = 1;                                        // that a job may use
  int queue_total = 1024;                                 // jobs that may wait, of all tenants: JobQueue
  std::int64_t max_queued_bytes = std::int64_t{1} << 30;  // of the meshes that wait, likewise
  TenantLimitsSource tenant_limits;                       // null: the defaults for everybody
  std::int64_t max_mesh_bytes = std::int64_t{256} << 20;
  std::int64_t max_triangles = std::int64_t{1} << 40;  // as declared and as decoded
  std::int64_t memory_bytes = std::int64_t{1} << 60;   // that running jobs may reserve together
  std::size_t events_per_job = 256;                    // JobEventLog capacity
  absl::Duration obey_limit = absl::Seconds(5);        // from a cancellation to the worker's end
  int max_attempts = 3;                                // that a job may lose with their worker or server, >= 1
  absl::Duration retry_delay = absl::Seconds(1);       // advice with refusals where nothing better is known
  OptionsValidator validate_options;                   // null: everything goes
  NeedsEstimator estimate;                             // null: jobs need nothing
  std::function<bool(const BlobId& id)> is_blob_used;  // by somebody else; null: nobody. Must not call back
  // Hears of every change of state, in order, under the manager's lock, of an end after it was written: must be quick
  // and must not call back.
  std::function<void(const v1::Job&)> on_transition;
  // Hears of verbs of the store that failed and of meshes that could not be read, likewise. They are tried again by
  // Tick().
  std::function<void(const absl::Status&)> on_store_error;
  JobObserver* observer = nullptr;  // may be null; outlives the manager
  std::function<absl::Time()> clock = absl::Now;
  std::function<absl::Time()> steady_clock = SteadyNow;  // of how long work takes: nobody sets it
  std::function<std::string()> new_id = RandomId;
};

class JobManager;

// One caller that a job belongs to. When the last one goes and nobody detached the job, it is cancelled unless another
// one comes within the grace. Must not outlive the manager. Not thread-safe.
class JobAttachment {
 public:
  JobAttachment() = default;
  JobAttachment(JobManager* manager, std::string name) : manager_(manager), name_(std::move(name)) {}
  JobAttachment(JobAttachment&& other) noexcept { *this = std::move(other); }
  JobAttachment& operator=(JobAttachment&& other) noexcept;
  ~JobAttachment() { Release(); }

  // Whether there is nothing to release.
  bool empty() const { return manager_ == nullptr; }

  // `for_good`: the caller will not come back, its deadline passed; no grace.
  void Release(bool for_good = false);

 private:
  JobManager* manager_ = nullptr;
  std::string name_;
};

struct WatchedJob {
  std::shared_ptr<const JobEventLog> events;
  JobAttachment attachment;  // empty unless asked for
};

struct AcceptedJob {
  v1::Job job;
  std::shared_ptr<const JobEventLog> events;
  JobAttachment attachment;  // empty unless JobRequest::attached
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

// Thread-safe. Errors carry an ErrorInfo (core/base/error.h); unknown names are NOT_FOUND with JOB_NOT_FOUND, and so
// are jobs that the caller may not see, word for word.
class JobManager : public JobSource {
 public:
  // Goes on where the process before left off: jobs that ran are queued again. INTERNAL, STORAGE_FULL if `store` cannot
  // be read. Both stores must outlive the manager and belong to it alone but for blobs that others hold.
  static absl::StatusOr<std::unique_ptr<JobManager>> Open(JobManagerOptions options, JobStore* store, BlobCatalog* blobs);

  // ---- for callers

  // Queues a job, or finds the one that has the same request id. A job that was abandoned by its caller gives its
  // request id free, so that a retry after a lost connection starts anew. A job whose mesh and options are those of
  // another one of the same tenant shares its work or its result, unless Scheduling.fresh. Request ids are unique
  // within a tenant.
  // Errors of ValidateJobRequest and of the estimator; ALREADY_EXISTS with REQUEST_ID_REUSED; RESOURCE_EXHAUSTED with
  // QUEUE_FULL, STORAGE_FULL, both with a retry delay, MESH_TOO_LARGE and MEMORY_LIMIT; UNAVAILABLE with DRAINING and a
  // retry delay.
  absl::StatusOr<AcceptedJob> Create(const Caller& caller, JobRequest request);

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
  bool IsDraining() const;

  // ---- for UploadStore

  // Gives up old results so that the tenant may keep `bytes` more: its own, or where it has little those of the tenant
  // that has most. False if there is nothing left to give up. Not while holding a lock that `is_blob_used` takes.
  bool MakeRoom(const std::string& tenant, std::int64_t bytes);

  // ---- for WorkerPool

  // Waits for work and memory for it, and makes its jobs RUNNING, which is durable before it returns: an attempt that
  // ends the machine counts. Named after one of them; attempts count 1, 2, ... for each piece of work. Where a mesh
  // cannot be read or the start not be written for now, no work starts before Tick() finds the retry delay over. Over
  // after StopWorkers().
  Turn TakeNext(absl::Duration patience, JobAssignment* assignment) override;
  void SetLink(const std::string& name, int attempt, std::shared_ptr<WorkerLink> link) override;
  absl::Time ObeyBy(const std::string& name, int attempt) override;
  void ReportProgress(const std::string& name, int attempt, v1::Progress progress) override;
  // Ends the jobs as the worker says.
  void ReportResult(const std::string& name, int attempt, worker::v1::WorkResult result, BlobPtr uv) override;
  // Queues the work again, or ends its jobs as FAILED if it cost too many workers.
  void ReportLost(const std::string& name, int attempt, WorkerLoss loss) override;

  // ---- for upkeep

  // Does what is due by now: ends jobs that ran out of time or were left by their callers, drops what was kept long
  // enough, writes what could not be written, looks at some blobs whether anybody needs them. Call it a few times a
  // second.
  void Tick();

  // ---- for the server's operator (job_manager_limits.cc)

  // What waits or is kept beyond a lower limit stays until its turn comes, or goes with the next Tick().
  void SetLimits(const JobLimits& limits);
  JobLimits Limits() const;

  // ---- for the server's shutdown, in this order

  // Refuses new jobs from now on; those that wait may still start. Calls `on_idle` once, when no job waits or runs.
  // With a null one Undrain() takes it back; with any other the server is about to end.
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
  void CloseLinks();
  // Makes TakeNext() return.
  void StopWorkers();

 private:
  friend class JobAttachment;

  // Sequence numbers that are reserved at a time: most jobs need one block, that is one write, only.
  static constexpr std::int64_t kSequenceBlock = 1024;

  // What a job that has not ended has beside its record while this process lives.
  struct Live {
    JobRecord record;  // as the store has it
    std::shared_ptr<JobEventLog> events;
    int attachments = 0;
    absl::Time orphaned = absl::InfiniteFuture();  // when the last caller went
    std::vector<absl::Time> alarms;                // of its entries in alarms_

    const std::string& work() const { return record.work(); }
  };

  // How an attempt ended. Its jobs are RUNNING for everybody until that is written.
  struct Ending {
    Work work;  // as it was
    AttemptOutcome outcome;
    StoredBlobPtr uv;
    WorkerLoss loss;  // with AttemptOutcome::loss
    absl::Duration duration;
  };

  struct Calls {
    std::int64_t accepted = 0, refused = 0, shared = 0;
  };

  // Declared before the lock so that it acts after the lock is released.
  struct Wakeups {
    std::vector<std::shared_ptr<JobEventLog>> logs;
    std::function<void()> on_idle;
    ~Wakeups();
  };

  JobManager(JobManagerOptions options, JobStore* store, BlobCatalog* blobs);
  absl::Status Recover();
  absl::Status RecoverJob(JobRecord record, Wakeups* wakeups);
  // For each verb of the store.
  VerbContext Context() const;
  // `array_vertices` as in JobRequest; `size` counts where the mesh does not say.
  absl::StatusOr<JobNeeds> NeedsOf(std::string_view mesh, std::optional<std::int64_t> array_vertices,
                                   std::int64_t mesh_bytes, v1::MeshSize size, const v1::UnwrapOptions& options) const;

  void Abandon(const std::string& name, bool for_good);

  // These two take mutex_ themselves, if at all.
  // Keeps the blob, at the price of old results if need be: the tenant's own, or where it has little those of the
  // tenant that has most.
  absl::StatusOr<StoredBlobPtr> PutBlob(const std::string& tenant, std::string_view bytes, const std::string& sha256);
  // Checks that `uv` are those described, and puts them into the store.
  absl::StatusOr<StoredBlobPtr> KeepUv(const std::string& tenant, const v1::UvDescription& description,
                                       const BlobPtr& uv);
  // Opens the UV that a call is about to need under the lock, so that they need not be verified there. Null: none.
  StoredBlobPtr OpenKeptResult(const std::string& work_key);
  StoredBlobPtr OpenUvOf(const Caller& caller, const std::string& name);
  absl::StatusOr<AcceptedJob> Accept(const Caller& caller, JobRequest request);

  // NOT_FOUND or DATA_LOSS if one of them is lost.
  absl::StatusOr<std::vector<BlobPtr>> LoadBlobs(const std::string& tenant, const std::vector<std::string>& digests);

  static absl::Status MeshLost(const absl::Status& why);

  // All of these require mutex_.

  // ---- callers (job_manager.cc)
  v1::Job Snapshot(const JobRecord& record) const;
  absl::StatusOr<JobRecord> FindRecord(const std::string& name) const;
  // If the caller may see it, or `may_follow`, may submit, and the same credentials created it.
  absl::StatusOr<JobRecord> FindRecord(const Caller& caller, const std::string& name, bool may_follow = false) const;
  absl::StatusOr<AcceptedJob> Answer(Live& live, bool attached);
  // The job that has the request id, if there is one.
  absl::StatusOr<std::optional<AcceptedJob>> FindKnown(const Caller& caller, const JobRequest& request,
                                                       const std::string& work_key);
  absl::Status CheckRoom(const std::string& tenant, std::int64_t mesh_bytes) const;
  // Both checks of a request that is about to become a job: FindKnown(), then room unless it can share.
  absl::StatusOr<std::optional<AcceptedJob>> Screen(const Caller& caller, const JobRequest& request,
                                                    const std::string& work_key);
  JobRecord NewRecord(const Caller& caller, const JobRequest& request);
  absl::StatusOr<std::shared_ptr<const JobEventLog>> LogOfEnded(const JobRecord& record);

  // ---- work (job_manager_work.cc)
  struct KeptResult {
    JobRecord record;
    StoredBlobPtr uv;
  };
  // The newest result of this work that is still kept.
  std::optional<KeptResult> FindResult(const std::string& work_key) const;
  Work* FindShared(const std::string& work_key);
  // Puts the job to its work, which is queued if nobody has it; a new one is made where there is none.
  void JoinWork(Live& live, const JobNeeds& needs);
  void Enqueue(Work& work);
  void LeaveWork(Live& live);
  // Takes the work off the books.
  Work Remove(std::string name);
  Work* FindAttempt(const std::string& name, int attempt);
  // The work that a worker should have next; null: none, or it has to wait.
  Work* NextWork();
  JobAssignment Assign(const Work& work, std::vector<BlobPtr> blobs) const;
  // Claims the work. After an error nothing has changed.
  absl::Status StartWork(Work& work, Wakeups* wakeups);
  void StartBudget(Live& live);
  // No work starts for a while, because of `why`.
  void Postpone(const absl::Status& why);
  // Writes how an attempt ended, and tells everybody; false if it could not be written, which Tick() tries again.
  bool Finish(Ending ending, Wakeups* wakeups);
  // Queues again what a lost worker leaves.
  void Requeue(const Work& work, std::vector<std::string> jobs);
  void SendStopIfAllWant(Work& work);

  // ---- ends (job_manager_upkeep.cc)
  // Sets the alarms of a job's own limits.
  void StartClocks(Live& live);
  void SetAlarm(Live& live, absl::Time time);
  void CheckClocks(const std::string& name, absl::Time now, Wakeups* wakeups);
  // These three do as the verbs of the store with the same names, tell the worker, and everybody of what came of it.
  // After an error, which has a retry delay, nothing has changed; otherwise `live` may be gone.
  absl::Status EndEarly(Live& live, EarlyEnd why, bool forget, Wakeups* wakeups);
  absl::Status RequestStop(Live& live, Wakeups* wakeups);
  absl::Status Fail(Live& live, const absl::Status& error, bool forget, Wakeups* wakeups);
  // Takes over what a verb made of the job, and tells everybody. `uv` are those of a job that SUCCEEDED. `live` is gone
  // if the job ended.
  void Adopt(Live& live, JobChange change, StoredBlobPtr uv, Wakeups* wakeups);
  void Conclude(Live& live, v1::JobEvent event, StoredBlobPtr uv, Wakeups* wakeups);
  // Small blobs of the tenant that wait to be committed with a record.
  std::vector<BlobRow> Pending(const std::string& tenant, const std::vector<std::string>& digests) const;
  void Committed(const std::vector<BlobRow>& blobs);
  // UNAVAILABLE after Suspend(), RESOURCE_EXHAUSTED if the attempt at the job's work ended and that is not written.
  absl::Status CheckOpen(const Live& live) const;
  // Says so, and what to do about it.
  absl::Status NotWritten(const absl::Status& why) const;
  void FinishWhatIsLeft(Wakeups* wakeups);
  void Retain();
  // What is more than the tenant may keep.
  void RetainOf(const std::string& tenant);
  bool Expire(const JobRecord& record);
  absl::Status Forget(const JobRecord& record);
  void ReleaseBlobs(const JobRecord& record);
  bool IsBlobUsed(const BlobId& id) const;
  // Looks at those that may have become unused, and at a few of those that a sweep has yet to look at.
  void CollectBlobs();
  void CheckIdle(Wakeups* wakeups);

  // Constant after construction, but for what SetLimits() changes: that is guarded by mutex_.
  JobManagerOptions options_;
  const std::string instance_;  // owner of leases
  BlobCatalog* const blobs_;

  mutable std::mutex mutex_;
  std::condition_variable work_or_stop_;
  // Guarded by mutex_.
  JobStore* const store_;
  std::unordered_map<std::string, Live> live_;  // jobs that have not ended
  std::unordered_map<std::string, Work> works_;
  std::unordered_map<std::string, std::string> shared_;  // from work key to the name of work that others may join
  JobQueue queue_;                                       // of work
  std::int64_t reserved_memory_ = 0;                     // by work that workers have
  int alone_running_ = 0;                                // of work that runs, Work::alone
  absl::Time next_start_ = absl::InfinitePast();         // by the steady clock: no work starts before
  // When to CheckClocks() of which job that has not ended.
  std::set<std::pair<absl::Time, std::string>> alarms_;
  // Logs of the jobs that ended last, the newest first: their watchers may come a moment late and want the progress.
  std::list<std::pair<std::string, std::shared_ptr<JobEventLog>>> ended_logs_;
  std::map<std::string, Ending> unended_;  // by work: attempts that ended, which could not be written yet
  std::set<BlobId> unused_blobs_;          // may be unused: to be looked at
  std::vector<BlobId> sweep_;              // likewise, a few at a time
  JobTotals totals_;
  std::map<std::string, std::string> last_ended_;  // job of each tenant
  std::map<std::string, Calls> calls_;             // of each tenant, since the start
  std::map<std::string, std::int64_t> refused_by_reason_;
  absl::Time next_sweep_ = absl::InfinitePast();   // over all blobs
  absl::Time next_expiry_ = absl::InfinitePast();  // no result is too old before
  double seconds_factor_ = 1;                      // what work takes over what the estimate says
  bool draining_ = false;
  bool ending_ = false;  // never to be taken back
  bool suspended_ = false;
  bool stopped_ = false;
  std::function<void()> on_idle_;
};

}  // namespace planish
