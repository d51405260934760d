// What the verbs of SqlJobStore are made of: rows that are read, changed and written within one transaction.
#pragma once

#include <cstdint>
#include <optional>
#include <string>
#include <vector>

#include "absl/status/status.h"
#include "absl/status/statusor.h"
#include "google/rpc/status.pb.h"
#include "planish/v1/job.pb.h"
#include "server/blobs/blob_catalog.h"
#include "server/store/job_store.h"
#include "server/store/lifecycle.h"
#include "server/store/sql.h"

namespace planish {

// What a record does not hold of a job's row.
struct JobRow {
  JobRecord record;
  std::int64_t lease_until = 0;  // nanoseconds since 1970
  bool had_request_id = false;   // when it was read
};

// What a SELECT of jobs returns for JobRowsOf(); NULL in place of `report` leaves that out.
inline constexpr char kJobColumns[] = "number, lease_until, record, report";
inline constexpr char kLeanJobColumns[] = "number, lease_until, record, NULL";

absl::StatusOr<std::vector<JobRow>> JobRowsOf(const SqlRows& rows);
absl::StatusOr<std::vector<v1::JobEvent>> EventsOf(const SqlRows& rows);

// Whether an attempt at the job's work is under way.
inline bool IsLeased(const JobRecord& record) {
  return record.job().state() == v1::JOB_STATE_RUNNING || record.job().state() == v1::JOB_STATE_STOPPING;
}

// Not thread-safe; lives as long as the transaction. Errors as of SqlConnection.
class JobTransaction {
 public:
  // Both outlive the object. `context` may be null for what makes no events.
  JobTransaction(SqlConnection* connection, const VerbContext* context) : sql_(*connection), context_(context) {}

  SqlConnection& sql() { return sql_; }

  // The job, which ended or whose work is not locked; NOT_FOUND with JOB_NOT_FOUND.
  absl::StatusOr<JobRow> Find(const std::string& name);

  // All jobs of the work that have not ended, in the order they came; until the end of the transaction nobody else
  // changes them or adds one. Without `wait` none if somebody else has locked the work.
  absl::StatusOr<std::vector<JobRow>> LockWork(const std::string& work, bool wait = true);

  // LockWork() of the job's work, and where the job is in it; no place: it ended, and is the only row.
  struct Locked {
    std::vector<JobRow> rows;
    std::optional<std::size_t> place;

    JobRow& row() { return rows[place.value_or(0)]; }
  };
  absl::StatusOr<Locked> LockJob(const std::string& name);

  // Adds a job with its labels and gives it its number; false if its name or request id is taken.
  absl::StatusOr<bool> Insert(JobRow* row, absl::Time turn);
  // Writes the record, and otherwise `row`, of a job that is there. Its end and the loss of its request id are for
  // good.
  absl::Status Save(const JobRow& row, JobRecord* record);
  absl::Status PutBlobs(const std::vector<BlobRow>& blobs);

  // Changes the record by Advance() and adds the event to it, or one that says what the record says now. INTERNAL where
  // the state does not allow it. Neither writes the row. `taken_over`: from a process that may have told of events
  // which are not written.
  absl::Status Act(JobAction action, JobChange* change, bool taken_over = false);
  absl::Status Announce(JobChange* change, bool taken_over = false);
  // Writes `event` with the job's next sequence.
  absl::Status AddEvent(JobChange* change, v1::JobEvent event, bool taken_over = false);
  // Writes the events that the change has; only after Insert() is there a number to write them under.
  absl::Status WriteEvents(JobChange* change);

  // FAILED with `error`.
  absl::Status Fail(const google::rpc::Status& error, JobChange* change, bool taken_over = false);
  // A job that was to end anyway ends, CANCELLED or FAILED with DEADLINE_EXCEEDED: whether it was one.
  absl::StatusOr<bool> EndIfWanted(JobChange* change, bool taken_over = false);
  // An attempt is over without a result: nobody has the job's work any more.
  absl::Status Requeue(JobRow* row, JobChange* change, bool taken_over = false);
  // An attempt at the job's work begins.
  absl::Status Start(const Lease& lease, JobChange* change);

 private:
  SqlConnection& sql_;
  const VerbContext* const context_;
};

}  // namespace planish
