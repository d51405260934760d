// Keeps track of the callers that jobs belong to. A job whose callers are all gone is cancelled after a grace period.
#pragma once

#include <map>
#include <mutex>
#include <string>
#include <utility>

#include "absl/time/time.h"
#include "server/jobs/job_options.h"

namespace planish {

class JobCallers;

// Why a caller leaves.
enum class Parting {
  kMayReturn,  // the connection was lost: the grace period begins
  kForGood,    // the caller's deadline passed
  kJobEnded,   // the caller received the job's end: nothing needs to be written
};

// One caller of a job. When the last caller leaves and nobody detached the job, the job is cancelled unless another
// caller attaches within the grace period. Must not outlive the manager. Not thread-safe.
class JobAttachment {
 public:
  JobAttachment() = default;
  JobAttachment(JobCallers* callers, std::string name) : callers_(callers), name_(std::move(name)) {}
  JobAttachment(JobAttachment&& other) noexcept { *this = std::move(other); }
  JobAttachment& operator=(JobAttachment&& other) noexcept;
  ~JobAttachment() { Release(); }

  // Whether there is nothing to release.
  bool empty() const { return callers_ == nullptr; }

  // Ends the attachment. If it was the job's last one in this process, that is written to the store, unless the job
  // ended.
  void Release(Parting parting = Parting::kMayReturn);

 private:
  JobCallers* callers_ = nullptr;
  std::string name_;
};

// The callers of this process. The store has, for each job, the time until which its callers count as present.
// Attaching and Renew() extend this time, until the process dies. Thread-safe.
class JobCallers {
 public:
  // `context` outlives the object.
  explicit JobCallers(JobContext* context) : context_(*context) {}

  // How long callers count as present after they attached or were renewed.
  static constexpr absl::Duration kBelieved = absl::Seconds(60);

  // Counts one more caller of the job. `known`: the store already has a recent renewal of this job's callers, for
  // instance because the job was just accepted.
  JobAttachment Attach(const std::string& name, bool known);
  // Tells the store that the callers of all attached jobs are still present. Call it a few times a second: most calls
  // do nothing.
  void Renew();
  // From now on, releasing an attachment writes nothing: the next process starts its own grace period.
  void Suspend();

 private:
  friend class JobAttachment;

  void Detach(const std::string& name, Parting parting);

  JobContext& context_;

  std::mutex mutex_;
  // Guarded by mutex_.
  std::map<std::string, int> callers_;              // number of callers, by job
  absl::Time next_renewal_ = absl::InfinitePast();  // by the steady clock
  // How far the store's clock was ahead of the steady clock at the last check.
  absl::Duration store_ahead_;
  bool suspended_ = false;
};

}  // namespace planish
