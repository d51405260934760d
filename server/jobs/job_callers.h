// Callers that jobs belong to: a job whose callers are all gone is cancelled after a while.
#pragma once

#include <map>
#include <mutex>
#include <string>
#include <utility>

#include "absl/time/time.h"
#include "server/jobs/job_options.h"

namespace planish {

class JobCallers;

// Why a caller goes.
enum class Parting {
  kMayReturn,  // the connection is gone: there is a grace
  kForGood,    // its deadline passed
  kJobEnded,   // it was told the job's end: nothing is to be written
};

// One caller that a job belongs to. When the last one goes and nobody detached the job, it is cancelled unless another
// one comes within the grace. Must not outlive the manager. Not thread-safe.
class JobAttachment {
 public:
  JobAttachment() = default;
  JobAttachment(JobCallers* callers, std::string name) : callers_(callers), name_(std::move(name)) {}
  JobAttachment(JobAttachment&& other) noexcept { *this = std::move(other); }
  JobAttachment& operator=(JobAttachment&& other) noexcept;
  ~JobAttachment() { Release(); }

  // Whether there is nothing to release.
  bool empty() const { return callers_ == nullptr; }

  // Writes to the store, unless the job ended.
  void Release(Parting parting = Parting::kMayReturn);

 private:
  JobCallers* callers_ = nullptr;
  std::string name_;
};

// The callers of this process. The store knows until when they are there for sure: whoever attaches or stays says so,
// and a process that dies stops saying it. Thread-safe.
class JobCallers {
 public:
  // `context` outlives the object.
  explicit JobCallers(JobContext* context) : context_(*context) {}

  // How long the store believes that callers are there who have just come or said so.
  static constexpr absl::Duration kBelieved = absl::Seconds(60);

  // Counts one more caller. `known`: the store knows, as when the job was just accepted.
  JobAttachment Attach(const std::string& name, bool known);
  // Says of all jobs with callers that these are there. Call it a few times a second: most calls do nothing.
  void Renew();
  // From now on attachments are released without a word: the next process asks anew.
  void Suspend();

 private:
  friend class JobAttachment;

  void Detach(const std::string& name, Parting parting);

  JobContext& context_;

  std::mutex mutex_;
  // Guarded by mutex_.
  std::map<std::string, int> callers_;              // of each job
  absl::Time next_renewal_ = absl::InfinitePast();  // by the steady clock
  absl::Duration store_ahead_;                      // of the steady clock, the store's one, at the last look
  bool suspended_ = false;
};

}  // namespace planish
