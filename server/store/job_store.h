// The store of jobs, and the only ways to change them.
//
// Every function that changes something is a verb: one transaction that reads, decides, and writes the records, their
// events and small blobs, or writes nothing. Each verb, or a group of similar ones, has a file of its own. Any number
// of processes may share a store (PostgreSQL).
//
// Work. All jobs of a tenant with the same mesh and options are one piece of work (JobRecord.work), unless
// Scheduling.fresh is set. Work is queued, claimed, lost and finished as one; each of its jobs can be stopped or
// cancelled alone.
//
// Leases. A claim gives its owner a lease: (work, attempt, owner). Attempts count 1, 2, ... for each piece of work. The
// lease lasts until the work is finished or released, or until it expires without a Renew(); then Reap() takes it away.
// A verb with any other lease than the present one changes nothing and returns ABORTED with LEASE_LOST (fencing).
//
// Scheduling. Claim() divides worker time between tenants by their shares (fair_share.h). Within a tenant age and
// priority decide.
//
// Time limits. The compute budget of a job, its timeout, and how long it waits for absent callers are in its record.
// EndOverdue() enforces them, so somebody must call it regularly.
//
// Notifications. Subscribers are notified of changes by all processes, within milliseconds. Notifications may be lost,
// so subscribers also poll every few seconds.
//
// Clock. Only the store's clock counts (Now()): for times in records and events, leases, time limits and retention. The
// clocks of the machines that use the store do not matter. Callers pass durations, never times.
//
// Lost answers. After UNAVAILABLE a verb may or may not have been done. Each verb can be repeated: Accept() finds the
// job by its name, Finish() returns LEASE_LOST, work taken by Claim() returns to the queue when its lease expires, and
// the others have no further effect, except that Report() tells its progress twice.
#pragma once

#include <cstdint>
#include <functional>
#include <map>
#include <memory>
#include <optional>
#include <string>
#include <utility>
#include <vector>

#include "absl/status/status.h"
#include "absl/status/statusor.h"
#include "absl/time/time.h"
#include "google/rpc/status.pb.h"
#include "planish/store/v1/store.pb.h"
#include "planish/v1/job.pb.h"
#include "server/blobs/blob_catalog.h"
#include "server/store/fair_share.h"
#include "server/store/job_filter.h"
#include "server/store/sql.h"

namespace planish {

using JobRecord = store::v1::JobRecord;

// Settings of the server that calls a verb.
struct VerbContext {
  absl::Duration retained_time = absl::InfiniteDuration();  // from a job's success to its Job.expire_time
  int max_attempts = 3;                                     // after so many lost workers or servers a job fails
};

// A job after a verb.
struct JobChange {
  JobRecord record;                  // after the change
  std::vector<v1::JobEvent> events;  // written by the verb, in order; an event of an end has the report
};

struct Lease {
  std::string work;
  int attempt = 0;
  std::string owner;
};

// What the callers want an attempt to do.
enum class Wish {
  kGoOn,
  kStop,    // every job of the work wants the best map so far
  kCancel,  // nobody wants the result
  kGiveUp,  // the lease is lost: another owner may have the work
};

// A piece of work that has not ended. Times in nanoseconds since 1970.
struct WorkRow {
  std::string name, tenant;
  std::int64_t number = 0;  // the lowest number of its jobs
  bool running = false;     // there is a lease, which may have expired
  std::int64_t turn_time = 0;
  std::int64_t memory_bytes = 0;
  std::int64_t mesh_bytes = 0;
  std::int64_t run_time = 0;  // expected run time, a duration
  bool alone = false;         // its owner must run nothing else beside it
  Wish wish = Wish::kGoOn;
  // The following are set while the work runs. `attempt` also stays after a loss.
  std::string owner;
  int attempt = 0;
  std::int64_t lease_until = 0;
  std::int64_t start_time = 0;
  std::int64_t charge = 0;         // what the work adds to TenantAccount::charged
  std::int64_t share = 1'000'000;  // the tenant's share when the work was claimed, in millionths

  bool operator==(const WorkRow&) const = default;
};

// All work that has not ended.
struct QueueState {
  FairAccounts accounts;
  std::vector<WorkRow> works;  // in no order
  absl::Time now;
};

struct NewJob {
  // QUEUED, with a new name; `number`, `work` and the lease are the store's, and so is Job.create_time unless it is
  // set.
  JobRecord record;
  absl::Duration run_time;            // expected run time of the job's work; 0: not known
  std::optional<QueueLimits> limits;  // apply if the job is new work; empty: no limits
  absl::Duration callers_for;         // for an attached record: sets JobRecord.callers_until, counted from now
  std::vector<BlobRow> blobs;         // small blobs of the job
  // Name of a job with the same work key. If that job's result is still kept, the new job takes it. Empty: no such job.
  std::string result_of;
};

struct AcceptedChange {
  bool created = false;    // false: `change.record` is a job that was there, with the same name or request id
  bool shares = false;     // created, and has the work or the result of another job
  Room room = Room::kYes;  // otherwise there was no room, nothing has changed, and `change` is empty
  JobChange change;        // QUEUED, and then RUNNING or SUCCEEDED if it joined running work or got a result
};

struct ClaimRequest {
  std::string owner;                           // not empty
  absl::Duration lease;                        // duration of the lease
  int most = 1;                                // maximal number of pieces of work
  std::int64_t memory_bytes = 0;               // limit on the sum over this owner's work; 0: no limit
  std::string work;                            // not empty: claims this work only, out of turn
  TenantLimitsSource tenant_limits = nullptr;  // null: default limits for all tenants
  double seconds_factor = 1;                   // recent run times divided by the expected ones
  // Work with a longer expected run time is long. The owner may have at most `most_long` pieces of it.
  absl::Duration long_from = absl::InfiniteDuration();
  int most_long = 0;
};

// How long a claim waited for its turn among concurrent claims.
struct ClaimWait {
  absl::Duration queued;
  bool gave_up = false;  // the claim ended without looking for work
};

struct ClaimedWork {
  Lease lease;
  absl::Duration run_time;  // NewJob::run_time
  std::int64_t memory_bytes = 0;
  Wish wish = Wish::kGoOn;
  std::vector<JobChange> jobs;  // all jobs of the work, at least one; now RUNNING
};

// How an attempt ended.
struct AttemptOutcome {
  struct Loss {
    std::string reason, message;                  // see WorkerLoss
    std::map<std::string, std::string> metadata;  // see WorkerLoss
    bool is_final = false;                        // another attempt would be lost as well
  };

  std::vector<v1::Progress> progress;  // progress that was not reported yet
  google::rpc::Status status;          // the worker's answer: OK, CANCELLED, or an error
  v1::Report report;                   // with OK
  v1::UvDescription uv;                // with OK
  std::optional<Loss> loss;            // set if the worker was lost without an answer
  // Not 0: the reservation was too small. The work waits for another attempt with this reservation, regardless of
  // `status`.
  std::int64_t memory_bytes = 0;
  std::vector<BlobRow> blobs;  // the UV, if they are a small blob
};

struct StoreNews {
  bool work = false;               // there may be work to claim
  bool everything = false;         // notifications were lost: anything may have changed
  bool local = false;              // the change was made through this object
  std::vector<std::string> jobs;   // names of jobs with new events
  std::vector<std::string> works;  // names of running work whose Wish changed
};

enum class EarlyEnd { kCancel, kTimeout };

// How far the events of a job have come.
struct JobPosition {
  std::int64_t number = 0;
  std::int64_t last_sequence = 0;  // sequence of its newest event; 0: no event yet
  bool ended = false;
};

struct JobQuery {
  std::int64_t before_number = 0;  // only records with a lower number; 0: all records
  JobFilter filter;                // only records that match
  bool with_reports = false;
  int limit = 0;  // maximal number of records; 0: no limit
};

struct TenantTotals {
  std::int64_t ended = 0;         // jobs in terminal states
  std::int64_t result_bytes = 0;  // UV of jobs that SUCCEEDED
  std::int64_t record_bytes = 0;  // records, reports and events of ended jobs
};

// The number of unfinished jobs of one tenant with the same state and priority.
struct JobCount {
  std::string tenant;
  v1::JobState state = v1::JOB_STATE_UNSPECIFIED;
  v1::Priority priority = v1::PRIORITY_UNSPECIFIED;
  std::int64_t jobs = 0;
  absl::Time first;  // the earliest Job.create_time
};

// Numbers of unfinished jobs and work.
struct QueueCounts {
  std::vector<JobCount> jobs;
  std::int64_t waiting_works = 0;
  std::int64_t running_works = 0, reserved_bytes = 0;          // of all owners
  std::int64_t own_running_works = 0, own_reserved_bytes = 0;  // of `owner`
  absl::Time now;
};

struct JobTotals {
  std::map<std::string, TenantTotals> tenants;  // tenants that have records
};

struct JobStoreOptions {
  // The store's clock. Null: the database's own clock if it has one (SqlDatabase::has_clock), else absl::Now.
  std::function<absl::Time()> clock;
};

// Thread-safe. Every function may return RESOURCE_EXHAUSTED with STORAGE_FULL, UNAVAILABLE with STORE_UNAVAILABLE, or
// INTERNAL, besides the errors named at it. A verb that fails has changed nothing, except as said under "Lost answers".
// A job is named by Job.name; an unknown name is NOT_FOUND with JOB_NOT_FOUND. "Durable later" means that a loss of
// power may undo the verb.
class JobStore {
 public:
  // Works with any database that speaks the dialect of SqlConnection.
  explicit JobStore(std::unique_ptr<SqlDatabase> database, JobStoreOptions options = {});
  ~JobStore();

  JobStore(const JobStore&) = delete;
  JobStore& operator=(const JobStore&) = delete;

  // Identifies the store; the same after a restart.
  const std::string& id() const;

  // The store's clock.
  absl::StatusOr<absl::Time> Now();

  // Whether other processes may use the store at the same time.
  bool is_shared() const;

  // ---- verbs for callers

  // Adds the job, its blobs and its first events, or finds the job that has the same name or request id. The work key
  // of a job found by request id may differ; the caller checks that. Concurrent transactions of several processes may
  // each exceed NewJob::limits by one job.
  absl::StatusOr<AcceptedChange> Accept(const VerbContext& context, NewJob job);
  // Accepts several jobs in one commit, in their order. The answers are in the same order.
  std::vector<absl::StatusOr<AcceptedChange>> AcceptAll(const VerbContext& context, std::vector<NewJob> jobs);

  // Ends a job as CANCELLED, or as FAILED with DEADLINE_EXCEEDED. If a worker runs its work for this job alone, the job
  // is STOPPING until Finish(). No effect on a job that has ended or was ended early before. `forget` frees its request
  // id.
  absl::StatusOr<JobChange> EndEarly(const VerbContext& context, const std::string& name, EarlyEnd why, bool forget);
  // Sets Job.stop_requested; RUNNING becomes STOPPING. No effect on a job that has ended.
  absl::StatusOr<JobChange> RequestStop(const VerbContext& context, const std::string& name);
  // Ends a job as FAILED with `error`, also while a worker has it. No effect on a job that has ended. `forget` frees
  // its request id.
  absl::StatusOr<JobChange> Fail(const VerbContext& context, const std::string& name, const google::rpc::Status& error,
                                 bool forget);
  // The job no longer belongs to its callers (JobRecord.attached).
  absl::StatusOr<JobChange> Detach(const std::string& name);
  // The callers of these jobs are present: JobRecord.callers_until becomes `time` from now. No effect on jobs that have
  // ended or have no callers. Durable later.
  absl::Status KeepCallers(const std::vector<std::string>& names, absl::Duration time);

  // ---- verbs for workers

  // Takes waiting work, in the order of fair_share.h. Work that needs more memory than the owner has free blocks the
  // work behind it for this owner; work that needs more than `memory_bytes` is left to other owners. Work that lost a
  // server before and is on its last attempt is claimed only by an owner that runs nothing, and runs alone. A claim may
  // end without work because too many claims run at the same time; then `wait`, unless null, says so.
  absl::StatusOr<std::vector<ClaimedWork>> Claim(const VerbContext& context, const ClaimRequest& request,
                                                 ClaimWait* wait = nullptr);
  // The owner's running work with a wish other than kGoOn.
  absl::StatusOr<std::vector<std::pair<std::string, Wish>>> Wishes(const std::string& owner);
  // Extends leases of one owner to `lease` from now. Returns the wish for each, in the same order.
  absl::StatusOr<std::vector<Wish>> Renew(const std::vector<Lease>& leases, absl::Duration lease);
  // Adds the progress to the events of all jobs of the work. Of a long job the newest few thousand progress events are
  // kept. Durable later.
  absl::StatusOr<std::vector<JobChange>> Report(const VerbContext& context, const Lease& lease,
                                                const std::vector<v1::Progress>& progress);
  // Ends the attempt. Its jobs end, or are queued again after a loss or with a larger reservation.
  absl::StatusOr<std::vector<JobChange>> Finish(const VerbContext& context, const Lease& lease,
                                                const AttemptOutcome& outcome);
  // Gives up all work of the owner, or only `work` unless that is empty. The work is queued again in its old place, and
  // the attempt does not count as lost. Jobs that are being cancelled or have timed out end.
  absl::StatusOr<std::vector<JobChange>> Release(const VerbContext& context, const std::string& owner,
                                                 const std::string& work = {});

  // ---- verbs for upkeep

  // Handles up to `most` pieces of work with expired leases: queues them again, or fails their jobs with SERVER_CRASHED
  // after the last attempt. `sole_owner`, unless empty, has the store to itself: the leases of all other owners count
  // as expired.
  absl::StatusOr<std::vector<JobChange>> Reap(const VerbContext& context, const std::string& sole_owner, int most);
  // Handles up to `most` pieces of work with overdue jobs. Jobs without callers are cancelled, and their request ids
  // are free again; jobs past Scheduling.timeout end with DEADLINE_EXCEEDED; jobs past their compute budget are
  // stopped.
  absl::StatusOr<std::vector<JobChange>> EndOverdue(const VerbContext& context, int most);
  // SUCCEEDED becomes EXPIRED, and the request id is free again. No effect in other states. Durable later.
  absl::StatusOr<JobChange> Expire(const VerbContext& context, const std::string& name);
  // Deletes a job that has ended, with its events. FAILED_PRECONDITION with JOB_NOT_FINISHED. Durable later.
  absl::Status Delete(const std::string& name);
  // Deletes up to `most` ended jobs of the tenant (empty: of all tenants), in the order in which they ended, skipping
  // jobs locked by others. Returns their records. Durable later.
  absl::StatusOr<std::vector<JobRecord>> DeleteOldest(const std::string& tenant, int most);

  // ---- questions

  absl::StatusOr<std::optional<JobRecord>> Find(const std::string& name);
  absl::StatusOr<std::optional<JobRecord>> FindByRequestId(const std::string& tenant, const std::string& request_id);
  // The newest SUCCEEDED job with this work key.
  absl::StatusOr<std::optional<JobRecord>> FindResult(const std::string& work_key);
  // The matching records, newest first.
  absl::StatusOr<std::vector<JobRecord>> List(const JobQuery& query);
  // Jobs that have not ended, oldest first.
  absl::StatusOr<std::vector<JobRecord>> Unfinished();
  // The job of the tenant (empty: of any) with this terminal state (UNSPECIFIED: any) that ended first.
  absl::StatusOr<std::optional<JobRecord>> FirstEnded(const std::string& tenant, v1::JobState state);
  absl::StatusOr<JobTotals> Totals();
  absl::StatusOr<FairAccounts> Accounts();
  // `owner`: the owner for QueueCounts::own_running_works and own_reserved_bytes; may be empty.
  absl::StatusOr<QueueCounts> Counts(const std::string& owner);
  absl::StatusOr<QueueState> Queue();
  // Whether the tenant has an unfinished job with this work key.
  absl::StatusOr<bool> IsUnderWay(const std::string& tenant, const std::string& work_key);
  // The tenant's job that ended last.
  absl::StatusOr<std::optional<JobRecord>> LastEnded(const std::string& tenant);
  // The newest progress of a job that has not ended.
  absl::StatusOr<std::optional<v1::Progress>> LastProgress(std::int64_t number);
  // Events with a sequence greater than `after`, in order. The last event of an ended job has no report: the record has
  // it.
  absl::StatusOr<std::vector<v1::JobEvent>> Events(std::int64_t number, std::int64_t after = 0);
  // The positions of those jobs that exist, in any order.
  absl::StatusOr<std::vector<JobPosition>> Positions(const std::vector<std::int64_t>& numbers);
  // Whether a record needs this blob: the mesh of an unfinished job, or the UV of a SUCCEEDED one.
  absl::StatusOr<bool> UsesBlob(const BlobId& id);

  // Calls `listener` after jobs or claimable work change, in any process, on any thread. It must return quickly and
  // must not call the store. It is never called again once the subscription is dropped.
  using Listener = std::function<void(const StoreNews& news)>;
  using Subscription = std::shared_ptr<void>;
  [[nodiscard]] Subscription Subscribe(Listener listener);
  // Whether listeners are notified of changes by other processes. If not (PostgresOptions::must_hear), poll often.
  bool hears_others() const;

  // Where verbs put small blobs, for BlobPlaces::rows. Null for a store in memory. Lives as long as the store.
  BlobRows* rows();

 private:
  struct Parts;  // job_store_parts.h

  const std::unique_ptr<Parts> parts_;
};

// A JobStore on the database of OpenSqliteDatabase(path, give_up_reserve).
absl::StatusOr<std::unique_ptr<JobStore>> OpenJobStore(const std::string& path,
                                                       std::function<bool()> give_up_reserve = nullptr);

// Errors that several parts give: NOT_FOUND with JOB_NOT_FOUND; ABORTED with LEASE_LOST.
absl::Status JobNotFound(const std::string& name);
absl::Status LeaseLost(const Lease& lease);

}  // namespace planish
