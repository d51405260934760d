#include "server/jobs/job_manager.h"

#include <algorithm>
#include <utility>

#include "absl/strings/str_cat.h"
#include "core/base/error.h"
#include "core/base/status_macros.h"
#include "google/protobuf/util/time_util.h"
#include "server/jobs/page_token.h"
#include "server/link/rpc_status.h"

namespace planish {
namespace {

using google::protobuf::util::TimeUtil;

constexpr int kDefaultPageSize = 50;
constexpr int kMaxPageSize = 1000;

absl::Status NotFound(const std::string& name) {
  return MakeError(absl::StatusCode::kNotFound, "JOB_NOT_FOUND",
                   absl::StrCat("there is no job '", name, "': it never was, or it was deleted or dropped"),
                   {{"job", name}});
}

std::int64_t UvBytes(const JobEventLog& events) {
  const auto uv = events.uv();
  return uv == nullptr ? 0 : static_cast<std::int64_t>(uv->size());
}

double QueueSeconds(const v1::Job& job) {
  return static_cast<double>(TimeUtil::DurationToNanoseconds(job.start_time() - job.create_time())) * 1e-9;
}

}  // namespace

JobAttachment& JobAttachment::operator=(JobAttachment&& other) noexcept {
  Release();
  manager_ = std::exchange(other.manager_, nullptr);
  name_ = std::move(other.name_);
  return *this;
}

void JobAttachment::Release() {
  if (JobManager* manager = std::exchange(manager_, nullptr); manager != nullptr) manager->Abandon(name_);
}

JobManager::Wakeups::~Wakeups() {
  for (const auto& log : logs) log->Notify();
  if (on_idle) on_idle();
}

JobManager::JobManager(JobManagerOptions options, std::unique_ptr<JobStore> store)
    : options_(std::move(options)),
      instance_(options_.new_id()),
      store_(std::move(store)),
      queue_(options_.queue_capacity, options_.max_queued_bytes) {}

// ---- for callers

absl::StatusOr<AcceptedJob> JobManager::Create(JobRequest request) {
  PLANISH_RETURN_IF_ERROR(ValidateJobRequest(request, options_.max_mesh_bytes, options_.validate_options));
  const std::int64_t mesh_bytes = request.MeshBytes();

  Wakeups wakeups;
  const std::lock_guard lock(mutex_);
  if (!request.request_id.empty()) {
    const std::optional<JobRecord> known = store_->FindByRequestId(request.request_id);
    if (known.has_value()) return Accept(*known, live_.at(known->job.name()), request.attached);
  }
  PLANISH_RETURN_IF_ERROR(CheckRoom(mesh_bytes));

  JobRecord record;
  record.number = ++last_number_;
  record.request_id = std::move(request.request_id);
  do {
    record.job.set_name("jobs/" + options_.new_id());
  } while (live_.count(record.job.name()) > 0);
  record.job.set_state(v1::JOB_STATE_QUEUED);
  record.job.set_label(std::move(request.label));
  *record.job.mutable_options() = std::move(request.options);
  *record.job.mutable_create_time() = ToTimestamp(options_.clock());
  record.job.set_mesh_bytes(mesh_bytes);
  store_->Put(record);

  Live& live = live_[record.job.name()];
  live.events = std::make_shared<JobEventLog>(options_.events_per_job);
  live.mesh = std::move(request.draco);
  live.seam_corners = std::move(request.seam_corners);
  live.uncut_corners = std::move(request.uncut_corners);
  queue_.Push(record.job.name(), mesh_bytes);
  AcceptedJob accepted = Accept(record, live, request.attached);

  v1::JobEvent event;
  *event.mutable_time() = record.job.create_time();
  *event.mutable_job() = accepted.job;
  live.events->Append(std::move(event));
  if (options_.on_transition) options_.on_transition(record.job);
  work_or_stop_.notify_one();
  return accepted;
}

absl::Status JobManager::CheckRoom(std::int64_t mesh_bytes) const {
  if (draining_) {
    return WithRetryDelay(
        MakeError(absl::StatusCode::kUnavailable, "DRAINING", "the server is shutting down and takes no new jobs"),
        options_.retry_delay);
  }
  if (!queue_.HasRoom(mesh_bytes, options_.workers - running_)) {
    return WithRetryDelay(MakeError(absl::StatusCode::kResourceExhausted, "QUEUE_FULL",
                                    absl::StrCat("the queue is full (", options_.queue_capacity, " jobs or ",
                                                 options_.max_queued_bytes, " bytes may wait)"),
                                    {{"queue_capacity", absl::StrCat(options_.queue_capacity)}}),
                          options_.retry_delay);
  }
  return absl::OkStatus();
}

AcceptedJob JobManager::Accept(const JobRecord& record, Live& live, bool attached) {
  AcceptedJob accepted;
  accepted.job = Snapshot(record, live);
  accepted.events = live.events;
  if (attached) {
    ++live.attachments;
    accepted.attachment = JobAttachment(this, record.job.name());
  } else {
    live.detached = true;
  }
  return accepted;
}

v1::Job JobManager::Snapshot(const JobRecord& record, const Live& live) const {
  v1::Job job = record.job;
  if (job.state() == v1::JOB_STATE_QUEUED) job.set_queue_position(queue_.Position(job.name()));
  if (live.has_progress && !IsTerminal(job.state())) *job.mutable_progress() = live.progress;
  return job;
}

absl::StatusOr<v1::Job> JobManager::Get(const std::string& name) const {
  const std::lock_guard lock(mutex_);
  const std::optional<JobRecord> record = store_->Find(name);
  if (!record.has_value()) return NotFound(name);
  return Snapshot(*record, live_.at(name));
}

absl::StatusOr<JobPage> JobManager::List(int page_size, const std::string& page_token, v1::JobState state) const {
  if (page_size < 0) {
    return MakeError(absl::StatusCode::kInvalidArgument, "REQUEST_INVALID", "page_size is negative",
                     {{"field", "page_size"}});
  }
  JobQuery query;
  query.state = state;
  PLANISH_ASSIGN_OR_RETURN(query.before_number, DecodePageToken(page_token, instance_, state));
  const int limit = page_size == 0 ? kDefaultPageSize : std::min(page_size, kMaxPageSize);
  query.limit = limit + 1;

  const std::lock_guard lock(mutex_);
  std::vector<JobRecord> records = store_->List(query);
  JobPage page;
  if (static_cast<int>(records.size()) > limit) {
    records.resize(static_cast<std::size_t>(limit));
    page.next_page_token = EncodePageToken({instance_, state, records.back().number});
  }
  for (const JobRecord& record : records) {
    v1::Job job = Snapshot(record, live_.at(record.job.name()));
    job.clear_report();
    job.clear_progress();
    page.jobs.push_back(std::move(job));
  }
  return page;
}

absl::StatusOr<std::shared_ptr<const JobEventLog>> JobManager::Watch(const std::string& name) const {
  const std::lock_guard lock(mutex_);
  const auto live = live_.find(name);
  if (live == live_.end()) return NotFound(name);
  return live->second.events;
}

absl::StatusOr<v1::Job> JobManager::Cancel(const std::string& name) {
  Wakeups wakeups;
  const std::lock_guard lock(mutex_);
  std::optional<JobRecord> record = store_->Find(name);
  if (!record.has_value()) return NotFound(name);
  CancelLocked(*std::move(record), &wakeups);
  return Snapshot(*store_->Find(name), live_.at(name));
}

void JobManager::CancelLocked(JobRecord record, Wakeups* wakeups) {
  const v1::JobState state = record.job.state();
  if (state != v1::JOB_STATE_QUEUED && state != v1::JOB_STATE_RUNNING) return;
  const std::string name = record.job.name();
  if (state == v1::JOB_STATE_QUEUED) queue_.Remove(name);
  if (const auto& link = live_.at(name).link; link != nullptr) {
    worker::v1::ToWorker message;
    message.mutable_cancel();
    link->Send(std::move(message));
  }
  Apply(JobAction::kCancel, std::move(record), nullptr, wakeups);
}

void JobManager::Abandon(const std::string& name) {
  Wakeups wakeups;
  const std::lock_guard lock(mutex_);
  const auto live = live_.find(name);
  if (live == live_.end()) return;
  if (--live->second.attachments > 0 || live->second.detached) return;
  JobRecord record = *store_->Find(name);
  if (IsTerminal(record.job.state())) return;
  record.request_id.clear();
  store_->Put(record);
  CancelLocked(std::move(record), &wakeups);
}

absl::Status JobManager::Delete(const std::string& name) {
  const std::lock_guard lock(mutex_);
  const std::optional<JobRecord> record = store_->Find(name);
  if (!record.has_value()) return NotFound(name);
  if (!IsTerminal(record->job.state())) {
    return MakeError(absl::StatusCode::kFailedPrecondition, "JOB_NOT_FINISHED",
                     absl::StrCat(name, " is ", StateName(record->job.state()), ": cancel it first"), {{"job", name}});
  }
  Forget(name);
  return absl::OkStatus();
}

// ---- for WorkerPool

std::optional<JobAssignment> JobManager::TakeNext() {
  Wakeups wakeups;
  std::unique_lock lock(mutex_);
  work_or_stop_.wait(lock, [this] { return stopped_ || !queue_.empty(); });
  const std::optional<std::string> name = queue_.Pop();
  if (!name.has_value()) return std::nullopt;

  JobRecord record = *store_->Find(*name);
  JobAssignment assignment;
  assignment.name = *name;
  assignment.request.set_job(*name);
  *assignment.request.mutable_options() = record.job.options();
  assignment.request.set_max_threads(options_.threads);
  Live& live = live_.at(*name);
  assignment.request.set_draco(std::move(live.mesh));
  assignment.request.mutable_seam_corners()->Add(live.seam_corners.begin(), live.seam_corners.end());
  assignment.request.mutable_uncut_corners()->Add(live.uncut_corners.begin(), live.uncut_corners.end());
  live.seam_corners = live.uncut_corners = {};
  ++running_;
  Apply(JobAction::kStart, std::move(record), nullptr, &wakeups);
  return assignment;
}

void JobManager::SetLink(const std::string& name, std::shared_ptr<WorkerLink> link) {
  const std::lock_guard lock(mutex_);
  const std::optional<JobRecord> record = store_->Find(name);
  if (!record.has_value() || IsTerminal(record->job.state())) return;
  if (record->job.state() == v1::JOB_STATE_STOPPING) {
    worker::v1::ToWorker message;
    message.mutable_cancel();
    link->Send(std::move(message));
  }
  live_.at(name).link = std::move(link);
}

void JobManager::ReportProgress(const std::string& name, v1::Progress progress) {
  Wakeups wakeups;
  const std::lock_guard lock(mutex_);
  const auto live = live_.find(name);
  if (live == live_.end()) return;
  v1::JobEvent event;
  *event.mutable_time() = ToTimestamp(options_.clock());
  *event.mutable_progress() = progress;
  live->second.progress = std::move(progress);
  live->second.has_progress = true;
  live->second.events->Append(std::move(event));
  wakeups.logs.push_back(live->second.events);
}

void JobManager::ReportResult(const std::string& name, worker::v1::WorkResult result) {
  Wakeups wakeups;
  const std::lock_guard lock(mutex_);
  std::optional<JobRecord> record = store_->Find(name);
  if (!record.has_value() || IsTerminal(record->job.state())) return;

  const bool stopping = record->job.state() == v1::JOB_STATE_STOPPING;
  const auto code = static_cast<absl::StatusCode>(result.status().code());
  if (stopping && (code == absl::StatusCode::kOk || code == absl::StatusCode::kCancelled)) {
    return Apply(JobAction::kCancelled, *std::move(record), nullptr, &wakeups);
  }
  if (code == absl::StatusCode::kCancelled) {
    return FailLocked(*std::move(record), InternalError("the worker cancelled a job that nobody cancelled"), &wakeups);
  }
  if (code != absl::StatusCode::kOk) {
    *record->job.mutable_error() = std::move(*result.mutable_status());
    return Apply(JobAction::kFail, *std::move(record), nullptr, &wakeups);
  }
  if (result.uv().total_bytes() != static_cast<std::int64_t>(result.uv_bytes().size())) {
    return FailLocked(*std::move(record), InternalError("the worker sent UV of another length than it says"), &wakeups);
  }
  *record->job.mutable_report() = std::move(*result.mutable_report());
  record->job.mutable_report()->mutable_seconds()->set_queue(QueueSeconds(record->job));
  *record->job.mutable_uv() = std::move(*result.mutable_uv());
  auto uv = std::make_shared<const std::string>(std::move(*result.mutable_uv_bytes()));
  Apply(JobAction::kSucceed, *std::move(record), std::move(uv), &wakeups);
}

void JobManager::ReportLost(const std::string& name, const std::string& message) {
  Wakeups wakeups;
  const std::lock_guard lock(mutex_);
  std::optional<JobRecord> record = store_->Find(name);
  if (record.has_value()) FailLocked(*std::move(record), InternalError(message), &wakeups);
}

void JobManager::FailLocked(JobRecord record, const absl::Status& error, Wakeups* wakeups) {
  *record.job.mutable_error() = ToRpcStatus(error);
  Apply(JobAction::kFail, std::move(record), nullptr, wakeups);
}

// ---- for the server's shutdown

void JobManager::Drain(std::function<void()> on_idle) {
  Wakeups wakeups;
  const std::lock_guard lock(mutex_);
  draining_ = true;
  if (queue_.empty() && running_ == 0) {
    wakeups.on_idle = std::move(on_idle);
  } else {
    on_idle_ = std::move(on_idle);
  }
}

void JobManager::CancelAll() {
  Wakeups wakeups;
  const std::lock_guard lock(mutex_);
  std::vector<std::string> names;
  for (const auto& [name, live] : live_) names.push_back(name);
  for (const std::string& name : names) {
    if (std::optional<JobRecord> record = store_->Find(name)) CancelLocked(*std::move(record), &wakeups);
  }
}

void JobManager::CloseLinks() {
  const std::lock_guard lock(mutex_);
  for (const auto& [name, live] : live_) {
    if (live.link != nullptr) live.link->Close();
  }
}

void JobManager::Stop() {
  const std::lock_guard lock(mutex_);
  stopped_ = true;
  work_or_stop_.notify_all();
}

// ---- one place for every change

void JobManager::Apply(JobAction action, JobRecord record, std::shared_ptr<const std::string> uv, Wakeups* wakeups) {
  const std::string name = record.job.name();
  const bool was_running = record.job.state() != v1::JOB_STATE_QUEUED;
  const absl::Time now = options_.clock();
  if (!Advance(action, now, &record.job).ok()) return;
  store_->Put(record);

  Live& live = live_.at(name);
  v1::JobEvent event;
  *event.mutable_time() = ToTimestamp(now);
  *event.mutable_job() = Snapshot(record, live);
  wakeups->logs.push_back(live.events);
  if (options_.on_transition) options_.on_transition(record.job);
  if (!IsTerminal(record.job.state())) {
    live.events->Append(std::move(event));
    return;
  }
  live.events->AppendLast(std::move(event), std::move(uv));
  live.mesh = std::string();
  live.seam_corners = live.uncut_corners = {};
  live.link = nullptr;
  if (was_running) --running_;
  Retain(name);
  if (queue_.empty() && running_ == 0 && on_idle_) wakeups->on_idle = std::exchange(on_idle_, nullptr);
}

void JobManager::Retain(const std::string& name) {
  ended_.push_back(name);
  retained_bytes_ += UvBytes(*live_.at(name).events);
  while (ended_.size() > 1 &&
         (static_cast<int>(ended_.size()) > options_.retained_jobs || retained_bytes_ > options_.retained_bytes)) {
    Forget(std::string(ended_.front()));
  }
}

void JobManager::Forget(const std::string& name) {
  retained_bytes_ -= UvBytes(*live_.at(name).events);
  ended_.erase(std::find(ended_.begin(), ended_.end(), name));
  live_.erase(name);
  store_->Delete(name);
}

}  // namespace planish
