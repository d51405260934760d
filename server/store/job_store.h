// Where jobs are, and the only ways to change them.
//
// Every function that changes something is a verb, in a file of its own or with its like: one transaction, which reads
// what is there, decides, and writes the records, their events and small blobs, or nothing at all. Any number of
// processes may use one store (PostgreSQL) at the same time.
//
// Work. All jobs of a tenant that ask for the same are one piece of work (JobRecord.work), unless Scheduling.fresh. It
// is queued, claimed, lost and finished as one; each of its jobs may be stopped or cancelled alone.
//
// Leases. Who claims work has a lease: (work, attempt, owner), where attempts count 1, 2, ... for each work. It lasts
// until it is finished, released, or lost: when its time is over without a Renew(), somebody's Reap() takes it away.
// Whatever is said under another lease than the present one changes nothing and is ABORTED with LEASE_LOST (fencing).
//
// Whose turn it is. Claim() decides between tenants by what each had of the workers (fair_share.h), within a tenant by
// age and priority.
//
// Limits of time. What a job may take and how long it waits for callers that are gone stands in its record; whoever
// calls EndOverdue() sees to it.
//
// News. Whoever subscribes hears of changes by all processes, soon, and not of each for sure: look at the store every
// few seconds as well.
//
// Clock. Everything goes by one clock, that of the store (Now()): the times in records and events, leases, limits of
// time, and what is old enough to go. So the clocks of the machines that use a store decide nothing. Callers give
// durations, never times.
//
// Answers that are lost. After UNAVAILABLE a verb may have been done. Each may be repeated: Accept() finds the job by
// its name, Finish() says LEASE_LOST, what Claim() took is lost when its lease ends, and all others have no further
// effect but for Report(), whose news are told twice.
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

// Of whoever asks.
struct VerbContext {
  absl::Duration retained_time = absl::InfiniteDuration();  // Job.expire_time of those that succeed
  int max_attempts = 3;                                     // that a job may lose with their worker or server
};

// What a verb made of one job.
struct JobChange {
  JobRecord record;                  // as it is now
  std::vector<v1::JobEvent> events;  // that were written, in order; those of an end have the report
};

struct Lease {
  std::string work;
  int attempt = 0;
  std::string owner;
};

// What is wanted of an attempt.
enum class Wish {
  kGoOn,
  kStop,    // all of its jobs want the best map so far
  kCancel,  // nobody wants the result
  kGiveUp,  // the lease is lost: somebody else may be at it
};

// A piece of work that has not ended. Times in nanoseconds since 1970.
struct WorkRow {
  std::string name, tenant;
  std::int64_t number = 0;  // lowest of its jobs
  bool running = false;     // there is a lease, which may be over
  std::int64_t turn_time = 0;
  std::int64_t memory_bytes = 0;
  std::int64_t mesh_bytes = 0;
  std::int64_t run_time = 0;  // expected; a duration
  bool alone = false;         // nothing else may run on the same owner
  Wish wish = Wish::kGoOn;
  // While it runs, but for the attempt, which stays.
  std::string owner;
  int attempt = 0;
  std::int64_t lease_until = 0;
  std::int64_t start_time = 0;
  std::int64_t charge = 0;         // TenantAccount::charged
  std::int64_t share = 1'000'000;  // the tenant's when it was claimed, millionths

  bool operator==(const WorkRow&) const = default;
};

// What waits and runs.
struct QueueState {
  FairAccounts accounts;
  std::vector<WorkRow> works;  // in no order
  absl::Time now;
};

struct NewJob {
  // QUEUED, with a new name; `number`, `work` and the lease are the store's, and so is Job.create_time unless it is
  // set.
  JobRecord record;
  absl::Duration run_time;            // that its work is expected to take; 0: not known
  std::optional<QueueLimits> limits;  // for work that nobody shares; empty: none
  absl::Duration callers_for;         // of a record that is attached: JobRecord.callers_until, from now on
  std::vector<BlobRow> blobs;         // small ones that it refers to
  // Record of a job with the same work key whose result it gets if that is still kept; empty: none.
  std::string result_of;
};

struct AcceptedChange {
  bool created = false;    // false: `change.record` is a job that was there, with the same name or request id
  bool shares = false;     // created, and has the work or the result of another job
  Room room = Room::kYes;  // any other: there was no room, nothing has changed, and `change` is empty
  JobChange change;        // QUEUED, and then RUNNING or SUCCEEDED if it joined running work or got a result
};

struct ClaimRequest {
  std::string owner;                           // not empty
  absl::Duration lease;                        // how long, unless renewed
  int most = 1;                                // pieces of work
  std::int64_t memory_bytes = 0;               // that all work of this owner may reserve together; 0: any
  std::string work;                            // this one only, whosever turn it is, and not whatever is next
  TenantLimitsSource tenant_limits = nullptr;  // null: the defaults for everybody
  double seconds_factor = 1;                   // what work takes over what was expected of it, lately
  // Work that is expected to take longer is long, and the owner may have so many pieces of it.
  absl::Duration long_from = absl::InfiniteDuration();
  int most_long = 0;
};

// How a claim waited until few enough others were under way.
struct ClaimWait {
  absl::Duration queued;
  bool gave_up = false;  // without looking for work
};

struct ClaimedWork {
  Lease lease;
  absl::Duration run_time;  // NewJob::run_time
  std::int64_t memory_bytes = 0;
  Wish wish = Wish::kGoOn;
  std::vector<JobChange> jobs;  // all of its jobs, at least one, which are RUNNING now
};

// How an attempt ended.
struct AttemptOutcome {
  struct Loss {
    std::string reason, message;                  // as of WorkerLoss
    std::map<std::string, std::string> metadata;  // likewise
    bool is_final = false;                        // another attempt would fare no better
  };

  std::vector<v1::Progress> progress;  // that was not reported before
  google::rpc::Status status;          // what the worker says: OK, CANCELLED, or an error
  v1::Report report;                   // with OK
  v1::UvDescription uv;                // likewise
  std::optional<Loss> loss;            // the worker is gone, and said nothing
  // Not 0: what was reserved did not do. The work waits for another attempt with this reservation, whatever `status`
  // says.
  std::int64_t memory_bytes = 0;
  std::vector<BlobRow> blobs;  // small ones: the UV
};

struct StoreNews {
  bool work = false;               // there may be work to claim
  bool everything = false;         // anything may have changed: messages were lost
  bool local = false;              // a verb of this very object did it
  std::vector<std::string> jobs;   // names of those with new events
  std::vector<std::string> works;  // names of running work of which something else is wanted than before, also its end
};

enum class EarlyEnd { kCancel, kTimeout };

// How far a job has come.
struct JobPosition {
  std::int64_t number = 0;
  std::int64_t last_sequence = 0;  // of its newest event; 0: none
  bool ended = false;
};

struct JobQuery {
  std::int64_t before_number = 0;  // only older records than this one; 0: all
  JobFilter filter;                // only records that this is true of
  bool with_reports = false;
  int limit = 0;  // at most this many; 0: any
};

struct TenantTotals {
  std::int64_t ended = 0;         // jobs in terminal states
  std::int64_t result_bytes = 0;  // of the UV of those that SUCCEEDED
  std::int64_t record_bytes = 0;  // of the records, reports and events of those that ended
};

// Jobs of one tenant that have not ended, have the same state and were given the same priority.
struct JobCount {
  std::string tenant;
  v1::JobState state = v1::JOB_STATE_UNSPECIFIED;
  v1::Priority priority = v1::PRIORITY_UNSPECIFIED;
  std::int64_t jobs = 0;
  absl::Time first;  // the earliest Job.create_time
};

// What has not ended.
struct QueueCounts {
  std::vector<JobCount> jobs;
  std::int64_t waiting_works = 0;
  std::int64_t running_works = 0, reserved_bytes = 0;          // of all owners
  std::int64_t own_running_works = 0, own_reserved_bytes = 0;  // of the one that asks
  absl::Time now;
};

struct JobTotals {
  std::map<std::string, TenantTotals> tenants;  // that have records
};

struct JobStoreOptions {
  // The store's. Null: the database's own clock where it has one (SqlDatabase::has_clock), else absl::Now.
  std::function<absl::Time()> clock;
};

// Thread-safe. Errors of all functions, beside those that they name: RESOURCE_EXHAUSTED with STORAGE_FULL, UNAVAILABLE
// with STORE_UNAVAILABLE, INTERNAL. A verb that fails changed nothing, except as said above. Jobs are named by
// Job.name; where there is none, NOT_FOUND with JOB_NOT_FOUND.
class JobStore {
 public:
  // Over any database that speaks SqlConnection's dialect.
  explicit JobStore(std::unique_ptr<SqlDatabase> database, JobStoreOptions options = {});
  ~JobStore();

  JobStore(const JobStore&) = delete;
  JobStore& operator=(const JobStore&) = delete;

  // Of this store, the same after a restart.
  const std::string& id() const;

  // By the store's clock.
  absl::StatusOr<absl::Time> Now();

  // Whether other processes may use it at the same time.
  bool is_shared() const;

  // ---- verbs of callers

  // Adds the job, its blobs and its first events; or finds the one that has its name, or its request id (whose work key
  // may differ: that is the caller's to refuse). Transactions of several processes at the same moment may exceed
  // NewJob::limits by one each.
  absl::StatusOr<AcceptedChange> Accept(const VerbContext& context, NewJob job);
  // The same for several jobs, which are committed together, in their order. The answers are in the same order.
  std::vector<absl::StatusOr<AcceptedChange>> AcceptAll(const VerbContext& context, std::vector<NewJob> jobs);

  // Ends a job that nobody works at, or whose work goes on for others: CANCELLED, or FAILED with DEADLINE_EXCEEDED. One
  // whose worker has to answer first is STOPPING until Finish(). No effect on a job that ended, or was ended so before.
  // `forget`: its request id is free again.
  absl::StatusOr<JobChange> EndEarly(const VerbContext& context, const std::string& name, EarlyEnd why, bool forget);
  // Sets Job.stop_requested; RUNNING becomes STOPPING. No effect on a job that ended.
  absl::StatusOr<JobChange> RequestStop(const VerbContext& context, const std::string& name);
  // FAILED with `error`, whoever works at it. No effect on a job that ended. `forget` as above.
  absl::StatusOr<JobChange> Fail(const VerbContext& context, const std::string& name, const google::rpc::Status& error,
                                 bool forget);
  // The job no longer belongs to its callers (JobRecord.attached).
  absl::StatusOr<JobChange> Detach(const std::string& name);
  // The callers of those jobs that have not ended and belong to callers are known to be there for `time` from now on
  // (JobRecord.callers_until); durable later.
  absl::Status KeepCallers(const std::vector<std::string>& names, absl::Duration time);

  // ---- verbs of those who run work

  // Takes work that waits, in the order of fair_share.h. Work that needs more memory than its owner has free keeps
  // those behind it waiting for that owner; work that needs more than `memory_bytes` is left to others. Work that was
  // lost with a server before and has one attempt left is claimed by an owner that has nothing else, and nothing beside
  // it. Where too many claims are under way for its turn to come soon, a claim ends without work; `wait`, unless null,
  // says so.
  absl::StatusOr<std::vector<ClaimedWork>> Claim(const VerbContext& context, const ClaimRequest& request,
                                                 ClaimWait* wait = nullptr);
  // Those of the owner's running works of which anything but kGoOn is wanted, as far as somebody asked for it.
  absl::StatusOr<std::vector<std::pair<std::string, Wish>>> Wishes(const std::string& owner);
  // Leases of one owner last `lease` from now on. What is wanted of each, in the same order.
  absl::StatusOr<std::vector<Wish>> Renew(const std::vector<Lease>& leases, absl::Duration lease);
  // Adds progress to the events of all jobs of the work, which get the same; durable later. Of the progress of long
  // work some thousand events are kept, the newest.
  absl::StatusOr<std::vector<JobChange>> Report(const VerbContext& context, const Lease& lease,
                                                const std::vector<v1::Progress>& progress);
  // Ends the attempt. Its jobs end, or are queued again: after a loss, or with a larger reservation.
  absl::StatusOr<std::vector<JobChange>> Finish(const VerbContext& context, const Lease& lease,
                                                const AttemptOutcome& outcome);
  // Gives up everything that the owner has: it is queued again in its old place, and the attempt is not held against
  // it. Jobs that were to end anyway end. `work` not empty: this one only.
  absl::StatusOr<std::vector<JobChange>> Release(const VerbContext& context, const std::string& owner,
                                                 const std::string& work = {});
  // ---- verbs of those who keep order

  // Queues again, or fails after the last attempt (SERVER_CRASHED), up to `most` pieces of work whose lease is over.
  // `sole_owner` not empty: its process has the store to itself, so leases of all others are over.
  absl::StatusOr<std::vector<JobChange>> Reap(const VerbContext& context, const std::string& sole_owner, int most);
  // Up to `most` pieces of work with jobs whose time is over: those without callers are cancelled, and their request
  // ids are free again; those beyond Scheduling.timeout end with DEADLINE_EXCEEDED; those beyond their compute budget
  // are stopped. As EndEarly() and RequestStop(); the changes of all.
  absl::StatusOr<std::vector<JobChange>> EndOverdue(const VerbContext& context, int most);
  // SUCCEEDED becomes EXPIRED, and its request id is free again; durable later. No effect on others.
  absl::StatusOr<JobChange> Expire(const VerbContext& context, const std::string& name);
  // A job that ended goes, with its events; durable later. FAILED_PRECONDITION with JOB_NOT_FINISHED.
  absl::Status Delete(const std::string& name);
  // Likewise up to `most` jobs of the tenant (empty: of all), those that ended first, but for any that somebody else is
  // at. Returns their records.
  absl::StatusOr<std::vector<JobRecord>> DeleteOldest(const std::string& tenant, int most);

  // ---- questions

  absl::StatusOr<std::optional<JobRecord>> Find(const std::string& name);
  absl::StatusOr<std::optional<JobRecord>> FindByRequestId(const std::string& tenant, const std::string& request_id);
  // The newest that SUCCEEDED at this work.
  absl::StatusOr<std::optional<JobRecord>> FindResult(const std::string& work_key);
  // Newest first.
  absl::StatusOr<std::vector<JobRecord>> List(const JobQuery& query);
  // Those that have not ended, oldest first.
  absl::StatusOr<std::vector<JobRecord>> Unfinished();
  // The record of the tenant (empty: of all) in one of the terminal states (UNSPECIFIED: any) that ended first.
  absl::StatusOr<std::optional<JobRecord>> FirstEnded(const std::string& tenant, v1::JobState state);
  absl::StatusOr<JobTotals> Totals();
  absl::StatusOr<FairAccounts> Accounts();
  // `owner` may be empty.
  absl::StatusOr<QueueCounts> Counts(const std::string& owner);
  absl::StatusOr<QueueState> Queue();
  // Whether a job of the tenant that has not ended does this work.
  absl::StatusOr<bool> IsUnderWay(const std::string& tenant, const std::string& work_key);
  // The tenant's job that ended last.
  absl::StatusOr<std::optional<JobRecord>> LastEnded(const std::string& tenant);
  // The newest that was reported of a job that has not ended.
  absl::StatusOr<std::optional<v1::Progress>> LastProgress(std::int64_t number);
  // Those with greater sequences than `after`, in order. The last one of a job that ended has no report: the record has
  // it.
  absl::StatusOr<std::vector<v1::JobEvent>> Events(std::int64_t number, std::int64_t after = 0);
  // Those of the jobs with these numbers that there are; in any order.
  absl::StatusOr<std::vector<JobPosition>> Positions(const std::vector<std::int64_t>& numbers);
  // Whether a record needs this blob: a mesh of a job that has not ended, UV of one that SUCCEEDED.
  absl::StatusOr<bool> UsesBlob(const BlobId& id);

  // Calls `listener` after changes of jobs and of what may be claimed, by any process, on any thread: it must be quick,
  // and must not call back. Never again once the subscription is dropped.
  using Listener = std::function<void(const StoreNews& news)>;
  using Subscription = std::shared_ptr<void>;
  [[nodiscard]] Subscription Subscribe(Listener listener);
  // Whether that includes what other processes do. Where it does not (PostgresOptions::must_hear), ask often.
  bool hears_others() const;

  // Where verbs put small blobs, for BlobPlaces::rows; null: nowhere, as in memory. Lives as long as the store.
  BlobRows* rows();

 private:
  struct Parts;  // job_store_parts.h

  const std::unique_ptr<Parts> parts_;
};

// With OpenSqliteDatabase().
absl::StatusOr<std::unique_ptr<JobStore>> OpenJobStore(const std::string& path,
                                                       std::function<bool()> give_up_reserve = nullptr);

// Errors that several parts give: NOT_FOUND with JOB_NOT_FOUND; ABORTED with LEASE_LOST.
absl::Status JobNotFound(const std::string& name);
absl::Status LeaseLost(const Lease& lease);

}  // namespace planish
