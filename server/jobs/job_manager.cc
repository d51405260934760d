#include "server/jobs/job_manager.h"

#include <algorithm>
#include <utility>

#include "absl/strings/str_cat.h"
#include "core/base/error.h"
#include "core/base/sha256.h"
#include "core/base/status_macros.h"
#include "google/protobuf/util/time_util.h"
#include "server/jobs/page_token.h"
#include "server/link/duration.h"
#include "server/link/rpc_status.h"

namespace planish {
namespace {

constexpr int kDefaultPageSize = 50;
constexpr int kMaxPageSize = 1000;
// Of a page with reports, which may be hundreds of KB each: the jobs that are read for it, and the bytes after which it
// ends. Clients take messages of 4 MiB unless they ask for more.
constexpr int kMaxFullPageSize = 50;
constexpr std::size_t kFullPageBytes = std::size_t{2} << 20;

absl::Status ResultExpired(const std::string& name) {
  return MakeError(absl::StatusCode::kNotFound, "RESULT_EXPIRED",
                   absl::StrCat("the UV of ", name, " were dropped: the server keeps results for some time only"),
                   {{"job", name}});
}

absl::Status JobNotFinished(const v1::Job& job, const std::string& advice) {
  return MakeError(absl::StatusCode::kFailedPrecondition, "JOB_NOT_FINISHED",
                   absl::StrCat(job.name(), " is ", StateName(job.state()), ": ", advice), {{"job", job.name()}});
}

}  // namespace

JobAttachment& JobAttachment::operator=(JobAttachment&& other) noexcept {
  Release();
  manager_ = std::exchange(other.manager_, nullptr);
  name_ = std::move(other.name_);
  return *this;
}

void JobAttachment::Release(bool for_good) {
  if (JobManager* manager = std::exchange(manager_, nullptr); manager != nullptr) manager->Abandon(name_, for_good);
}

JobManager::Wakeups::~Wakeups() {
  for (const auto& log : logs) log->Notify();
  if (on_idle) on_idle();
}

absl::StatusOr<std::unique_ptr<JobManager>> JobManager::Open(JobManagerOptions options, JobStore* store,
                                                             BlobCatalog* blobs) {
  std::unique_ptr<JobManager> manager(new JobManager(std::move(options), store, blobs));
  PLANISH_RETURN_IF_ERROR(manager->Recover());
  return manager;
}

JobManager::JobManager(JobManagerOptions options, JobStore* store, BlobCatalog* blobs)
    : options_(std::move(options)),
      instance_(options_.new_id()),
      blobs_(blobs),
      store_(store),
      queue_({options_.workers, options_.limits.queue_capacity, options_.queue_total, options_.max_queued_bytes,
              options_.tenant_limits}) {}

absl::StatusOr<JobNeeds> JobManager::NeedsOf(std::string_view mesh, std::optional<std::int64_t> array_vertices,
                                             std::int64_t mesh_bytes, v1::MeshSize size,
                                             const v1::UnwrapOptions& options) const {
  if (array_vertices.has_value()) {
    size = SizeOfArrays(mesh.size(), *array_vertices);
    mesh = {};  // no Draco file
  }
  JobNeeds needs;
  if (options_.estimate != nullptr) {
    PLANISH_ASSIGN_OR_RETURN(needs, options_.estimate(mesh, mesh_bytes, size, options));
  }
  if (needs.size.triangles() > options_.max_triangles) {
    return MakeError(
        absl::StatusCode::kResourceExhausted, "MESH_TOO_LARGE",
        absl::StrCat("the mesh says that it has ", needs.size.triangles(), " triangles; this server takes at most ",
                     options_.max_triangles),
        {{"triangles", absl::StrCat(needs.size.triangles())}, {"limit", absl::StrCat(options_.max_triangles)}});
  }
  if (needs.memory_bytes > options_.memory_bytes) {
    return MakeError(absl::StatusCode::kResourceExhausted, "MEMORY_LIMIT",
                     absl::StrCat("a mesh of ", needs.size.triangles(), " triangles may need ", needs.memory_bytes,
                                  " bytes of memory; this server has ", options_.memory_bytes, " for all its jobs"),
                     {{"bytes", absl::StrCat(needs.memory_bytes)}, {"limit", absl::StrCat(options_.memory_bytes)}});
  }
  return needs;
}

absl::StatusOr<AcceptedJob> JobManager::Create(const Caller& caller, JobRequest request) {
  absl::StatusOr<AcceptedJob> accepted = Accept(caller, std::move(request));
  if (accepted.ok()) return accepted;
  const std::lock_guard lock(mutex_);
  ++calls_[caller.tenant].refused;
  ++refused_by_reason_[ErrorInfoOf(accepted.status()).reason];
  return accepted;
}

absl::StatusOr<AcceptedJob> JobManager::Accept(const Caller& caller, JobRequest request) {
  PLANISH_RETURN_IF_ERROR(ValidateJobRequest(request, options_.max_mesh_bytes, options_.validate_options));
  PLANISH_ASSIGN_OR_RETURN(const JobNeeds needs, NeedsOf(request.Mesh(), request.array_vertices, request.MeshBytes(),
                                                         v1::MeshSize(), request.options));
  if (request.mesh_sha256.empty()) request.mesh_sha256 = Sha256(request.Mesh());
  const std::string corners = PackCorners(request);
  const std::string corners_sha256 = corners.empty() ? std::string() : Sha256(corners);
  const std::string work_key = WorkKey(caller.tenant, request, request.mesh_sha256, corners_sha256);
  {
    const std::lock_guard lock(mutex_);
    PLANISH_ASSIGN_OR_RETURN(std::optional<AcceptedJob> known, Screen(caller, request, work_key));
    if (known.has_value()) return *std::move(known);
  }
  // Outside the lock: the mesh may be large and the disk slow. Held until the record refers to them.
  const absl::StatusOr<StoredBlobPtr> mesh = PutBlob(caller.tenant, request.Mesh(), request.mesh_sha256);
  const absl::StatusOr<StoredBlobPtr> seams =
      corners.empty() ? StoredBlobPtr() : PutBlob(caller.tenant, corners, corners_sha256);
  for (const auto& blob : {mesh, seams}) {
    if (!blob.ok()) return WithRetryDelay(blob.status(), options_.retry_delay);
  }
  const StoredBlobPtr kept_uv = request.scheduling.fresh() ? nullptr : OpenKeptResult(work_key);

  Wakeups wakeups;
  const std::lock_guard lock(mutex_);
  // Until a record needs them.
  const std::set<BlobId> put = {{caller.tenant, request.mesh_sha256}, {caller.tenant, corners_sha256}};
  unused_blobs_.insert(put.begin(), put.end());
  PLANISH_ASSIGN_OR_RETURN(std::optional<AcceptedJob> known, Screen(caller, request, work_key));
  if (known.has_value()) return *std::move(known);

  NewJob job;
  job.record = NewRecord(caller, request);
  job.record.set_work_key(work_key);
  job.record.set_seams_sha256(corners_sha256);
  job.record.mutable_job()->set_memory_bytes(needs.memory_bytes);
  job.run_time = absl::Seconds(needs.run_seconds);
  job.blobs = Pending(caller.tenant, {request.mesh_sha256, corners_sha256});
  std::optional<KeptResult> result;
  if (!request.scheduling.fresh()) result = FindResult(work_key);
  if (result.has_value()) job.result_of = result->record.job().name();
  absl::StatusOr<AcceptedChange> written = store_->Accept(Context(), job);
  if (!written.ok()) return WithRetryDelay(written.status(), options_.retry_delay);
  if (!written->created) return InternalError("two jobs of one name");
  Committed(job.blobs);
  for (const BlobId& id : put) unused_blobs_.erase(id);

  // First what it is accepted as, then what has become of it.
  JobChange& change = written->change;
  const std::string name = change.record.job().name();
  Live& live = live_[name];
  const bool has_result = IsTerminal(change.record.job().state());
  const bool goes_on = change.events.size() > 1;
  if (goes_on) {
    live.record = change.record;
    *live.record.mutable_job() = change.events.front().job();
  } else {
    live.record = std::move(change.record);
  }
  live.events = std::make_shared<JobEventLog>(options_.events_per_job);
  if (!has_result) JoinWork(live, needs);
  Calls& calls = calls_[caller.tenant];
  ++calls.accepted;
  if (written->shares) ++calls.shared;
  PLANISH_ASSIGN_OR_RETURN(AcceptedJob accepted, Answer(live, request.attached));
  v1::JobEvent event = std::move(change.events.front());
  *event.mutable_job() = accepted.job;
  live.events->Append(std::move(event));
  if (options_.observer != nullptr) {
    options_.observer->OnAccepted(live.record.job(), has_result        ? JobOrigin::kKeptResult
                                                     : written->shares ? JobOrigin::kSharedWork
                                                                       : JobOrigin::kOwnWork);
  }
  if (options_.on_transition) options_.on_transition(live.record.job());
  StartClocks(live);
  if (goes_on) {
    change.events.erase(change.events.begin());
    if (!has_result) StartBudget(live);
    Adopt(live, std::move(change), has_result ? std::move(result->uv) : nullptr, &wakeups);
  }
  return accepted;
}

absl::StatusOr<std::optional<AcceptedJob>> JobManager::Screen(const Caller& caller, const JobRequest& request,
                                                              const std::string& work_key) {
  PLANISH_ASSIGN_OR_RETURN(std::optional<AcceptedJob> known, FindKnown(caller, request, work_key));
  if (known.has_value()) return known;
  if (draining_ || suspended_) {
    const char* const why = ending_ ? "the server is shutting down and takes no new jobs"
                                    : "an operator drains the server: it takes no new jobs for now";
    return WithRetryDelay(MakeError(absl::StatusCode::kUnavailable, "DRAINING", why), options_.retry_delay);
  }
  absl::Status room = CheckRoom(caller.tenant, request.MeshBytes());
  if (room.ok()) return std::nullopt;
  // Only now: a result is read whole to be found.
  const bool shares =
      !request.scheduling.fresh() && (FindShared(work_key) != nullptr || FindResult(work_key).has_value());
  if (!shares) return room;
  return std::nullopt;
}

absl::StatusOr<std::optional<AcceptedJob>> JobManager::FindKnown(const Caller& caller, const JobRequest& request,
                                                                 const std::string& work_key) {
  if (request.request_id.empty()) return std::nullopt;
  PLANISH_ASSIGN_OR_RETURN(const std::optional<JobRecord> record,
                           store_->FindByRequestId(caller.tenant, request.request_id));
  if (!record.has_value()) return std::nullopt;
  const std::string& name = record->job().name();
  if (record->work_key() != work_key) {
    const bool may_see = caller.MaySee(caller.tenant);
    std::map<std::string, std::string> metadata;
    if (may_see) metadata["job"] = name;
    return MakeError(absl::StatusCode::kAlreadyExists, "REQUEST_ID_REUSED",
                     absl::StrCat("the request_id belongs to ", may_see ? name : "a job",
                                  ", which has another mesh or other options"),
                     metadata);
  }
  if (const auto live = live_.find(name); live != live_.end()) {
    PLANISH_ASSIGN_OR_RETURN(AcceptedJob answer, Answer(live->second, request.attached));
    return answer;
  }
  AcceptedJob accepted;
  accepted.job = record->job();
  PLANISH_ASSIGN_OR_RETURN(accepted.events, LogOfEnded(*record));
  return accepted;
}

JobRecord JobManager::NewRecord(const Caller& caller, const JobRequest& request) {
  JobRecord record;
  record.set_request_id(request.request_id);
  record.set_mesh_sha256(request.mesh_sha256);
  record.set_seam_corners(static_cast<std::int64_t>(request.seam_corners.size()));
  record.set_uncut_corners(static_cast<std::int64_t>(request.uncut_corners.size()));
  if (request.array_vertices.has_value()) record.set_array_vertices(*request.array_vertices);
  record.set_attached(request.attached);
  record.set_reserved_sequence(kSequenceBlock);
  record.set_failpoint(request.failpoint);
  record.set_credential(caller.credential);
  v1::Job* job = record.mutable_job();
  job->set_name("jobs/" + options_.new_id());
  job->set_state(v1::JOB_STATE_QUEUED);
  job->set_tenant(caller.tenant);
  job->set_traceparent(caller.traceparent);
  job->mutable_labels()->insert(request.labels.begin(), request.labels.end());
  *job->mutable_options() = request.options;
  *job->mutable_scheduling() = request.scheduling;
  *job->mutable_create_time() = ToTimestamp(options_.clock());
  job->set_mesh_bytes(request.MeshBytes());
  return record;
}

absl::StatusOr<AcceptedJob> JobManager::Answer(Live& live, bool attached) {
  if (!attached && live.record.attached()) {
    absl::StatusOr<JobChange> change = store_->Detach(live.record.job().name());
    if (!change.ok()) return NotWritten(change.status());
    live.record = std::move(change->record);
  }
  AcceptedJob accepted;
  accepted.job = Snapshot(live.record);
  accepted.events = live.events;
  if (attached) {
    ++live.attachments;
    accepted.attachment = JobAttachment(this, live.record.job().name());
  }
  return accepted;
}

v1::Job JobManager::Snapshot(const JobRecord& record) const {
  v1::Job job = record.job();
  const auto live = live_.find(job.name());
  if (live == live_.end()) return job;
  const auto work = works_.find(live->second.work());
  if (work == works_.end()) return job;
  if (job.state() == v1::JOB_STATE_QUEUED) {
    job.set_queue_position(queue_.Position(work->first, options_.steady_clock()));
  } else if (work->second.progress.has_value()) {
    *job.mutable_progress() = *work->second.progress;
  }
  return job;
}

absl::StatusOr<JobRecord> JobManager::FindRecord(const std::string& name) const {
  if (const auto live = live_.find(name); live != live_.end()) return live->second.record;
  PLANISH_ASSIGN_OR_RETURN(std::optional<JobRecord> record, store_->Find(name));
  if (!record.has_value()) return JobNotFound(name);
  return *std::move(record);
}

absl::StatusOr<JobRecord> JobManager::FindRecord(const Caller& caller, const std::string& name, bool may_follow) const {
  PLANISH_ASSIGN_OR_RETURN(JobRecord record, FindRecord(name));
  const std::string& tenant = record.job().tenant();
  const bool follows =
      may_follow && caller.rights.submit && tenant == caller.tenant && record.credential() == caller.credential;
  if (!caller.MaySee(tenant) && !follows) return JobNotFound(name);
  return record;
}

absl::StatusOr<v1::Job> JobManager::Get(const Caller& caller, const std::string& name, bool may_follow) const {
  const std::lock_guard lock(mutex_);
  PLANISH_ASSIGN_OR_RETURN(const JobRecord record, FindRecord(caller, name, may_follow));
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
  const PageList list = {store_->id(), tenant, request.filter()};
  PLANISH_ASSIGN_OR_RETURN(query.before_number, DecodePageToken(request.page_token(), list));
  const int most = query.with_reports ? kMaxFullPageSize : kMaxPageSize;
  const int limit = std::min(request.page_size() == 0 ? kDefaultPageSize : request.page_size(), most);
  query.limit = limit + 1;
  // Tenants that one may not see have no jobs.
  const bool asks_for_others = !asked_for.empty() && asked_for != tenant;
  if (asks_for_others || (!caller.rights.all_jobs && !caller.MaySee(tenant))) return JobPage();

  const std::lock_guard lock(mutex_);
  PLANISH_ASSIGN_OR_RETURN(std::vector<JobRecord> records, store_->List(query));
  JobPage page;
  std::size_t bytes = 0;
  for (const JobRecord& record : records) {
    page.jobs.push_back(Snapshot(record));
    bytes += page.jobs.back().ByteSizeLong();
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
  const StoredBlobPtr uv = OpenUvOf(caller, name);
  const std::lock_guard lock(mutex_);
  PLANISH_ASSIGN_OR_RETURN(const JobRecord record, FindRecord(caller, name, /*may_follow=*/true));
  WatchedJob watched;
  if (const auto live = live_.find(name); live != live_.end()) {
    watched.events = live->second.events;
    if (attach && live->second.record.attached()) {
      ++live->second.attachments;
      watched.attachment = JobAttachment(this, name);
    }
    return watched;
  }
  PLANISH_ASSIGN_OR_RETURN(watched.events, LogOfEnded(record));
  const bool had_uv = record.job().state() == v1::JOB_STATE_SUCCEEDED || record.job().state() == v1::JOB_STATE_EXPIRED;
  if (include_uv && had_uv && watched.events->uv() == nullptr) return ResultExpired(name);
  return watched;
}

absl::StatusOr<std::shared_ptr<const JobEventLog>> JobManager::LogOfEnded(const JobRecord& record) {
  const v1::Job& job = record.job();
  const auto recent = std::find_if(ended_logs_.begin(), ended_logs_.end(),
                                   [&](const auto& ended) { return ended.first == job.name(); });
  if (recent != ended_logs_.end() && job.state() != v1::JOB_STATE_EXPIRED) return recent->second;

  PLANISH_ASSIGN_OR_RETURN(std::vector<v1::JobEvent> events, store_->Events(record.number()));
  auto log = std::make_shared<JobEventLog>(options_.events_per_job);
  for (v1::JobEvent& event : events) {
    if (&event == &events.back()) *event.mutable_job() = job;
    log->Restore(std::move(event), 0);
  }
  StoredBlobPtr uv;
  if (job.state() == v1::JOB_STATE_SUCCEEDED) {
    absl::StatusOr<StoredBlobPtr> found = blobs_->Find({job.tenant(), job.uv().uv_sha256()});
    if (found.ok()) uv = *std::move(found);
    // It is there, and cannot be opened for now.
    if (absl::IsResourceExhausted(found.status())) return WithRetryDelay(found.status(), options_.retry_delay);
  }
  log->End(std::move(uv));
  return log;
}

StoredBlobPtr JobManager::OpenUvOf(const Caller& caller, const std::string& name) {
  if (!blobs_->is_durable()) return nullptr;
  BlobId id;
  {
    const std::lock_guard lock(mutex_);
    const absl::StatusOr<JobRecord> record = FindRecord(caller, name, /*may_follow=*/true);
    if (!record.ok() || record->job().state() != v1::JOB_STATE_SUCCEEDED) return nullptr;
    id = {record->job().tenant(), record->job().uv().uv_sha256()};
  }
  absl::StatusOr<StoredBlobPtr> uv = blobs_->Find(id);
  return uv.ok() ? *std::move(uv) : nullptr;
}

absl::StatusOr<JobResult> JobManager::OpenResult(const Caller& caller, const std::string& name) {
  const StoredBlobPtr opened = OpenUvOf(caller, name);
  const std::lock_guard lock(mutex_);
  PLANISH_ASSIGN_OR_RETURN(const JobRecord record, FindRecord(caller, name, /*may_follow=*/true));
  const v1::Job& job = record.job();
  if (!IsTerminal(job.state())) return JobNotFinished(job, "wait for it");
  if (job.state() == v1::JOB_STATE_EXPIRED) return ResultExpired(name);
  if (job.state() != v1::JOB_STATE_SUCCEEDED) {
    return MakeError(absl::StatusCode::kFailedPrecondition, "NO_RESULT",
                     absl::StrCat(name, " is ", StateName(job.state()), ": there are no UV"), {{"job", name}});
  }
  absl::StatusOr<StoredBlobPtr> uv = blobs_->Find({job.tenant(), job.uv().uv_sha256()});
  if (absl::IsResourceExhausted(uv.status())) return WithRetryDelay(uv.status(), options_.retry_delay);
  if (!uv.ok()) return ResultExpired(name);
  return JobResult{job.uv(), *std::move(uv)};
}

absl::Status JobManager::CheckOpen(const Live& live) const {
  if (suspended_) {
    return WithRetryDelay(MakeError(absl::StatusCode::kUnavailable, "DRAINING",
                                    "the server is shutting down; the job goes on when it is back"),
                          options_.retry_delay);
  }
  if (!unended_.contains(live.work())) return absl::OkStatus();
  return WithRetryDelay(MakeError(absl::StatusCode::kResourceExhausted, "STORAGE_FULL",
                                  absl::StrCat("how ", live.record.job().name(), " ended cannot be written for now")),
                        options_.retry_delay);
}

absl::Status JobManager::NotWritten(const absl::Status& why) const {
  if (options_.on_store_error) options_.on_store_error(why);
  return WithRetryDelay(why, options_.retry_delay);
}

absl::StatusOr<v1::Job> JobManager::Cancel(const Caller& caller, const std::string& name) {
  Wakeups wakeups;
  const std::lock_guard lock(mutex_);
  PLANISH_RETURN_IF_ERROR(FindRecord(caller, name, /*may_follow=*/true).status());
  if (const auto live = live_.find(name); live != live_.end()) {
    PLANISH_RETURN_IF_ERROR(EndEarly(live->second, EarlyEnd::kCancel, /*forget=*/false, &wakeups));
  }
  PLANISH_ASSIGN_OR_RETURN(const JobRecord record, FindRecord(name));
  return Snapshot(record);
}

absl::StatusOr<v1::Job> JobManager::Stop(const Caller& caller, const std::string& name) {
  Wakeups wakeups;
  const std::lock_guard lock(mutex_);
  PLANISH_RETURN_IF_ERROR(FindRecord(caller, name, /*may_follow=*/true).status());
  if (const auto live = live_.find(name); live != live_.end()) {
    PLANISH_RETURN_IF_ERROR(RequestStop(live->second, &wakeups));
  }
  PLANISH_ASSIGN_OR_RETURN(const JobRecord record, FindRecord(name));
  return Snapshot(record);
}

void JobManager::Abandon(const std::string& name, bool for_good) {
  Wakeups wakeups;
  const std::lock_guard lock(mutex_);
  const auto found = live_.find(name);
  if (found == live_.end()) return;
  Live& live = found->second;
  if (--live.attachments > 0 || !live.record.attached() || suspended_) return;
  live.orphaned = for_good ? absl::InfinitePast() : options_.clock();
  const absl::Time now = options_.clock();
  if (!for_good) SetAlarm(live, now + options_.limits.reattach_grace);
  CheckClocks(name, now, &wakeups);
}

absl::Status JobManager::Delete(const Caller& caller, const std::string& name) {
  const std::lock_guard lock(mutex_);
  PLANISH_ASSIGN_OR_RETURN(const JobRecord record, FindRecord(caller, name));
  if (!IsTerminal(record.job().state())) return JobNotFinished(record.job(), "cancel it first");
  return Forget(record);
}

absl::StatusOr<v1::JobEstimate> JobManager::Estimate(const Caller& caller, const JobRequest& request,
                                                     std::int64_t mesh_bytes, const v1::MeshSize& size) const {
  if (request.Mesh().empty() && size.triangles() <= 0) {
    return MakeError(absl::StatusCode::kInvalidArgument, "MESH_MISSING",
                     "neither the mesh nor its number of triangles is given", {{"field", "mesh"}});
  }
  PLANISH_RETURN_IF_ERROR(CheckOptions(request.options, options_.validate_options));
  if (mesh_bytes <= 0) mesh_bytes = request.MeshBytes();
  v1::JobEstimate estimate;
  absl::StatusOr<JobNeeds> needs = NeedsOf(request.Mesh(), request.array_vertices, mesh_bytes, size, request.options);
  if (!needs.ok() && needs.status().code() == absl::StatusCode::kInvalidArgument) return needs.status();
  if (!needs.ok()) {
    *estimate.mutable_refusal() = ToRpcStatus(needs.status());
    return estimate;
  }
  *estimate.mutable_size() = needs->size;
  estimate.set_memory_bytes(needs->memory_bytes);
  const std::lock_guard lock(mutex_);
  *estimate.mutable_run_time() = ToDuration(needs->run_seconds * seconds_factor_);
  *estimate.mutable_queue_time() = ToDuration(queue_.SecondsUntilTurn(caller.tenant, options_.steady_clock()));
  absl::Status room = CheckRoom(caller.tenant, mesh_bytes);
  if (mesh_bytes > options_.max_mesh_bytes) room = MeshTooLarge(mesh_bytes, options_.max_mesh_bytes);
  if (!room.ok()) *estimate.mutable_refusal() = ToRpcStatus(room);
  return estimate;
}

}  // namespace planish
