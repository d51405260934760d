// Runs work on this process's workers: claims it for free workers, renews the leases, and reports progress and ends to
// the store.
#pragma once

#include <atomic>
#include <condition_variable>
#include <cstdint>
#include <deque>
#include <map>
#include <memory>
#include <mutex>
#include <optional>
#include <string>
#include <vector>

#include "absl/status/status.h"
#include "absl/status/statusor.h"
#include "absl/time/time.h"
#include "server/jobs/claim_pace.h"
#include "server/jobs/job_feed.h"
#include "server/jobs/job_options.h"
#include "server/jobs/job_retention.h"
#include "server/jobs/job_source.h"
#include "server/link/worker_link.h"

namespace planish {

// Thread-safe. No lock is held while the store is asked.
class JobRunner : public JobSource {
 public:
  // The objects outlive the runner. `owner`: the owner of this process's leases; unique to the process.
  JobRunner(JobContext* context, JobFeed* feed, JobRetention* retention, std::string owner);

  // ---- for WorkerPool

  // Waits until the store grants work to this owner. Before it returns, the store has durably noted that the work's
  // jobs are RUNNING, so that an attempt counts even if it takes the machine down. The assignment is named after one of
  // the jobs; attempts count 1, 2, ... for each piece of work. If a mesh cannot be read or the start cannot be written
  // at the moment, no work starts until the retry delay has passed. Returns kOver after Stop().
  Turn TakeNext(absl::Duration patience, JobAssignment* assignment) override;
  void SetLink(const std::string& name, int attempt, std::shared_ptr<WorkerLink> link) override;
  absl::Time ObeyBy(const std::string& name, int attempt) override;
  void ReportProgress(const std::string& name, int attempt, v1::Progress progress) override;
  // Ends the jobs with the worker's result, or queues the work again with a larger memory reservation.
  void ReportResult(const std::string& name, int attempt, worker::v1::WorkResult result, BlobPtr uv) override;
  // Queues the work again, or ends its jobs as FAILED after the last attempt.
  void ReportLost(const std::string& name, int attempt, WorkerLoss loss) override;

  // ---- for upkeep

  // Reads the desired state of the attempts for which it may have changed, and tells their workers.
  void ObeyWishes();
  // Renews leases in time, writes pending progress, retries ends that could not be written, and polls for work every
  // few seconds. Call it a few times a second.
  void Tick();

  // ---- for callers

  // OK, or RESOURCE_EXHAUSTED with STORAGE_FULL if the attempt at `work` has ended and its end cannot be written at the
  // moment.
  absl::Status CheckWritten(const std::string& work, const std::string& job) const;
  // Recent ratio of actual to estimated seconds of work.
  double seconds_factor() const { return seconds_factor_; }
  // The number of leases of this process.
  int running() const;
  const std::string& owner() const { return owner_; }

  // The job's mesh, and its mesh elements if there are any. NOT_FOUND or DATA_LOSS if either is lost.
  absl::StatusOr<std::vector<BlobPtr>> LoadBlobs(const JobRecord& record);
  // The error of a job whose LoadBlobs() failed with `why`.
  static absl::Status MeshLost(const absl::Status& why);

  // ---- for the shutdown

  // Makes TakeNext() return; waits until nothing is being claimed.
  void Stop();
  // Closes the links of all workers that still have a job.
  void CloseLinks();
  // After Stop(): writes pending progress and ends, and releases all leases.
  void GiveBack();

 private:
  struct Attempt {
    ClaimedWork work;    // as claimed
    absl::Time start;    // when the attempt began, by the steady clock
    absl::Time renewed;  // time of the last renewal of the lease, by the steady clock
    std::shared_ptr<WorkerLink> link;
    Wish wish = Wish::kGoOn;
    Wish told = Wish::kGoOn;  // the state that was sent to the worker
    bool look = false;        // the desired state in the store may have changed
    absl::Time obey_by = absl::InfiniteFuture();
    std::vector<v1::Progress> progress;  // not written yet
    absl::Time reported;                 // when progress was last written, by the steady clock
    bool reporting = false;              // a thread is writing progress
    bool ended = false;                  // a thread is writing the end, or it is in unwritten_
  };

  // The end of an attempt, until it is written. Until then its jobs are RUNNING for everybody.
  struct Ending {
    ClaimedWork work;
    AttemptOutcome outcome;
    BlobPtr uv_bytes;  // the UV until they are stored; null: none
    StoredBlobPtr uv;
    BlobHold hold;    // keeps the UV from being collected
    WorkerLoss loss;  // set if the attempt was lost or needs more memory
    absl::Duration duration;
  };

  // This attempt; null if it has ended, or its end is being written. Requires mutex_.
  Attempt* Find(const std::string& name, int attempt);
  // Claims work for all threads that wait. Requires `lock`, which is released meanwhile.
  void Claim(std::unique_lock<std::mutex>* lock);
  // Fills *assignment for a worker. False if a mesh cannot be read; then the work was released, or its jobs have
  // failed.
  bool Prepare(const ClaimedWork& work, JobAssignment* assignment);
  // Starts no work until the retry delay has passed, because of `why`.
  void Postpone(const absl::Status& why);
  // Forgets the attempt: this process no longer has its lease.
  void Forget(const Lease& lease);
  // Sends the desired state to the worker. Requires mutex_.
  void TellWish(Attempt* attempt);
  void Renew(const std::vector<Lease>& leases);
  // Polls for desired states if the store sends no notifications (JobStore::hears_others).
  void LookForWishes();
  // Interval between two progress reports of one job.
  absl::Duration ReportInterval() const;
  // Writes the pending progress, unless another thread does.
  void WriteProgress(const std::string& work);
  // Begins to end the attempt: returns its Ending, with its pending progress. Nullopt if this process no longer has the
  // lease.
  std::optional<Ending> BeginEnd(const std::string& name, int attempt);
  // Writes the end and tells the watchers. If that fails, Tick() tries again.
  void End(Ending ending);
  // Memory to reserve for the next attempt after an end with `status`; 0 if there is no next attempt.
  std::int64_t LargerReservation(const ClaimedWork& work, const google::rpc::Status& status) const;
  // Stores the UV that the worker sent. UNAVAILABLE: try again later. Any other error becomes the outcome of the
  // attempt.
  absl::Status KeepUv(Ending* ending);
  absl::StatusOr<StoredBlobPtr> PutUv(const Ending& ending);
  void Tell(const std::vector<JobChange>& changes, const StoredBlobPtr& uv = nullptr);

  JobContext& context_;
  JobFeed& feed_;
  JobRetention& retention_;
  const std::string owner_;
  ClaimPace pace_;  // used by the claiming thread
  std::atomic<double> seconds_factor_ = 1;

  mutable std::mutex mutex_;
  std::condition_variable changed_;
  // Guarded by mutex_.
  std::map<std::string, Attempt> attempts_;  // by work
  std::map<std::string, Ending> unwritten_;  // by work: ends that could not be written
  std::deque<ClaimedWork> ready_;            // claimed, but not yet given to a worker
  int waiting_ = 0;                          // threads in TakeNext()
  bool claiming_ = false;
  bool missed_ = false;                           // a change of desired state was notified during a claim
  bool may_claim_ = true;                         // there may be unclaimed work
  absl::Time next_start_ = absl::InfinitePast();  // this and the next three by the steady clock
  absl::Time next_claim_ = absl::InfinitePast();
  absl::Time next_look_ = absl::InfinitePast();  // next poll for work: notifications may be lost
  absl::Time next_renewal_ = absl::InfinitePast();
  bool stopped_ = false;

  JobStore::Subscription subscription_;
};

}  // namespace planish
