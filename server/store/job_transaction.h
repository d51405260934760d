// What the verbs of JobStore are made of: rows that are read, changed and written within one transaction.
#pragma once

#include <algorithm>
#include <cstdint>
#include <functional>
#include <map>
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
#include "server/store/work_rows.h"

namespace planish {

// What a job does to its work, whatever becomes of its record in memory.
struct JobStanding {
  bool ended = false;
  bool leased = false;      // RUNNING or STOPPING
  bool end_wanted = false;  // cancelled, or out of time
  bool stop_requested = false;
  bool alone = false;  // lost with a server before, and has one attempt left
  std::int64_t number = 0;
  std::int64_t turn_time = 0;
  std::int64_t memory_bytes = 0;
};

// A job's row as it was read; `record` may be moved from.
struct JobRow {
  JobRecord record;
  JobStanding standing;           // of the record as it was read or saved last
  bool had_request_id = false;    // when it was read
  std::int64_t due = 0;           // likewise
  std::int64_t result_bytes = 0;  // likewise: TenantAccount::result_bytes
  std::int64_t record_bytes = 0;  // likewise: TenantAccount::record_bytes
};

// Work that nobody else changes before the transaction ends, and all of its jobs that have not ended, in the order they
// came.
struct LockedWork {
  WorkRow before;  // as it is in the database
  WorkRow row;
  std::vector<JobRow> jobs;
  bool is_taken = false;  // EndWork() removed its row

  // Of its jobs that have not ended.
  std::int64_t Size() const;
};

// What a SELECT of jobs returns for JobRowsOf(); NULL in place of `report` leaves that out.
inline constexpr char kJobColumns[] = "number, due, record, report";
inline constexpr char kLeanJobColumns[] = "number, due, record, NULL";

// JOB_STATE_SUCCEEDED, as written into statements and not a parameter of them: the indexes of results are partial.
inline constexpr int kSucceeded = 4;
static_assert(kSucceeded == v1::JOB_STATE_SUCCEEDED);

// Row i, whose columns begin at `column`.
absl::StatusOr<JobRow> JobRowOf(const SqlRows& rows, std::size_t i, std::size_t column = 0);
absl::StatusOr<std::vector<JobRow>> JobRowsOf(const SqlRows& rows);
// Of rows with kind and event, those with greater sequences than `after`.
absl::StatusOr<std::vector<v1::JobEvent>> EventsOf(const SqlRows& rows, std::int64_t after);

// Whether an attempt at the job's work is under way.
inline bool IsLeased(const JobRecord& record) {
  return record.job().state() == v1::JOB_STATE_RUNNING || record.job().state() == v1::JOB_STATE_STOPPING;
}

// Whether the job is to end without a result.
inline bool IsEndWanted(const JobRecord& record) {
  return record.timed_out() || record.job().cancel_requested();
}

// The store's. Null: the database's own clock.
using StoreClock = std::function<absl::Time()>;

// Not thread-safe; lives as long as the transaction. Errors as of SqlConnection.
class JobTransaction {
 public:
  // All outlive the object.
  JobTransaction(SqlConnection* connection, const VerbContext* context, const StoreClock* clock);

  SqlConnection& sql() { return sql_; }
  const VerbContext& context() const { return context_; }
  AccountChanges& accounts() { return accounts_; }
  // What becomes known when the transaction is committed.
  StoreNews& news() { return news_; }

  // Nanoseconds since 1970 by the store's clock, once for the whole transaction.
  absl::StatusOr<std::int64_t> Now();
  // {now}, where a statement has it beside what it was asked for.
  void SetNow(std::int64_t database_now);

  // The job, which ended or whose work is not locked; NOT_FOUND with JOB_NOT_FOUND.
  absl::StatusOr<JobRow> Find(const std::string& name);

  // Empty: the work has ended, or, without `wait`, somebody else has locked it.
  absl::StatusOr<std::optional<LockedWork>> LockWork(const std::string& work, bool wait = true);
  // LockWork() of works all of whose jobs are about to end, with one journey to the database; their rows go. Empty: the
  // lease is not that of the work. The order is that of their names everywhere, so that no two transactions wait for
  // each other.
  absl::StatusOr<std::vector<std::optional<LockedWork>>> EndWorks(const std::vector<Lease>& ordered);
  // Of a row that is locked, and its jobs as they were read after that, in any order.
  LockedWork LockedWorkOf(WorkRow row, std::vector<JobRow> jobs) const;

  // LockWork() of the job's work, and where the job is in it; no place: it ended, and is the only row.
  struct Locked {
    LockedWork work;
    std::optional<std::size_t> place;

    JobRow& row() { return work.jobs[place.value_or(0)]; }
  };
  absl::StatusOr<Locked> LockJob(const std::string& name);

  // Writes what has become of the work when all its jobs are saved: it waits, runs, or is gone. Its lease is what
  // `work->row` says, as long as one of its jobs is leased.
  absl::Status Settle(LockedWork* work);
  // The tenant, which has nothing waiting, is about to: it begins at the virtual time. No effect if it has.
  absl::Status LiftIn(const FairAccounts& accounts, const std::string& tenant, double share);
  // Work that a job just inserted brings.
  void AddWork(const JobRow& job, absl::Duration run_time);
  // Writes what was changed, the accounts last. What is there before is read as it was.
  absl::Status Flush();
  // Writes all that but the accounts, so that the same transaction reads it as it is now.
  absl::Status FlushRows();

  // Adds a job with its labels, under the number that it has.
  void Insert(JobRow* row);
  // Writes the record of a job that is there. Its end and the loss of its request id are for good.
  void Save(JobRow* row, JobRecord* record);
  void PutBlobs(const std::vector<BlobRow>& blobs);

  // Changes the record by Advance() and adds the event to it, or one that says what the record says now. INTERNAL where
  // the state does not allow it. Neither writes the row.
  absl::Status Act(JobAction action, JobChange* change);
  absl::Status Announce(JobChange* change);
  // The rows of jobs that ended go, with all that belongs to them.
  absl::Status Delete(const std::vector<JobRow>& jobs);

  // Writes `event` with the job's next sequence.
  absl::Status AddEvent(JobChange* change, v1::JobEvent event);
  // After a loss of power: whatever was told of the job under a number that was reserved is behind it.
  static void SkipReserved(JobRecord* record);
  // Writes the events that the change has; only after Insert() is there a number to write them under.
  absl::Status WriteEvents(JobChange* change);

  // FAILED with `error`.
  absl::Status Fail(const google::rpc::Status& error, JobChange* change);
  // A job that was to end anyway ends, CANCELLED or FAILED with DEADLINE_EXCEEDED: whether it was one.
  absl::StatusOr<bool> EndIfWanted(JobChange* change);
  // An attempt is over without a result: nobody has the job's work any more.
  absl::Status Requeue(JobChange* change);
  // JobStore::EndEarly and RequestStop of a job of locked work.
  absl::Status EndEarly(const LockedWork& work, EarlyEnd why, bool forget, JobChange* change);
  absl::Status Stop(JobChange* change);
  // An attempt at the job's work begins.
  absl::Status Start(const Lease& lease, JobChange* change);

 private:
  // LiftIn() as the accounts are.
  absl::Status Lift(const std::string& tenant, double share);
  void Account(const JobRow& row, const JobRecord& record);
  // Of works, by their names.
  using JobsByWork = std::map<std::string, std::vector<JobRow>>;
  absl::StatusOr<JobsByWork> ReadJobs(const std::vector<std::string>& works);

  SqlConnection& sql_;
  const VerbContext& context_;
  const StoreClock& clock_;
  std::optional<std::int64_t> now_;
  AccountChanges accounts_;
  StoreNews news_;
  // To be written by Flush().
  RowBatch inserts_, labels_, new_works_;
  std::map<unsigned, RowBatch> saves_;  // by the columns that change
  RowBatch events_, works_;
  std::map<BlobId, BlobPtr> blobs_;
};

}  // namespace planish
