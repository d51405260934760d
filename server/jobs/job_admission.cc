#include "server/jobs/job_admission.h"

#include <algorithm>
#include <utility>

#include "absl/strings/str_cat.h"
#include "core/base/error.h"
#include "core/base/sha256.h"
#include "core/base/status_macros.h"
#include "google/protobuf/util/time_util.h"
#include "server/link/duration.h"
#include "server/link/rpc_status.h"
#include "server/store/lifecycle.h"

namespace planish {
namespace {

// Bounds of the delay in RetryInfo, so that clients neither flood the server nor give up.
constexpr double kLeastRetrySeconds = 0.05;
constexpr double kMostRetrySeconds = 60;

// A forecast is reused for this many times the duration of making it, since making one reads the whole queue.
constexpr int kForecastRests = 20;

}  // namespace

JobAdmission::JobAdmission(JobContext* context, JobFeed* feed, JobCallers* callers, JobRetention* retention,
                           std::function<double()> seconds_factor)
    : context_(*context),
      feed_(*feed),
      callers_(*callers),
      retention_(*retention),
      seconds_factor_(std::move(seconds_factor)) {}

absl::StatusOr<JobNeeds> JobAdmission::NeedsOf(const std::string& tenant, std::string_view mesh,
                                               std::optional<std::int64_t> array_vertices, std::int64_t mesh_bytes,
                                               v1::MeshSize size, const v1::UnwrapOptions& options) const {
  const JobManagerOptions& limits = context_.options;
  if (array_vertices.has_value()) {
    size = SizeOfArrays(mesh.size(), *array_vertices);
    mesh = {};  // not a Draco file
  }
  JobNeeds needs;
  if (limits.estimate != nullptr) {
    PLANISH_ASSIGN_OR_RETURN(needs, limits.estimate(mesh, mesh_bytes, size, options));
  }
  if (needs.size.triangles() > limits.max_triangles) {
    return MakeError(
        absl::StatusCode::kResourceExhausted, "MESH_TOO_LARGE",
        absl::StrCat("the mesh says that it has ", needs.size.triangles(), " triangles; this server takes at most ",
                     limits.max_triangles),
        {{"triangles", absl::StrCat(needs.size.triangles())}, {"limit", absl::StrCat(limits.max_triangles)}});
  }
  const std::int64_t most = context_.MostMemory(tenant);
  if (needs.memory_bytes > most) {
    return MakeError(absl::StatusCode::kResourceExhausted, "MEMORY_LIMIT",
                     absl::StrCat("a mesh of ", needs.size.triangles(), " triangles may need ", needs.memory_bytes,
                                  " bytes of memory; a job of tenant ", tenant, " may have ", most, " here"),
                     {{"bytes", absl::StrCat(needs.memory_bytes)}, {"limit", absl::StrCat(most)}});
  }
  return needs;
}

QueueLimits JobAdmission::LimitsOf(const std::string& tenant) const {
  const JobManagerOptions& options = context_.options;
  QueueLimits limits;
  const TenantLimits own = options.tenant_limits == nullptr ? TenantLimits() : options.tenant_limits(tenant);
  limits.tenant_jobs = own.queue >= 0 ? own.queue : context_.Limits().queue_capacity;
  limits.share = ShareOf(own);
  limits.total_jobs = options.queue_total;
  limits.total_bytes = options.max_queued_bytes;
  limits.workers = context_.Capacity().workers;
  return limits;
}

template <class Answer>
absl::StatusOr<Answer> JobAdmission::AskForecast(const std::function<Answer(QueueForecast*)>& question) const {
  const absl::Time now = context_.options.steady_clock();
  {
    const std::lock_guard lock(mutex_);
    const absl::Duration age = std::max(context_.options.forecast_age, kForecastRests * forecast_cost_);
    if (forecast_.has_value() && now - forecast_time_ < age) return question(&*forecast_);
  }
  PLANISH_ASSIGN_OR_RETURN(QueueState state, context_.store.Queue());
  QueueForecast forecast(std::move(state), context_.options.tenant_limits, context_.Capacity().workers,
                         seconds_factor_());
  const std::lock_guard lock(mutex_);
  forecast_ = std::move(forecast);
  forecast_time_ = now;
  forecast_cost_ = context_.options.steady_clock() - now;
  return question(&*forecast_);
}

absl::StatusOr<int> JobAdmission::PositionOf(const JobRecord& record) const {
  const v1::Job& job = record.job();
  WorkRow work;
  work.name = record.work();
  work.tenant = job.tenant();
  work.number = record.number();
  const auto create_time = google::protobuf::util::TimeUtil::TimestampToNanoseconds(job.create_time());
  work.turn_time = absl::ToUnixNanos(QueueTime(absl::FromUnixNanos(create_time), job.scheduling().priority()));
  return AskForecast<int>([&](QueueForecast* forecast) {
    forecast->Add(work);
    return forecast->Position(work.name);
  });
}

absl::Status JobAdmission::QueueFull(const std::string& tenant, Room room) const {
  const QueueLimits limits = LimitsOf(tenant);
  const std::string message =
      room == Room::kTenantFull
          ? absl::StrCat("the queue is full (", limits.tenant_jobs, " jobs of tenant ", tenant, " may wait)")
          : absl::StrCat("the queue of all tenants is full (", limits.total_jobs, " jobs or ", limits.total_bytes,
                         " bytes may wait), and tenant ", tenant, " has its part of it");
  absl::Duration delay = context_.options.retry_delay;
  const auto seconds = AskForecast<std::optional<double>>(
      [&](QueueForecast* forecast) { return forecast->SecondsUntilRoom(tenant, room); });
  if (seconds.ok() && seconds->has_value()) {
    delay = absl::Seconds(std::clamp(**seconds, kLeastRetrySeconds, kMostRetrySeconds));
  }
  return WithRetryDelay(MakeError(absl::StatusCode::kResourceExhausted, "QUEUE_FULL", message,
                                  {{"queue_capacity", absl::StrCat(limits.tenant_jobs)}}),
                        delay);
}

absl::Status JobAdmission::CheckRoom(const std::string& tenant, std::int64_t mesh_bytes) const {
  const QueueLimits limits = LimitsOf(tenant);
  // Usually the recent forecast shows that there is room.
  PLANISH_ASSIGN_OR_RETURN(const Room before, AskForecast<Room>([&](QueueForecast* forecast) {
                             return RoomFor(forecast->accounts(), limits, tenant, mesh_bytes);
                           }));
  if (before == Room::kYes) return absl::OkStatus();
  PLANISH_ASSIGN_OR_RETURN(const FairAccounts accounts, context_.store.Accounts());
  const Room room = RoomFor(accounts, limits, tenant, mesh_bytes);
  return room == Room::kYes ? absl::OkStatus() : QueueFull(tenant, room);
}

absl::StatusOr<AcceptedJob> JobAdmission::Create(const Caller& caller, JobRequest request,
                                                 const absl::Status& refusal) {
  absl::StatusOr<Prepared> prepared = Prepare(caller, std::move(request), refusal);
  if (!prepared.ok()) return Noted(caller, prepared.status());
  if (prepared->known.has_value()) return *std::move(prepared->known);
  return Noted(caller, AnswerPrepared(caller, &*prepared, context_.store.Accept(context_.Verb(), prepared->job)));
}

std::vector<absl::StatusOr<AcceptedJob>> JobAdmission::CreateAll(const Caller& caller, std::vector<JobRequest> requests,
                                                                 const absl::Status& refusal) {
  std::vector<absl::StatusOr<Prepared>> all;
  std::vector<NewJob> jobs;
  for (JobRequest& request : requests) {
    all.push_back(Prepare(caller, std::move(request), refusal));
    if (all.back().ok() && !all.back()->known.has_value()) jobs.push_back(all.back()->job);
  }
  std::vector<absl::StatusOr<AcceptedChange>> changes;
  if (!jobs.empty()) changes = context_.store.AcceptAll(context_.Verb(), std::move(jobs));
  std::vector<absl::StatusOr<AcceptedJob>> answers;
  std::size_t next = 0;
  for (absl::StatusOr<Prepared>& prepared : all) {
    if (prepared.ok() && prepared->known.has_value()) {
      answers.emplace_back(*std::move(prepared->known));
    } else {
      answers.push_back(Noted(
          caller, prepared.ok() ? AnswerPrepared(caller, &*prepared, std::move(changes[next++])) : prepared.status()));
    }
  }
  return answers;
}

absl::StatusOr<AcceptedJob> JobAdmission::Noted(const Caller& caller, absl::StatusOr<AcceptedJob> answer) {
  if (answer.ok()) return answer;
  const std::lock_guard lock(mutex_);
  ++calls_[caller.tenant].refused;
  ++refused_by_reason_[ErrorInfoOf(answer.status()).reason];
  return answer;
}

absl::StatusOr<JobAdmission::Prepared> JobAdmission::Prepare(const Caller& caller, JobRequest asked,
                                                             const absl::Status& refusal) {
  const JobManagerOptions& options = context_.options;
  PLANISH_RETURN_IF_ERROR(ValidateJobRequest(asked, options.max_mesh_bytes, options.validate_options));
  PLANISH_ASSIGN_OR_RETURN(const JobNeeds needs,
                           NeedsOf(caller.tenant, asked.Mesh(), asked.array_vertices, asked.MeshBytes(), v1::MeshSize(),
                                   asked.OptionsForNeeds()));
  Prepared prepared;
  prepared.request = std::move(asked);
  JobRequest& request = prepared.request;
  if (request.mesh_sha256.empty()) request.mesh_sha256 = Sha256(request.Mesh());
  const std::string elements = PackElements(request);
  const std::string elements_sha256 = elements.empty() ? std::string() : Sha256(elements);
  prepared.work_key = WorkKey(caller.tenant, request, request.mesh_sha256, elements_sha256);
  PLANISH_ASSIGN_OR_RETURN(prepared.known, FindKnown(caller, request, prepared.work_key));
  if (prepared.known.has_value()) return prepared;
  PLANISH_RETURN_IF_ERROR(refusal);
  std::optional<KeptResult> result;
  if (!request.scheduling.fresh()) result = FindResult(prepared.work_key);
  // An early check, before the mesh is stored. JobStore::Accept() makes the final one.
  if (absl::Status room = CheckRoom(caller.tenant, request.MeshBytes()); !room.ok() && !result.has_value()) {
    if (request.scheduling.fresh()) return room;
    PLANISH_ASSIGN_OR_RETURN(const bool shares, context_.store.IsUnderWay(caller.tenant, prepared.work_key));
    if (!shares) return room;
  }
  const absl::Status disk = retention_.CheckDisk(caller.tenant, request.MeshBytes());
  if (!disk.ok()) return WithRetryDelay(disk, options.retry_delay);
  prepared.mesh_hold = retention_.Hold({caller.tenant, request.mesh_sha256});
  absl::StatusOr<StoredBlobPtr> mesh = retention_.Put(caller.tenant, request.Mesh(), request.mesh_sha256);
  absl::StatusOr<StoredBlobPtr> kept_elements = StoredBlobPtr();
  if (!elements.empty()) {
    prepared.elements_hold = retention_.Hold({caller.tenant, elements_sha256});
    kept_elements = retention_.Put(caller.tenant, elements, elements_sha256);
  }
  for (const auto& blob : {mesh, kept_elements}) {
    if (!blob.ok()) return WithRetryDelay(blob.status(), options.retry_delay);
    prepared.blobs.push_back(*blob);
  }

  NewJob& job = prepared.job;
  job.record = NewRecord(caller, request);
  job.record.set_work_key(prepared.work_key);
  job.record.set_elements_sha256(elements_sha256);
  job.record.mutable_job()->set_memory_bytes(needs.memory_bytes);
  job.run_time = absl::Seconds(needs.run_seconds);
  job.limits = LimitsOf(caller.tenant);
  if (request.attached) job.callers_for = JobCallers::kBelieved;
  job.blobs = retention_.Pending(caller.tenant, {request.mesh_sha256, elements_sha256});
  if (result.has_value()) {
    job.result_of = result->name;
    prepared.uv = result->uv;
  }
  prepared.events = feed_.OpenNew(job.record.job().name());
  return prepared;
}

absl::StatusOr<AcceptedJob> JobAdmission::AnswerPrepared(const Caller& caller, Prepared* prepared,
                                                         absl::StatusOr<AcceptedChange> accepted) {
  if (!accepted.ok()) return WithRetryDelay(accepted.status(), context_.options.retry_delay);
  if (accepted->room != Room::kYes) return QueueFull(caller.tenant, accepted->room);
  const JobRequest& request = prepared->request;
  if (!accepted->created) return AnswerKnown(caller, request, prepared->work_key, std::move(accepted->change.record));
  retention_.Committed(prepared->job.blobs);
  {
    const std::lock_guard lock(mutex_);
    Calls& calls = calls_[caller.tenant];
    ++calls.accepted;
    if (accepted->shares) ++calls.shared;
  }
  return AnswerNew(request, *std::move(accepted), std::move(prepared->events), prepared->uv);
}

std::optional<JobAdmission::KeptResult> JobAdmission::FindResult(const std::string& work_key) const {
  const absl::StatusOr<std::optional<JobRecord>> record = context_.store.FindResult(work_key);
  if (!record.ok() || !record->has_value() || (*record)->job().stop_requested()) return std::nullopt;
  const v1::Job& job = (*record)->job();
  absl::StatusOr<StoredBlobPtr> uv = context_.blobs.Find({job.tenant(), job.uv().uv_sha256()});
  if (!uv.ok()) return std::nullopt;
  return KeptResult{job.name(), *std::move(uv)};
}

absl::StatusOr<std::optional<AcceptedJob>> JobAdmission::FindKnown(const Caller& caller, const JobRequest& request,
                                                                   const std::string& work_key) {
  if (request.request_id.empty()) return std::nullopt;
  PLANISH_ASSIGN_OR_RETURN(std::optional<JobRecord> record,
                           context_.store.FindByRequestId(caller.tenant, request.request_id));
  if (!record.has_value()) return std::nullopt;
  PLANISH_ASSIGN_OR_RETURN(AcceptedJob accepted, AnswerKnown(caller, request, work_key, *std::move(record)));
  return accepted;
}

absl::StatusOr<AcceptedJob> JobAdmission::AnswerKnown(const Caller& caller, const JobRequest& request,
                                                      const std::string& work_key, JobRecord record) {
  const std::string name = record.job().name();
  if (record.work_key() != work_key) {
    const bool may_see = caller.MaySee(caller.tenant);
    std::map<std::string, std::string> metadata;
    if (may_see) metadata["job"] = name;
    return MakeError(absl::StatusCode::kAlreadyExists, "REQUEST_ID_REUSED",
                     absl::StrCat("the request_id belongs to ", may_see ? name : "a job",
                                  ", which has another mesh or other options"),
                     metadata);
  }
  const bool has_ended = IsTerminal(record.job().state());
  if (!has_ended && !request.attached && record.attached()) {
    absl::StatusOr<JobChange> change = context_.store.Detach(name);
    if (!change.ok()) {
      context_.TellError(change.status());
      return WithRetryDelay(change.status(), context_.options.retry_delay);
    }
    record = std::move(change->record);
  }
  AcceptedJob answer;
  answer.job = record.job();
  if (record.job().state() == v1::JOB_STATE_QUEUED) {
    PLANISH_ASSIGN_OR_RETURN(const int position, PositionOf(record));
    answer.job.set_queue_position(position);
  }
  PLANISH_ASSIGN_OR_RETURN(answer.events, feed_.Open(record));
  if (!has_ended && request.attached) answer.attachment = callers_.Attach(name, /*known=*/!record.attached());
  return answer;
}

absl::StatusOr<AcceptedJob> JobAdmission::AnswerNew(const JobRequest& request, AcceptedChange accepted,
                                                    std::shared_ptr<JobEventLog> events, const StoredBlobPtr& uv) {
  JobChange& change = accepted.change;
  const std::string name = change.record.job().name();
  const bool has_result = IsTerminal(change.record.job().state());
  // The first event has the state in which the job was accepted; the record has its present state.
  v1::Job* const first = change.events.front().mutable_job();
  if (!has_result) {
    if (const absl::StatusOr<int> position = PositionOf(change.record); position.ok()) {
      first->set_queue_position(*position);
    }
  }
  AcceptedJob answer;
  answer.job = *first;
  if (context_.options.observer != nullptr) {
    context_.options.observer->OnAccepted(*first, has_result        ? JobOrigin::kKeptResult
                                                  : accepted.shares ? JobOrigin::kSharedWork
                                                                    : JobOrigin::kOwnWork);
  }
  feed_.NoteNumber(name, change.record.number());
  answer.events = std::move(events);
  if (request.attached && !has_result) answer.attachment = callers_.Attach(name, /*known=*/true);
  std::vector<JobChange> changes;
  changes.push_back(std::move(change));
  feed_.Tell(changes, uv);
  if (has_result) retention_.NoteEnds(changes);
  return answer;
}

JobRecord JobAdmission::NewRecord(const Caller& caller, const JobRequest& request) const {
  JobRecord record;
  record.set_request_id(request.request_id);
  record.set_mesh_sha256(request.mesh_sha256);
  if (request.array_vertices.has_value()) record.set_array_vertices(*request.array_vertices);
  record.set_attached(request.attached);
  record.set_failpoint(request.failpoint);
  record.set_credential(caller.credential);
  v1::Job* job = record.mutable_job();
  job->set_name("jobs/" + context_.options.new_id());
  job->set_state(v1::JOB_STATE_QUEUED);
  job->set_tenant(caller.tenant);
  job->set_traceparent(caller.traceparent);
  job->mutable_labels()->insert(request.labels.begin(), request.labels.end());
  *job->mutable_options() = request.options;
  *job->mutable_scheduling() = request.scheduling;
  job->set_mesh_bytes(request.MeshBytes());
  return record;
}

absl::StatusOr<v1::JobEstimate> JobAdmission::Estimate(const Caller& caller, const JobRequest& request,
                                                       std::int64_t mesh_bytes, const v1::MeshSize& size) const {
  const JobManagerOptions& options = context_.options;
  if (request.Mesh().empty() && size.triangles() <= 0) {
    return MakeError(absl::StatusCode::kInvalidArgument, "MESH_MISSING",
                     "neither the mesh nor its number of triangles is given", {{"field", "mesh"}});
  }
  PLANISH_RETURN_IF_ERROR(CheckOptions(request.options, options.validate_options));
  if (mesh_bytes <= 0) mesh_bytes = request.MeshBytes();
  v1::JobEstimate estimate;
  absl::StatusOr<JobNeeds> needs =
      NeedsOf(caller.tenant, request.Mesh(), request.array_vertices, mesh_bytes, size, request.OptionsForNeeds());
  if (!needs.ok() && needs.status().code() == absl::StatusCode::kInvalidArgument) return needs.status();
  if (!needs.ok()) {
    *estimate.mutable_refusal() = ToRpcStatus(needs.status());
    return estimate;
  }
  *estimate.mutable_size() = needs->size;
  estimate.set_memory_bytes(needs->memory_bytes);
  PLANISH_ASSIGN_OR_RETURN(const double queue_seconds, AskForecast<double>([&](QueueForecast* forecast) {
                             return forecast->SecondsUntilTurn(caller.tenant);
                           }));
  *estimate.mutable_run_time() = ToDuration(needs->run_seconds * seconds_factor_());
  *estimate.mutable_queue_time() = ToDuration(queue_seconds);
  absl::Status room = CheckRoom(caller.tenant, mesh_bytes);
  if (mesh_bytes > options.max_mesh_bytes) room = MeshTooLarge(mesh_bytes, options.max_mesh_bytes);
  if (!room.ok()) *estimate.mutable_refusal() = ToRpcStatus(room);
  return estimate;
}

void JobAdmission::AddCalls(std::map<std::string, TenantStats>* tenants,
                            std::map<std::string, std::int64_t>* refused) const {
  const std::lock_guard lock(mutex_);
  for (const auto& [tenant, calls] : calls_) {
    TenantStats& stats = (*tenants)[tenant];
    stats.accepted = calls.accepted;
    stats.refused = calls.refused;
    stats.shared = calls.shared;
  }
  *refused = refused_by_reason_;
}

}  // namespace planish
