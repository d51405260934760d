// The building blocks of JobStore's verbs: rows that are read, changed and written within one transaction.
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

// The part of a job's record that its work depends on, copied, since the record may change or move.
struct JobStanding {
  bool ended = false;
  bool leased = false;      // RUNNING or STOPPING
  bool end_wanted = false;  // being cancelled, or timed out
  bool stop_requested = false;
  bool alone = false;  // lost a server before and is on its last attempt
  std::int64_t number = 0;
  std::int64_t turn_time = 0;
  std::int64_t memory_bytes = 0;
};

// A row of `jobs`. `record` may be moved from.
struct JobRow {
  JobRecord record;
  JobStanding standing;           // of the record as last read or saved
  bool had_request_id = false;    // when it was read
  std::int64_t due = 0;           // when it was read
  std::int64_t result_bytes = 0;  // when it was read; TenantAccount::result_bytes
  std::int64_t record_bytes = 0;  // when it was read; TenantAccount::record_bytes
};

// Work locked until the end of the transaction, and its unfinished jobs, oldest first.
struct LockedWork {
  WorkRow before;  // the row in the database
  WorkRow row;
  std::vector<JobRow> jobs;
  bool is_taken = false;  // EndWorks() removed its row

  // The number of its unfinished jobs.
  std::int64_t Size() const;
};

// The columns that JobRowsOf() reads; the lean ones leave the report out.
inline constexpr char kJobColumns[] = "number, due, record, report";
inline constexpr char kLeanJobColumns[] = "number, due, record, NULL";

// JOB_STATE_SUCCEEDED as text of a statement. As a parameter it would hide partial indexes from the planner.
inline constexpr int kSucceeded = 4;
static_assert(kSucceeded == v1::JOB_STATE_SUCCEEDED);

// Reads row i, with the first of kJobColumns at `column`.
absl::StatusOr<JobRow> JobRowOf(const SqlRows& rows, std::size_t i, std::size_t column = 0);
absl::StatusOr<std::vector<JobRow>> JobRowsOf(const SqlRows& rows);
// Reads rows of (kind, event); returns the events with sequences greater than `after`.
absl::StatusOr<std::vector<v1::JobEvent>> EventsOf(const SqlRows& rows, std::int64_t after);

// Whether an attempt at the job's work is running.
inline bool IsLeased(const JobRecord& record) {
  return record.job().state() == v1::JOB_STATE_RUNNING || record.job().state() == v1::JOB_STATE_STOPPING;
}

// Whether the job is to end without a result.
inline bool IsEndWanted(const JobRecord& record) {
  return record.timed_out() || record.job().cancel_requested();
}

// The store's clock. Null: the database's own.
using StoreClock = std::function<absl::Time()>;

// One transaction of a verb. Not thread-safe. Errors of SqlConnection.
class JobTransaction {
 public:
  // All arguments outlive the object.
  JobTransaction(SqlConnection* connection, const VerbContext* context, const StoreClock* clock);

  SqlConnection& sql() { return sql_; }
  const VerbContext& context() const { return context_; }
  AccountChanges& accounts() { return accounts_; }
  // The news that are published after the commit.
  StoreNews& news() { return news_; }

  // The store's clock in nanoseconds since 1970; the same for the whole transaction.
  absl::StatusOr<std::int64_t> Now();
  // Sets Now() to {now} as another statement has read it, so that Now() need not run a statement.
  void SetNow(std::int64_t database_now);

  // Reads a job without locking its work. NOT_FOUND with JOB_NOT_FOUND.
  absl::StatusOr<JobRow> Find(const std::string& name);

  // Locks work, and reads its unfinished jobs. Nullopt if the work has ended, or if another transaction has locked it
  // and `wait` is false.
  absl::StatusOr<std::optional<LockedWork>> LockWork(const std::string& work, bool wait = true);
  // Locks work whose jobs are all about to end, and deletes its rows, in one round trip. The result has nullopt for a
  // lease that is not current. `ordered` is sorted by the name of the work, as everywhere, which prevents deadlocks.
  absl::StatusOr<std::vector<std::optional<LockedWork>>> EndWorks(const std::vector<Lease>& ordered);
  // Combines a locked row with its jobs, in any order, which were read after it was locked.
  LockedWork LockedWorkOf(WorkRow row, std::vector<JobRow> jobs) const;

  // The locked work of a job, and the job's index in it. No index: the job has ended, and is the only row.
  struct Locked {
    LockedWork work;
    std::optional<std::size_t> place;

    JobRow& row() { return work.jobs[place.value_or(0)]; }
  };
  absl::StatusOr<Locked> LockJob(const std::string& name);

  // Call it after all jobs of the work are saved: updates the work's row, or deletes it if no job is left. The lease in
  // `work->row` stays while one of its jobs is leased.
  absl::Status Settle(LockedWork* work);
  // Call it before work of a tenant without waiting work is added: raises the tenant to the virtual time
  // (fair_share.h). No effect if the tenant has waiting work.
  absl::Status LiftIn(const FairAccounts& accounts, const std::string& tenant, double share);
  // Adds the work of a job that was just inserted.
  void AddWork(const JobRow& job, absl::Duration run_time);
  // Writes all changes, the accounts last. Until then, statements of this transaction read the old rows.
  absl::Status Flush();
  // Writes all changes but those of the accounts, so that this transaction can read them.
  absl::Status FlushRows();

  // Adds a job and its labels. The record has its number.
  void Insert(JobRow* row);
  // Writes the record of an existing job. An end and the loss of a request id are final.
  void Save(JobRow* row, JobRecord* record);
  void PutBlobs(const std::vector<BlobRow>& blobs);

  // Act() changes the record by Advance() and adds an event for that; INTERNAL if the state does not allow it.
  // Announce() adds an event with the current state. Neither writes the row.
  absl::Status Act(JobAction action, JobChange* change);
  absl::Status Announce(JobChange* change);
  // Deletes ended jobs with their labels and events.
  absl::Status Delete(const std::vector<JobRow>& jobs);

  // Adds `event` under the job's next sequence.
  absl::Status AddEvent(JobChange* change, v1::JobEvent event);
  // Call it after a loss of power: the next sequences are above all reserved ones, which watchers may have seen.
  static void SkipReserved(JobRecord* record);
  // Writes the events of the change. Call it after Insert(), which gives them their job's number.
  absl::Status WriteEvents(JobChange* change);

  // Ends the job as FAILED with `error`.
  absl::Status Fail(const google::rpc::Status& error, JobChange* change);
  // If the job is being cancelled or has timed out, ends it. Returns whether it did.
  absl::StatusOr<bool> EndIfWanted(JobChange* change);
  // The attempt ended without a result: queues the job again.
  absl::Status Requeue(JobChange* change);
  // JobStore::EndEarly and RequestStop for a job of locked work.
  absl::Status EndEarly(const LockedWork& work, EarlyEnd why, bool forget, JobChange* change);
  absl::Status Stop(JobChange* change);
  // Makes the job RUNNING, since an attempt at its work has started.
  absl::Status Start(const Lease& lease, JobChange* change);

 private:
  // LiftIn() with the current accounts.
  absl::Status Lift(const std::string& tenant, double share);
  void Account(const JobRow& row, const JobRecord& record);
  // Unfinished jobs, by the name of their work.
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
  std::map<unsigned, RowBatch> saves_;  // by the set of columns that change
  RowBatch events_, works_;
  std::map<BlobId, BlobPtr> blobs_;
};

}  // namespace planish
