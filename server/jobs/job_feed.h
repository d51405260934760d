// What watchers see of jobs: the store's events, kept in logs as long as somebody reads them.
#pragma once

#include <cstdint>
#include <functional>
#include <map>
#include <memory>
#include <mutex>
#include <set>
#include <string>
#include <vector>

#include "absl/status/status.h"
#include "absl/status/statusor.h"
#include "server/jobs/event_log.h"
#include "server/jobs/job_options.h"

namespace planish {

// A log is fed by what this process does, at once (Tell), and by what others did when the store says that something has
// changed (Refresh). The sequences are the store's, so that either may come first. Thread-safe.
class JobFeed {
 public:
  // `context` outlives the object and all logs.
  explicit JobFeed(JobContext* context);

  // The job's events so far, and those to come. Its UV are there if the job SUCCEEDED and has them still.
  // RESOURCE_EXHAUSTED with a retry delay if they cannot be opened for now.
  absl::StatusOr<std::shared_ptr<const JobEventLog>> Open(const JobRecord& record);
  // The log of a job that is about to be accepted, before anybody can change it.
  std::shared_ptr<JobEventLog> OpenNew(const std::string& name);
  // It was accepted.
  void NoteNumber(const std::string& name, std::int64_t number);

  // Tells everybody what verbs of this process made of jobs; `uv` are those of the ones that SUCCEEDED.
  void Tell(const std::vector<JobChange>& changes, const StoredBlobPtr& uv = nullptr);

  // Reads what other processes changed. Call it a few times a second.
  void Refresh();

  // Ends all logs of jobs that go on, with `status`, and all that are opened from now on.
  void Interrupt(const absl::Status& status);

 private:
  struct Entry {
    std::weak_ptr<JobEventLog> log;
    std::int64_t number = 0;  // of the job; 0: it is being accepted
  };

  std::shared_ptr<JobEventLog> Register(const std::string& name, std::int64_t number);
  // Null if nobody reads it.
  std::shared_ptr<JobEventLog> Find(const std::string& name);
  // Adds the store's events to the log.
  absl::Status Read(const std::string& name, std::int64_t number, JobEventLog* log);
  // Adds a job's last event, with the UV.
  absl::Status Finish(v1::JobEvent event, JobEventLog* log);
  // Ends the log of a job that ended, or is gone, under a sequence that was given before. A database that crashed may
  // have forgotten the newest events that were told, and gives their sequences again.
  absl::Status EndBehind(const std::string& name, JobEventLog* log);
  // Reads what is new of these, which all have numbers.
  void LookAtAll(const std::map<std::string, Entry>& entries);
  // Has `read` add to the log, if anybody reads it, and wakes its readers. What fails is tried again.
  void ReadNew(const std::string& name, const Entry& entry, const std::function<absl::Status(JobEventLog*)>& read);

  JobContext& context_;

  std::mutex mutex_;
  // Guarded by mutex_.
  std::map<std::string, Entry> logs_;            // of jobs that had not ended, by name
  std::size_t next_clearing_ = 64;               // entries from which on those that nobody reads are looked for
  std::set<std::string> changed_;                // of these, those that others changed
  absl::Time next_look_ = absl::InfinitePast();  // at all of them, by the steady clock: news may be lost
  absl::Status interrupted_;

  JobStore::Subscription subscription_;
};

}  // namespace planish
