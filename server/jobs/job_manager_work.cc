// The manager's side towards workers: what they get, what they say, who shares it.
#include <algorithm>
#include <chrono>
#include <cmath>
#include <utility>

#include "absl/strings/str_cat.h"
#include "core/base/error.h"
#include "core/base/sha256.h"
#include "core/base/status_macros.h"
#include "google/protobuf/util/time_util.h"
#include "server/jobs/job_manager.h"
#include "server/link/rpc_status.h"

namespace planish {
namespace {

using google::protobuf::util::TimeUtil;

// How much a new measurement of seconds_factor_ counts, and how far off an estimate may be believed to be.
constexpr double kLearningRate = 0.2;
constexpr double kMostFactor = 100;

// What a worker may allocate beyond the estimate: that is for sharing the machine, the limit is against faults.
constexpr std::int64_t kMemorySlack = 3;
constexpr std::int64_t kLeastMemory = std::int64_t{256} << 20;

double QueueSecondsOf(const v1::Job& job) {
  return static_cast<double>(TimeUtil::DurationToNanoseconds(job.start_time() - job.create_time())) * 1e-9;
}

absl::Status LossError(const WorkerLoss& loss, int attempts) {
  std::map<std::string, std::string> metadata = loss.metadata;
  metadata["attempts"] = absl::StrCat(attempts);
  return MakeError(absl::StatusCode::kInternal, loss.reason,
                   absl::StrCat(loss.message, attempts > 1 ? absl::StrCat(" (", attempts, " attempts)") : ""),
                   metadata);
}

}  // namespace

// ---- work and its jobs

std::optional<JobManager::KeptResult> JobManager::FindResult(const std::string& work_key) const {
  absl::StatusOr<std::optional<JobRecord>> record = store_->FindResult(work_key);
  if (!record.ok() || !record->has_value() || (*record)->job().stop_requested()) return std::nullopt;
  absl::StatusOr<BlobPtr> uv = blobs_->Find({(*record)->job().tenant(), (*record)->job().uv().uv_sha256()});
  if (!uv.ok()) return std::nullopt;
  return KeptResult{**std::move(record), *std::move(uv)};
}

Work* JobManager::FindShared(const std::string& work_key) {
  const auto shared = shared_.find(work_key);
  if (shared == shared_.end()) return nullptr;
  Work& work = works_.at(shared->second);
  return work.cancelled || work.stopped ? nullptr : &work;
}

Work& JobManager::JoinWork(Live& live, const JobNeeds& needs) {
  const std::string& name = live.record.job().name();
  Work* shared = live.record.job().scheduling().fresh() ? nullptr : FindShared(live.record.work_key());
  if (shared == nullptr) {
    shared = &works_[name];
    shared->name = name;
    shared->key = live.record.work_key();
    shared->tenant = live.record.job().tenant();
    shared->mesh_bytes = live.record.job().mesh_bytes();
    shared->needs = needs;
    shared_[shared->key] = name;
  } else {
    live.record.mutable_job()->set_result_of(shared->name);
  }
  live.work = shared->name;
  shared->jobs.push_back(name);
  if (!shared->running) Enqueue(*shared);
  return *shared;
}

void JobManager::Enqueue(Work& work) {
  std::pair<absl::Time, std::int64_t> first = {absl::InfiniteFuture(), 0};
  for (const std::string& name : work.jobs) {
    const JobRecord& record = live_.at(name).record;
    const absl::Time created = absl::FromUnixNanos(TimeUtil::TimestampToNanoseconds(record.job().create_time()));
    first = std::min(first, {QueueTime(created, record.job().scheduling().priority()), record.number()});
  }
  queue_.Push({work.name, work.tenant, first.first, first.second, work.mesh_bytes, work.needs.run_seconds},
              options_.steady_clock());
  work_or_stop_.notify_one();
}

void JobManager::LeaveWork(Live& live) {
  Work& work = works_.at(live.work);
  std::erase(work.jobs, live.record.job().name());
  if (work.jobs.empty()) {
    Remove(work.name);
  } else if (work.running) {
    SendStopIfAllWant(work);
  } else {
    Enqueue(work);
  }
}

Work JobManager::Remove(std::string name) {
  const auto found = works_.find(name);
  Work work = std::move(found->second);
  works_.erase(found);
  if (const auto shared = shared_.find(work.key); shared != shared_.end() && shared->second == name) {
    shared_.erase(shared);
  }
  queue_.Remove(name);
  if (work.running) {
    queue_.End(name, options_.steady_clock());
    reserved_memory_ -= work.needs.memory_bytes;
    work_or_stop_.notify_all();  // there is memory for others
  }
  return work;
}

Work* JobManager::FindAttempt(const std::string& name, int attempt) {
  const auto found = works_.find(name);
  if (found == works_.end() || !found->second.running || found->second.attempt != attempt) return nullptr;
  return &found->second;
}

void JobManager::SendStopIfAllWant(Work& work) {
  const bool all = std::all_of(work.jobs.begin(), work.jobs.end(), [this](const std::string& name) {
    return live_.at(name).record.job().stop_requested();
  });
  if (all && work.running && !work.stopped) work.SendStop();
}

// ---- for WorkerPool

Turn JobManager::TakeNext(absl::Duration patience, JobAssignment* assignment) {
  Wakeups wakeups;
  std::unique_lock lock(mutex_);
  const auto next = [this]() -> Work* {
    const std::optional<std::string> name = queue_.Front(options_.steady_clock());
    if (!name.has_value()) return nullptr;
    Work& work = works_.at(*name);
    const bool fits = queue_.running() == 0 || reserved_memory_ + work.needs.memory_bytes <= options_.memory_bytes;
    return fits ? &work : nullptr;
  };
  const auto until = std::chrono::steady_clock::now() + absl::ToChronoNanoseconds(std::min(patience, absl::Hours(24)));
  for (;;) {
    if (!work_or_stop_.wait_until(lock, until, [&] { return stopped_ || next() != nullptr; })) return Turn::kNothing;
    if (stopped_) return Turn::kOver;
    Work& work = *next();
    absl::StatusOr<JobAssignment> assigned = Assign(work);
    if (!assigned.ok()) {
      for (const std::string& name : Remove(work.name).jobs) Fail(live_.at(name), assigned.status(), &wakeups);
      continue;
    }
    *assignment = *std::move(assigned);
    work.running = true;
    work.attempt = assignment->attempt;
    work.start = options_.steady_clock();
    queue_.Start(work.name, work.start);
    reserved_memory_ += work.needs.memory_bytes;
    for (const std::string& name : work.jobs) Begin(live_.at(name), &wakeups);
    return Turn::kWork;
  }
}

absl::StatusOr<JobAssignment> JobManager::Assign(const Work& work) {
  const JobRecord& record = live_.at(work.jobs.front()).record;
  JobAssignment assignment;
  assignment.name = work.name;
  assignment.attempt = work.attempt + 1;
  for (const std::string& sha256 : {record.mesh_sha256(), record.seams_sha256()}) {
    if (sha256.empty()) continue;
    absl::StatusOr<BlobPtr> blob = blobs_->Find({work.tenant, sha256});
    if (!blob.ok()) {
      return MakeError(absl::StatusCode::kDataLoss, "MESH_LOST",
                       absl::StrCat("the server's store has lost the mesh: ", blob.status().message()));
    }
    assignment.blobs.push_back(*std::move(blob));
  }
  worker::v1::WorkRequest& request = assignment.request;
  request.set_job(work.name);
  *request.mutable_options() = record.job().options();
  request.set_max_threads(options_.threads);
  request.set_seam_corners(record.seam_corners());
  request.set_uncut_corners(record.uncut_corners());
  request.set_expected_bytes(work.needs.memory_bytes);
  if (work.needs.memory_bytes > 0) request.set_memory_bytes(kMemorySlack * work.needs.memory_bytes + kLeastMemory);
  request.set_max_triangles(options_.max_triangles);
  request.set_failpoint(record.failpoint());
  request.set_traceparent(record.job().traceparent());
  return assignment;
}

void JobManager::Begin(Live& live, Wakeups* wakeups) {
  v1::Job* job = live.record.mutable_job();
  job->set_attempts(job->attempts() + 1);
  live.record.set_owner(instance_);
  if (job->scheduling().has_compute_budget()) {
    const auto budget = absl::Nanoseconds(TimeUtil::DurationToNanoseconds(job->scheduling().compute_budget()));
    alarms_.emplace(options_.clock() + budget, job->name());
  }
  Apply(JobAction::kStart, live, nullptr, wakeups);
}

void JobManager::SetLink(const std::string& name, int attempt, std::shared_ptr<WorkerLink> link) {
  const std::lock_guard lock(mutex_);
  Work* work = FindAttempt(name, attempt);
  if (work == nullptr) return;
  work->link = std::move(link);
  if (work->cancelled) work->SendCancel();
  SendStopIfAllWant(*work);
}

absl::Time JobManager::ObeyBy(const std::string& name, int attempt) {
  const std::lock_guard lock(mutex_);
  const auto found = works_.find(name);
  if (found == works_.end() || found->second.attempt != attempt) return absl::InfinitePast();
  return found->second.obey_by;
}

void JobManager::ReportProgress(const std::string& name, int attempt, v1::Progress progress) {
  Wakeups wakeups;
  const std::lock_guard lock(mutex_);
  Work* work = FindAttempt(name, attempt);
  if (work == nullptr) return;
  for (const std::string& job : work->jobs) {
    Live& live = live_.at(job);
    v1::JobEvent event;
    *event.mutable_time() = ToTimestamp(options_.clock());
    *event.mutable_progress() = progress;
    if (Reserve(live)) Save(live.record, nullptr);
    live.events->Append(std::move(event));
    wakeups.logs.push_back(live.events);
  }
  work->progress = std::move(progress);
}

void JobManager::ReportResult(const std::string& name, int attempt, worker::v1::WorkResult result, BlobPtr uv) {
  std::string tenant;  // whose UV were kept
  if (result.status().code() == 0) {
    {
      const std::lock_guard lock(mutex_);
      const Work* work = FindAttempt(name, attempt);
      if (work == nullptr) return;
      tenant = work->tenant;
    }
    if (const absl::Status status = KeepUv(tenant, result.uv(), &uv); !status.ok()) {
      *result.mutable_status() = ToRpcStatus(status);
    }
  }
  Wakeups wakeups;
  const std::lock_guard lock(mutex_);
  // Unless a job ends with these UV: it may have been cancelled in the meantime.
  if (!tenant.empty()) unused_blobs_.insert({tenant, result.uv().uv_sha256()});
  if (FindAttempt(name, attempt) == nullptr) return;
  const Work work = Remove(name);
  if (result.status().code() == 0 && work.needs.run_seconds > 0) {
    const double ratio = absl::ToDoubleSeconds(options_.steady_clock() - work.start) / work.needs.run_seconds;
    seconds_factor_ += kLearningRate * (std::clamp(ratio, 1 / kMostFactor, kMostFactor) - seconds_factor_);
    queue_.SetSecondsFactor(seconds_factor_);
  }
  if (options_.observer != nullptr) {
    options_.observer->OnWorkEnded(live_.at(work.jobs.front()).record.job(), result,
                                   options_.steady_clock() - work.start);
  }
  for (const std::string& job : work.jobs) EndJob(live_.at(job), result, uv, &wakeups);
}

// Not under the lock: results may be large.
absl::Status JobManager::KeepUv(const std::string& tenant, const v1::UvDescription& description, BlobPtr* uv) {
  if (*uv == nullptr || description.total_bytes() != static_cast<std::int64_t>((*uv)->bytes().size())) {
    return InternalError("the worker sent UV of another length than it says");
  }
  const std::string sha256 = Sha256((*uv)->bytes());
  if (sha256 != description.uv_sha256()) return InternalError("the worker sent other UV than it says");
  PLANISH_ASSIGN_OR_RETURN(*uv, PutBlob(tenant, (*uv)->bytes(), sha256));
  return absl::OkStatus();
}

void JobManager::EndJob(Live& live, const worker::v1::WorkResult& result, BlobPtr uv, Wakeups* wakeups) {
  const auto code = static_cast<absl::StatusCode>(result.status().code());
  const bool ended_well = code == absl::StatusCode::kOk || code == absl::StatusCode::kCancelled;
  if (live.timed_out) return Fail(live, TimedOut(live.record.job()), wakeups);
  if (live.record.cancel_requested() && ended_well) return Apply(JobAction::kCancelled, live, nullptr, wakeups);
  if (code == absl::StatusCode::kCancelled) {
    return Fail(live, InternalError("the worker cancelled a job that nobody cancelled"), wakeups);
  }
  v1::Job* job = live.record.mutable_job();
  if (code != absl::StatusCode::kOk) {
    *job->mutable_error() = result.status();
    return Apply(JobAction::kFail, live, nullptr, wakeups);
  }
  *job->mutable_report() = result.report();
  job->mutable_report()->mutable_seconds()->set_queue(QueueSecondsOf(*job));
  *job->mutable_uv() = result.uv();
  Apply(JobAction::kSucceed, live, std::move(uv), wakeups);
}

void JobManager::ReportLost(const std::string& name, int attempt, WorkerLoss loss) {
  Wakeups wakeups;
  const std::lock_guard lock(mutex_);
  if (FindAttempt(name, attempt) == nullptr) return;
  Work work = Remove(name);
  const v1::Job first = live_.at(work.jobs.front()).record.job();
  std::vector<std::string> again;
  for (const std::string& job : work.jobs) {
    Live& live = live_.at(job);
    live.record.set_crashes(live.record.crashes() + 1);
    if (live.timed_out) {
      Fail(live, TimedOut(live.record.job()), &wakeups);
    } else if (live.record.cancel_requested()) {
      Apply(JobAction::kCancelled, live, nullptr, &wakeups);
    } else if (live.record.crashes() >= options_.max_crashes || stopped_) {
      Fail(live, LossError(loss, live.record.job().attempts()), &wakeups);
    } else {
      again.push_back(job);
    }
  }
  if (options_.observer != nullptr) {
    options_.observer->OnWorkLost(first, loss, static_cast<int>(again.size()), options_.steady_clock() - work.start);
  }
  if (again.empty()) return;
  Work next;
  next.name = work.name;
  next.key = work.key;
  next.tenant = work.tenant;
  next.jobs = std::move(again);
  next.mesh_bytes = work.mesh_bytes;
  next.needs = work.needs;
  next.attempt = work.attempt;
  shared_.try_emplace(next.key, next.name);
  Work& queued = works_[work.name] = std::move(next);
  Enqueue(queued);
  for (const std::string& job : queued.jobs) Apply(JobAction::kRequeue, live_.at(job), nullptr, &wakeups);
}

}  // namespace planish
