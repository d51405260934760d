#include "server/jobs/job_manager.h"

#include <algorithm>
#include <optional>
#include <utility>

#include "absl/strings/str_cat.h"
#include "core/base/error.h"
#include "core/base/status_macros.h"
#include "google/protobuf/util/time_util.h"
#include "server/jobs/page_token.h"
#include "server/link/rpc_status.h"
#include "server/store/lifecycle.h"

namespace planish {
namespace {

constexpr int kDefaultPageSize = 50;
constexpr int kMaxPageSize = 1000;
// Limits of a page with reports, which may be hundreds of KB each: the number of jobs that are read for it, and the
// bytes after which it ends. Clients accept messages of 4 MiB unless they set a higher limit.
constexpr int kMaxFullPageSize = 50;
constexpr std::size_t kFullPageBytes = std::size_t{2} << 20;

// Pieces of work that one transaction ends or takes over.
constexpr int kSlice = 100;

// How often, together, all servers that share a store look for overdue jobs and expired leases, and for results and
// records whose retention has ended.
constexpr double kLooksPerSecond = 20;
constexpr double kTidiesPerSecond = 5;
constexpr absl::Duration kLeastLookInterval = absl::Milliseconds(100), kLeastTidyInterval = absl::Seconds(1);

absl::Status ResultExpired(const std::string& name) {
  return MakeError(absl::StatusCode::kNotFound, "RESULT_EXPIRED",
                   absl::StrCat("the UV of ", name, " were dropped: the server keeps results for a limited time"),
                   {{"job", name}});
}

absl::Status JobNotFinished(const v1::Job& job, const std::string& advice) {
  return MakeError(absl::StatusCode::kFailedPrecondition, "JOB_NOT_FINISHED",
                   absl::StrCat(job.name(), " is ", StateName(job.state()), ": ", advice), {{"job", job.name()}});
}

}  // namespace

// ---- beginning

absl::StatusOr<std::unique_ptr<JobManager>> JobManager::Open(JobManagerOptions options, JobStore* store,
                                                             BlobCatalog* blobs) {
  std::unique_ptr<JobManager> manager(new JobManager(std::move(options), store, blobs));
  PLANISH_RETURN_IF_ERROR(manager->Recover());
  return manager;
}

JobManager::JobManager(JobManagerOptions options, JobStore* store, BlobCatalog* blobs)
    : context_(std::move(options), store, blobs),
      feed_(&context_),
      callers_(&context_),
      retention_(&context_),
      runner_(&context_, &feed_, &retention_, context_.options.new_id()),
      admission_(&context_, &feed_, &callers_, &retention_, [this] { return runner_.seconds_factor(); }) {
  context_.on_due = [this] { EndOverdue(); };
  context_.on_end = [this] { CheckIdle(); };
}

absl::Status JobManager::Recover() {
  if (context_.store.is_shared()) return absl::OkStatus();  // leases expire by themselves
  // A server that shut down in order has released its leases. The leases that are left are of a server that died,
  // perhaps because of these jobs, so the attempts count.
  for (;;) {
    PLANISH_ASSIGN_OR_RETURN(const std::vector<JobChange> lost,
                             context_.store.Reap(context_.Verb(), runner_.owner(), kSlice));
    if (lost.empty()) break;
    feed_.Tell(lost);
  }
  PLANISH_ASSIGN_OR_RETURN(const std::vector<JobRecord> records, context_.store.Unfinished());
  std::vector<std::string> attached;
  for (const JobRecord& record : records) {
    PLANISH_RETURN_IF_ERROR(RecoverJob(record));
    if (record.attached()) attached.push_back(record.job().name());
  }
  if (!attached.empty()) {
    PLANISH_RETURN_IF_ERROR(context_.store.KeepCallers(attached, context_.Limits().reattach_grace));
  }
  retention_.Open();
  return absl::OkStatus();
}

absl::Status JobManager::RecoverJob(const JobRecord& record) {
  const v1::Job& job = record.job();
  const auto fail = [&](const absl::Status& error, bool forget) -> absl::Status {
    PLANISH_ASSIGN_OR_RETURN(const JobChange change,
                             context_.store.Fail(context_.Verb(), job.name(), ToRpcStatus(error), forget));
    feed_.Tell({change});
    return absl::OkStatus();
  };
  const absl::StatusOr<std::vector<BlobPtr>> blobs = runner_.LoadBlobs(record);
  // `forget` frees the job's request id, so that a caller who has the mesh can send it again for a new job.
  if (IsLost(blobs.status())) {
    return fail(JobRunner::MeshLost(blobs.status()), /*forget=*/true);
  }
  PLANISH_RETURN_IF_ERROR(blobs.status());
  std::optional<std::int64_t> array_vertices;
  if (record.has_array_vertices()) array_vertices = record.array_vertices();
  const absl::Status needs = admission_
                                 .NeedsOf(job.tenant(), blobs->front()->bytes(), array_vertices, job.mesh_bytes(),
                                          v1::MeshSize(), job.options())
                                 .status();
  return needs.ok() ? absl::OkStatus() : fail(needs, /*forget=*/false);
}

// ---- callers

absl::Status JobManager::Draining() const {
  if (!draining_) return absl::OkStatus();
  const char* const why = ending_ ? "the server is shutting down and takes no new jobs"
                                  : "an operator is draining the server: it takes no new jobs at the moment";
  return WithRetryDelay(MakeError(absl::StatusCode::kUnavailable, "DRAINING", why), context_.options.retry_delay);
}

absl::StatusOr<AcceptedJob> JobManager::Create(const Caller& caller, JobRequest request) {
  return admission_.Create(caller, std::move(request), Draining());
}

std::vector<absl::StatusOr<AcceptedJob>> JobManager::CreateAll(const Caller& caller, std::vector<JobRequest> requests) {
  return admission_.CreateAll(caller, std::move(requests), Draining());
}

absl::StatusOr<v1::Job> JobManager::Snapshot(const JobRecord& record) const {
  v1::Job job = record.job();
  if (job.state() == v1::JOB_STATE_QUEUED) {
    PLANISH_ASSIGN_OR_RETURN(const int position, admission_.PositionOf(record));
    job.set_queue_position(position);
  } else if (!IsTerminal(job.state())) {
    PLANISH_ASSIGN_OR_RETURN(std::optional<v1::Progress> progress, context_.store.LastProgress(record.number()));
    if (progress.has_value()) *job.mutable_progress() = *std::move(progress);
  }
  return job;
}

absl::StatusOr<JobRecord> JobManager::Find(const Caller& caller, const std::string& name, bool may_follow) const {
  PLANISH_ASSIGN_OR_RETURN(std::optional<JobRecord> record, context_.store.Find(name));
  if (!record.has_value()) return JobNotFound(name);
  const std::string& tenant = record->job().tenant();
  const bool follows =
      may_follow && caller.rights.submit && tenant == caller.tenant && record->credential() == caller.credential;
  if (!caller.MaySee(tenant) && !follows) return JobNotFound(name);
  return *std::move(record);
}

absl::StatusOr<v1::Job> JobManager::Get(const Caller& caller, const std::string& name, bool may_follow) const {
  PLANISH_ASSIGN_OR_RETURN(const JobRecord record, Find(caller, name, may_follow));
  return Snapshot(record);
}

absl::StatusOr<JobPage> JobManager::List(const Caller& caller, const v1::ListJobsRequest& request) const {
  if (request.page_size() < 0) {
    return MakeError(absl::StatusCode::kInvalidArgument, "REQUEST_INVALID", "page_size is negative",
                     {{"field", "page_size"}});
  }
  JobQuery query;
  PLANISH_ASSIGN_OR_RETURN(query.filter, ParseJobFilter(request.filter()));
  const std::string asked_for = query.filter.tenant;
  const std::string tenant = caller.rights.all_jobs ? asked_for : caller.tenant;
  query.filter.tenant = tenant;
  query.with_reports = request.view() == v1::JOB_VIEW_FULL;
  const PageList list = {context_.store.id(), tenant, request.filter()};
  PLANISH_ASSIGN_OR_RETURN(query.before_number, DecodePageToken(request.page_token(), list));
  const int most = query.with_reports ? kMaxFullPageSize : kMaxPageSize;
  const int limit = std::min(request.page_size() == 0 ? kDefaultPageSize : request.page_size(), most);
  query.limit = limit + 1;
  // A tenant whose jobs the caller may not see appears to have none.
  const bool asks_for_others = !asked_for.empty() && asked_for != tenant;
  if (asks_for_others || (!caller.rights.all_jobs && !caller.MaySee(tenant))) return JobPage();

  PLANISH_ASSIGN_OR_RETURN(const std::vector<JobRecord> records, context_.store.List(query));
  JobPage page;
  std::size_t bytes = 0;
  for (const JobRecord& record : records) {
    PLANISH_ASSIGN_OR_RETURN(const v1::Job job, Snapshot(record));
    page.jobs.push_back(job);
    bytes += job.ByteSizeLong();
    const bool is_full = static_cast<int>(page.jobs.size()) == limit || (query.with_reports && bytes > kFullPageBytes);
    if (is_full && &record != &records.back()) {
      page.next_page_token = EncodePageToken(list, record.number());
      break;
    }
  }
  return page;
}

absl::StatusOr<WatchedJob> JobManager::Watch(const Caller& caller, const std::string& name, bool attach,
                                             bool include_uv) {
  PLANISH_ASSIGN_OR_RETURN(const JobRecord record, Find(caller, name, /*may_follow=*/true));
  WatchedJob watched;
  PLANISH_ASSIGN_OR_RETURN(watched.events, feed_.Open(record));
  const v1::JobState state = record.job().state();
  if (!IsTerminal(state) && attach && record.attached()) {
    watched.attachment = callers_.Attach(name, /*known=*/false);
  }
  const bool had_uv = state == v1::JOB_STATE_SUCCEEDED || state == v1::JOB_STATE_EXPIRED;
  if (include_uv && had_uv && watched.events->uv() == nullptr) return ResultExpired(name);
  return watched;
}

absl::StatusOr<JobResult> JobManager::OpenResult(const Caller& caller, const std::string& name) {
  PLANISH_ASSIGN_OR_RETURN(const JobRecord record, Find(caller, name, /*may_follow=*/true));
  const v1::Job& job = record.job();
  if (!IsTerminal(job.state())) return JobNotFinished(job, "wait for it");
  if (job.state() == v1::JOB_STATE_EXPIRED) return ResultExpired(name);
  if (job.state() != v1::JOB_STATE_SUCCEEDED) {
    return MakeError(absl::StatusCode::kFailedPrecondition, "NO_RESULT",
                     absl::StrCat(name, " is ", StateName(job.state()), ": there are no UV"), {{"job", name}});
  }
  absl::StatusOr<StoredBlobPtr> uv = context_.blobs.Find({job.tenant(), job.uv().uv_sha256()});
  if (IsLost(uv.status())) return ResultExpired(name);
  if (!uv.ok()) return WithRetryDelay(uv.status(), context_.options.retry_delay);
  return JobResult{job.uv(), *std::move(uv)};
}

absl::StatusOr<v1::Job> JobManager::Change(const Caller& caller, const std::string& name,
                                           const std::function<absl::StatusOr<JobChange>()>& verb) {
  PLANISH_ASSIGN_OR_RETURN(const JobRecord record, Find(caller, name, /*may_follow=*/true));
  if (IsTerminal(record.job().state())) return Snapshot(record);
  if (suspended_) {
    return WithRetryDelay(MakeError(absl::StatusCode::kUnavailable, "DRAINING",
                                    "the server is shutting down; the job goes on when it is back"),
                          context_.options.retry_delay);
  }
  PLANISH_RETURN_IF_ERROR(runner_.CheckWritten(record.work(), name));
  const absl::StatusOr<JobChange> change = verb();
  if (!change.ok()) {
    context_.TellError(change.status());
    return WithRetryDelay(change.status(), context_.options.retry_delay);
  }
  Adopt({*change});
  return Snapshot(change->record);
}

absl::StatusOr<v1::Job> JobManager::Cancel(const Caller& caller, const std::string& name) {
  return Change(caller, name,
                [&] { return context_.store.EndEarly(context_.Verb(), name, EarlyEnd::kCancel, /*forget=*/false); });
}

absl::StatusOr<v1::Job> JobManager::Stop(const Caller& caller, const std::string& name) {
  return Change(caller, name, [&] { return context_.store.RequestStop(context_.Verb(), name); });
}

absl::Status JobManager::Delete(const Caller& caller, const std::string& name) {
  PLANISH_ASSIGN_OR_RETURN(const JobRecord record, Find(caller, name));
  if (!IsTerminal(record.job().state())) return JobNotFinished(record.job(), "cancel it first");
  return retention_.Forget(record);
}

absl::StatusOr<v1::JobEstimate> JobManager::Estimate(const Caller& caller, const JobRequest& request,
                                                     std::int64_t mesh_bytes, const v1::MeshSize& size) const {
  return admission_.Estimate(caller, request, mesh_bytes, size);
}

int JobManager::QueueCapacity(const Caller& caller) const {
  return admission_.LimitsOf(caller.tenant).tenant_jobs;
}

// ---- operators

void JobManager::SetLimits(const JobLimits& limits) {
  context_.SetLimits(limits);
  retention_.NoteLimits();
}

bool JobManager::MakeRoom(const std::string& tenant, std::int64_t bytes) {
  return !suspended_ && retention_.MakeRoom(tenant, bytes);
}

ManagerStats JobManager::Stats() const {
  const JobManagerOptions& options = context_.options;
  ManagerStats stats;
  stats.store_id = context_.store.id();
  stats.draining = draining_;
  const JobCapacity capacity = context_.Capacity();
  stats.workers = capacity.workers;
  stats.own_workers = options.workers;
  stats.all_memory_bytes = capacity.total_memory_bytes;
  stats.queue_total = options.queue_total;
  stats.stored_bytes = context_.blobs.bytes();
  stats.store_bytes = context_.blobs.max_bytes();
  std::map<std::string, TenantStats> tenants;
  admission_.AddCalls(&tenants, &stats.refused_by_reason);
  const absl::StatusOr<QueueCounts> counts = context_.store.Counts(runner_.owner());
  const absl::StatusOr<JobTotals> totals = context_.store.Totals();
  stats.store_answered = counts.ok() && totals.ok();
  if (counts.ok()) {
    stats.queued_work = static_cast<int>(counts->waiting_works);
    stats.running_work = static_cast<int>(counts->own_running_works);
    stats.all_reserved_bytes = counts->reserved_bytes;
    stats.reserved_memory_bytes = counts->own_reserved_bytes;
    for (const JobCount& jobs : counts->jobs) stats.Add(jobs, counts->now, &tenants[jobs.tenant]);
  }
  if (totals.ok()) {
    for (const auto& [tenant, each] : totals->tenants) tenants[tenant].ended_kept = each.ended;
  }
  for (auto& [name, tenant] : tenants) {
    tenant.tenant = name;
    tenant.stored_bytes = context_.blobs.bytes(name);
    stats.tenants.push_back(std::move(tenant));
  }
  return stats;
}

void ManagerStats::Add(const JobCount& counted, absl::Time now, TenantStats* tenant) {
  const int jobs = static_cast<int>(counted.jobs);
  if (counted.state != v1::JOB_STATE_QUEUED) {
    running += jobs;
    tenant->running += jobs;
    return;
  }
  queued += jobs;
  tenant->queued += jobs;
  const bool is_normal = counted.priority == v1::PRIORITY_UNSPECIFIED;
  WaitingJobs& waiting = tenant->waiting[is_normal ? v1::PRIORITY_NORMAL : counted.priority];
  waiting.jobs += jobs;
  waiting.longest = std::max(waiting.longest, now - counted.first);
  oldest_wait = std::max(oldest_wait, waiting.longest);
}

// ---- upkeep

void JobManager::Adopt(const std::vector<JobChange>& changes) {
  feed_.Tell(changes);
  runner_.ObeyWishes();
  retention_.NoteEnds(changes);
  CheckIdle();
}

void JobManager::EndOverdue() {
  if (suspended_) return;
  const absl::StatusOr<std::vector<JobChange>> changes = context_.store.EndOverdue(context_.Verb(), kSlice);
  if (!changes.ok()) return context_.TellError(changes.status());
  if (!changes->empty()) Adopt(*changes);
}

void JobManager::Reap() {
  const absl::StatusOr<std::vector<JobChange>> changes = context_.store.Reap(context_.Verb(), "", kSlice);
  if (!changes.ok()) return context_.TellError(changes.status());
  if (!changes->empty()) Adopt(*changes);
}

void JobManager::Tick() {
  if (suspended_) return;
  runner_.Tick();  // first, so that this server's own leases do not expire
  callers_.Renew();
  if (const absl::Time now = context_.options.steady_clock(); now >= next_look_) {
    next_look_ = now + context_.Pace(kLooksPerSecond, kLeastLookInterval);
    EndOverdue();
    Reap();
  }
  feed_.Refresh();
  if (!context_.store.is_shared()) Tidy();
  CheckIdle();
}

void JobManager::Tidy() {
  const absl::Time now = context_.options.steady_clock();
  if (suspended_ || now < next_tidying_) return;
  next_tidying_ = now + context_.Pace(kTidiesPerSecond, kLeastTidyInterval);
  retention_.Retain();
  retention_.CollectBlobs();
}

// ---- shutdown

bool JobManager::IsIdle() const {
  if (context_.store.is_shared()) return runner_.running() == 0;
  const absl::StatusOr<FairAccounts> accounts = context_.store.Accounts();
  return accounts.ok() && std::all_of(accounts->tenants.begin(), accounts->tenants.end(), [](const auto& each) {
           return each.second.waiting == 0 && each.second.running == 0;
         });
}

void JobManager::CheckIdle() {
  {
    const std::lock_guard lock(mutex_);
    if (on_idle_ == nullptr) return;
  }
  if (!IsIdle()) return;
  std::function<void()> on_idle;
  {
    const std::lock_guard lock(mutex_);
    on_idle.swap(on_idle_);
  }
  if (on_idle) on_idle();
}

void JobManager::Drain(std::function<void()> on_idle) {
  draining_ = true;
  if (on_idle == nullptr) return;
  ending_ = true;
  {
    const std::lock_guard lock(mutex_);
    on_idle_ = std::move(on_idle);
  }
  if (context_.store.is_shared()) runner_.Stop();
  CheckIdle();
}

absl::Status JobManager::Undrain() {
  if (ending_ || suspended_) {
    return MakeError(absl::StatusCode::kFailedPrecondition, "SHUTTING_DOWN",
                     "the server is shutting down, which cannot be undone");
  }
  draining_ = false;
  return absl::OkStatus();
}

void JobManager::CancelAll() {
  if (suspended_ || context_.store.is_shared()) return;
  const absl::StatusOr<std::vector<JobRecord>> jobs = context_.store.Unfinished();
  if (!jobs.ok()) return context_.TellError(jobs.status());
  for (const JobRecord& record : *jobs) {
    const absl::StatusOr<JobChange> change =
        context_.store.EndEarly(context_.Verb(), record.job().name(), EarlyEnd::kCancel, /*forget=*/false);
    change.ok() ? Adopt({*change}) : context_.TellError(change.status());
  }
}

void JobManager::FailAll(const absl::Status& error) {
  draining_ = ending_ = true;
  if (suspended_ || context_.store.is_shared()) return;
  const absl::StatusOr<std::vector<JobRecord>> jobs = context_.store.Unfinished();
  if (!jobs.ok()) return context_.TellError(jobs.status());
  for (const JobRecord& record : *jobs) {
    const absl::StatusOr<JobChange> change =
        context_.store.Fail(context_.Verb(), record.job().name(), ToRpcStatus(error), /*forget=*/false);
    change.ok() ? Adopt({*change}) : context_.TellError(change.status());
  }
}

void JobManager::Suspend() {
  draining_ = ending_ = suspended_ = true;
  runner_.Stop();
  callers_.Suspend();
  runner_.GiveBack();
  feed_.Interrupt(WithRetryDelay(MakeError(absl::StatusCode::kUnavailable, "DRAINING",
                                           "the server is shutting down; the job goes on when it is back"),
                                 context_.options.retry_delay));
  std::function<void()> on_idle;
  {
    const std::lock_guard lock(mutex_);
    on_idle.swap(on_idle_);
  }
  if (on_idle) on_idle();
}

}  // namespace planish
