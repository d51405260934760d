// Delivers the store's events to watchers, through a log for each watched job.
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

// Changes that this process makes are added to the logs at once (Tell); changes by other processes are read when the
// store notifies of them (Refresh). The sequence numbers are the store's, so either may come first. Thread-safe.
class JobFeed {
 public:
  // `context` outlives the object and all logs.
  explicit JobFeed(JobContext* context);

  // The log of the job's past and future events. Has the UV if the job SUCCEEDED and they are still kept.
  // RESOURCE_EXHAUSTED with a retry delay if the UV cannot be opened at the moment.
  absl::StatusOr<std::shared_ptr<const JobEventLog>> Open(const JobRecord& record);
  // The log of a job that is about to be accepted. Call it before the job can change.
  std::shared_ptr<JobEventLog> OpenNew(const std::string& name);
  // Call it once the job was accepted and has this number.
  void NoteNumber(const std::string& name, std::int64_t number);

  // Adds the changes that this process wrote to the logs and wakes their readers. `uv`: the result of those jobs that
  // SUCCEEDED.
  void Tell(const std::vector<JobChange>& changes, const StoredBlobPtr& uv = nullptr);

  // Reads what other processes changed. Call it a few times a second.
  void Refresh();

  // Ends the logs of all unfinished jobs with `status`, those opened later included.
  void Interrupt(const absl::Status& status);

 private:
  struct Entry {
    std::weak_ptr<JobEventLog> log;
    std::int64_t number = 0;  // the job's number; 0 while it is being accepted
  };

  std::shared_ptr<JobEventLog> Register(const std::string& name, std::int64_t number);
  // The log of the job; null if nobody reads it.
  std::shared_ptr<JobEventLog> Find(const std::string& name);
  // Adds the job's events that the store has and the log lacks.
  absl::Status Read(const std::string& name, std::int64_t number, JobEventLog* log);
  // Adds a job's last event, with the UV.
  absl::Status Finish(v1::JobEvent event, JobEventLog* log);
  // Ends the log of a job that has ended or was deleted, although its last event has a sequence number that readers
  // have already seen. A database that crashed may have forgotten the newest events, and assigns their numbers again.
  absl::Status EndBehind(const std::string& name, JobEventLog* log);
  // Reads the new events of these jobs from the store. Every job must have its number already (Entry::number).
  void LookAtAll(const std::map<std::string, Entry>& entries);
  // Calls `read` to add to the log, if anybody reads it, and wakes its readers. A failed read is tried again later.
  void ReadNew(const std::string& name, const Entry& entry, const std::function<absl::Status(JobEventLog*)>& read);

  JobContext& context_;

  std::mutex mutex_;
  // Guarded by mutex_.
  std::map<std::string, Entry> logs_;            // of unfinished jobs, by name
  std::size_t next_clearing_ = 64;               // number of entries at which those without a reader are removed
  std::set<std::string> changed_;                // jobs of logs_ that other processes changed
  absl::Time next_look_ = absl::InfinitePast();  // next poll of all jobs, as notifications may be lost; steady clock
  absl::Status interrupted_;

  JobStore::Subscription subscription_;
};

}  // namespace planish
