// What this process's workers run: claimed for those that are free, kept by renewing leases, and reported to the store.
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
  // All outlive the object. `owner`: of leases; no other process has it.
  JobRunner(JobContext* context, JobFeed* feed, JobRetention* retention, std::string owner);

  // ---- for WorkerPool

  // Waits for work that the store gives this owner, and makes its jobs RUNNING, which is durable before it returns: an
  // attempt that ends the machine counts. Named after one of them; attempts count 1, 2, ... for each piece of work.
  // Where a mesh cannot be read or the start not be written for now, no work starts before the retry delay is over.
  // Over after Stop().
  Turn TakeNext(absl::Duration patience, JobAssignment* assignment) override;
  void SetLink(const std::string& name, int attempt, std::shared_ptr<WorkerLink> link) override;
  absl::Time ObeyBy(const std::string& name, int attempt) override;
  void ReportProgress(const std::string& name, int attempt, v1::Progress progress) override;
  // Ends the jobs as the worker says, or queues the work again with a larger reservation of memory.
  void ReportResult(const std::string& name, int attempt, worker::v1::WorkResult result, BlobPtr uv) override;
  // Queues the work again, or ends its jobs as FAILED if it cost too many workers.
  void ReportLost(const std::string& name, int attempt, WorkerLoss loss) override;

  // ---- for upkeep

  // Asks what is wanted of the attempts whose wishes have changed, and tells their workers.
  void ObeyWishes();
  // Renews leases in time, writes progress that waits and ends that could not be written, and looks for work again
  // every few seconds. Call it a few times a second.
  void Tick();

  // ---- for callers

  // RESOURCE_EXHAUSTED with STORAGE_FULL if the attempt at the work ended and that cannot be written for now.
  absl::Status CheckWritten(const std::string& work, const std::string& job) const;
  // What work takes over what was expected of it, lately.
  double seconds_factor() const { return seconds_factor_; }
  // Leases that this process has.
  int running() const;
  const std::string& owner() const { return owner_; }

  // The mesh, and the seams if there are any. NOT_FOUND or DATA_LOSS if one of them is lost.
  absl::StatusOr<std::vector<BlobPtr>> LoadBlobs(const JobRecord& record);
  // What a job whose LoadBlobs() failed so ends with.
  static absl::Status MeshLost(const absl::Status& why);

  // ---- for the end

  // Makes TakeNext() return; waits until nothing is being claimed.
  void Stop();
  // Gives up all workers that are still at it.
  void CloseLinks();
  // After Stop(): writes what is to be written, gives all work back to the store, and forgets it.
  void GiveBack();

 private:
  struct Attempt {
    ClaimedWork work;    // as claimed
    absl::Time start;    // by the steady clock
    absl::Time renewed;  // likewise: the lease, at the latest then
    std::shared_ptr<WorkerLink> link;
    Wish wish = Wish::kGoOn;
    Wish told = Wish::kGoOn;  // to the worker
    bool look = false;        // the wish may have changed
    absl::Time obey_by = absl::InfiniteFuture();
    std::vector<v1::Progress> progress;  // not written yet
    absl::Time reported;                 // by the steady clock
    bool reporting = false;              // some thread writes progress
    bool ended = false;                  // some thread writes how it ended, or it is `unwritten`
  };

  // How an attempt ended, until that is written. Its jobs are RUNNING for everybody so long.
  struct Ending {
    ClaimedWork work;
    AttemptOutcome outcome;
    BlobPtr uv_bytes;  // until they are kept; null: none
    StoredBlobPtr uv;
    BlobHold hold;    // of the UV
    WorkerLoss loss;  // with AttemptOutcome::loss or memory_bytes
    absl::Duration duration;
  };

  // Null if that attempt is over, or its end is being written. Requires mutex_.
  Attempt* Find(const std::string& name, int attempt);
  // Claims for all that wait. Requires `lock`, which is released meanwhile.
  void Claim(std::unique_lock<std::mutex>* lock);
  // Fills in what a worker needs. False if it cannot have it: then the work was given back, or its jobs have failed.
  bool Prepare(const ClaimedWork& work, JobAssignment* assignment);
  // No work starts for a while, because of `why`.
  void Postpone(const absl::Status& why);
  // The attempt is no longer this process's.
  void Forget(const Lease& lease);
  // Tells the worker what is wanted. Requires mutex_.
  void TellWish(Attempt* attempt);
  void Renew(const std::vector<Lease>& leases);
  // Asks what is wanted where no news of that come in (JobStore::hears_others).
  void LookForWishes();
  // Between two reports of one job.
  absl::Duration ReportInterval() const;
  // Writes the progress that waits, unless somebody is at it.
  void WriteProgress(const std::string& work);
  // Takes the attempt for its end, with the progress that waits; empty: it is not this process's any more.
  std::optional<Ending> BeginEnd(const std::string& name, int attempt);
  // Writes how it ended, and tells everybody; if that cannot be, Tick() tries again.
  void End(Ending ending);
  // What to reserve for another attempt at work that ended so; 0: there is none to be.
  std::int64_t LargerReservation(const ClaimedWork& work, const google::rpc::Status& status) const;
  // Keeps the UV that the worker sent. UNAVAILABLE: later; whatever else is wrong is how the attempt ended.
  absl::Status KeepUv(Ending* ending);
  absl::StatusOr<StoredBlobPtr> PutUv(const Ending& ending);
  void Tell(const std::vector<JobChange>& changes, const StoredBlobPtr& uv = nullptr);

  JobContext& context_;
  JobFeed& feed_;
  JobRetention& retention_;
  const std::string owner_;
  ClaimPace pace_;  // of the thread that claims
  std::atomic<double> seconds_factor_ = 1;

  mutable std::mutex mutex_;
  std::condition_variable changed_;
  // Guarded by mutex_.
  std::map<std::string, Attempt> attempts_;  // by work
  std::map<std::string, Ending> unwritten_;  // likewise: ends that could not be written
  std::deque<ClaimedWork> ready_;            // claimed, and nobody has it yet
  int waiting_ = 0;                          // threads in TakeNext()
  bool claiming_ = false;
  bool missed_ = false;                           // news of wishes came while work was being claimed
  bool may_claim_ = true;                         // there may be work that nobody looked at
  absl::Time next_start_ = absl::InfinitePast();  // by the steady clock, as what follows
  absl::Time next_claim_ = absl::InfinitePast();
  absl::Time next_look_ = absl::InfinitePast();  // for work: news may be lost
  absl::Time next_renewal_ = absl::InfinitePast();
  bool stopped_ = false;

  JobStore::Subscription subscription_;
};

}  // namespace planish
