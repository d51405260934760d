// All jobs of a server: accepts them, hands them to workers, remembers how they ended.
#pragma once

#include <condition_variable>
#include <cstddef>
#include <cstdint>
#include <deque>
#include <functional>
#include <memory>
#include <mutex>
#include <optional>
#include <string>
#include <unordered_map>
#include <utility>
#include <vector>

#include "absl/status/statusor.h"
#include "absl/time/clock.h"
#include "absl/time/time.h"
#include "planish/v1/job.pb.h"
#include "planish/worker/v1/worker.pb.h"
#include "server/jobs/event_log.h"
#include "server/jobs/ids.h"
#include "server/jobs/job_queue.h"
#include "server/jobs/job_request.h"
#include "server/jobs/job_store.h"
#include "server/jobs/lifecycle.h"
#include "server/link/worker_link.h"

namespace planish {

struct JobManagerOptions {
  int workers = 1;                                        // jobs that run at a time
  int threads = 1;                                        // that a job may use
  int queue_capacity = 64;                                // jobs that may wait beside them, >= 0
  std::int64_t max_queued_bytes = std::int64_t{1} << 30;  // of the meshes that wait
  std::int64_t max_mesh_bytes = std::int64_t{256} << 20;
  // Ended jobs kept, and bytes of their UV. The oldest go first; the last one that ended always stays.
  int retained_jobs = 256;
  std::int64_t retained_bytes = std::int64_t{1} << 30;
  std::size_t events_per_job = 256;               // JobEventLog capacity
  absl::Duration retry_delay = absl::Seconds(1);  // advice with QUEUE_FULL and DRAINING
  OptionsValidator validate_options;              // null: everything goes
  // Hears of every change of state, in order, under the manager's lock: must be quick and must not call back.
  std::function<void(const v1::Job&)> on_transition;
  std::function<absl::Time()> clock = absl::Now;
  std::function<std::string()> new_id = RandomId;
};

class JobManager;

// One caller that a job belongs to. When the last one goes and nobody detached the job, it is cancelled.
// Must not outlive the manager. Not thread-safe.
class JobAttachment {
 public:
  JobAttachment() = default;
  JobAttachment(JobManager* manager, std::string name) : manager_(manager), name_(std::move(name)) {}
  JobAttachment(JobAttachment&& other) noexcept { *this = std::move(other); }
  JobAttachment& operator=(JobAttachment&& other) noexcept;
  ~JobAttachment() { Release(); }

  void Release();

 private:
  JobManager* manager_ = nullptr;
  std::string name_;
};

struct AcceptedJob {
  v1::Job job;
  std::shared_ptr<const JobEventLog> events;
  JobAttachment attachment;  // empty unless JobRequest::attached
};

struct JobPage {
  std::vector<v1::Job> jobs;
  std::string next_page_token;
};

struct JobAssignment {
  std::string name;
  worker::v1::WorkRequest request;
};

// Thread-safe. Errors carry an ErrorInfo (core/base/error.h); unknown names are NOT_FOUND with JOB_NOT_FOUND.
class JobManager {
 public:
  JobManager(JobManagerOptions options, std::unique_ptr<JobStore> store);

  // ---- for callers

  // Queues a job, or finds the one that has the same request id. A job that was abandoned by its caller gives its
  // request id free, so that a retry after a lost connection starts anew.
  // Errors of ValidateJobRequest; RESOURCE_EXHAUSTED with QUEUE_FULL, UNAVAILABLE with DRAINING, both with a retry
  // delay.
  absl::StatusOr<AcceptedJob> Create(JobRequest request);

  absl::StatusOr<v1::Job> Get(const std::string& name) const;

  // Newest first, without report and progress; page_size and page_token as in planish.v1.ListJobsRequest.
  // INVALID_ARGUMENT with REQUEST_INVALID.
  absl::StatusOr<JobPage> List(int page_size, const std::string& page_token, v1::JobState state) const;

  // The job's events and, at their end, its UV. They stay as long as the caller holds them.
  absl::StatusOr<std::shared_ptr<const JobEventLog>> Watch(const std::string& name) const;

  // A queued job is CANCELLED at once. A running one is STOPPING, its worker is told, and whatever it delivers is
  // discarded. One that ended stays as it is.
  absl::StatusOr<v1::Job> Cancel(const std::string& name);

  // FAILED_PRECONDITION with JOB_NOT_FINISHED.
  absl::Status Delete(const std::string& name);

  // ---- for WorkerPool

  // Waits for a job and makes it RUNNING. Empty after Stop().
  std::optional<JobAssignment> TakeNext();

  // Tells who is at work, after the WorkRequest was sent: a cancellation goes there, also one from before this call.
  void SetLink(const std::string& name, std::shared_ptr<WorkerLink> link);

  void ReportProgress(const std::string& name, v1::Progress progress);
  // Ends the job as the worker says. A result for a job that ended is ignored.
  void ReportResult(const std::string& name, worker::v1::WorkResult result);
  // Ends the job as FAILED with reason INTERNAL and `message`.
  void ReportLost(const std::string& name, const std::string& message);

  // ---- for the server's shutdown, in this order

  // Refuses new jobs from now on; those that wait may still start. Calls `on_idle` once, when no job waits or runs.
  void Drain(std::function<void()> on_idle);
  // Cancels every job that has not ended.
  void CancelAll();
  // Gives up all workers that are still at it; their jobs fail.
  void CloseLinks();
  // Makes TakeNext() return.
  void Stop();

 private:
  friend class JobAttachment;

  // What a job has beside its record while this process lives.
  struct Live {
    std::shared_ptr<JobEventLog> events;
    std::string mesh;                         // while QUEUED
    std::vector<std::int32_t> seam_corners;   // while QUEUED
    std::vector<std::int32_t> uncut_corners;  // while QUEUED
    std::shared_ptr<WorkerLink> link;         // while a worker has it
    v1::Progress progress;                    // latest
    bool has_progress = false;
    int attachments = 0;
    bool detached = false;
  };

  // Declared before the lock so that it acts after the lock is released.
  struct Wakeups {
    std::vector<std::shared_ptr<JobEventLog>> logs;
    std::function<void()> on_idle;
    ~Wakeups();
  };

  void Abandon(const std::string& name);

  // All of these require mutex_.
  v1::Job Snapshot(const JobRecord& record, const Live& live) const;
  AcceptedJob Accept(const JobRecord& record, Live& live, bool attached);
  absl::Status CheckRoom(std::int64_t mesh_bytes) const;
  void CancelLocked(JobRecord record, Wakeups* wakeups);
  void FailLocked(JobRecord record, const absl::Status& error, Wakeups* wakeups);
  // Advances the record, stores it and tells everybody. An illegal action is ignored: it comes from a worker that is
  // late.
  void Apply(JobAction action, JobRecord record, std::shared_ptr<const std::string> uv, Wakeups* wakeups);
  void Retain(const std::string& name);
  void Forget(const std::string& name);

  // Constant after construction.
  const JobManagerOptions options_;
  const std::string instance_;

  mutable std::mutex mutex_;
  std::condition_variable work_or_stop_;
  // Guarded by mutex_.
  std::unique_ptr<JobStore> store_;
  std::unordered_map<std::string, Live> live_;  // one for each record of store_
  JobQueue queue_;
  int running_ = 0;                // jobs RUNNING or STOPPING
  std::deque<std::string> ended_;  // in order of end
  std::int64_t retained_bytes_ = 0;
  std::int64_t last_number_ = 0;
  bool draining_ = false;
  bool stopped_ = false;
  std::function<void()> on_idle_;
};

}  // namespace planish
