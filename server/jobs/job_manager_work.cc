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

// Another attempt would need as much.
bool IsOutOfMemory(const WorkerLoss& loss) {
  return loss.reason == "OUT_OF_MEMORY";
}

}  // namespace

// ---- work and its jobs

std::optional<JobManager::KeptResult> JobManager::FindResult(const std::string& work_key) const {
  absl::StatusOr<std::optional<JobRecord>> record = store_->FindResult(work_key);
  if (!record.ok() || !record->has_value() || (*record)->job().stop_requested()) return std::nullopt;
  absl::StatusOr<StoredBlobPtr> uv = blobs_->Find({(*record)->job().tenant(), (*record)->job().uv().uv_sha256()});
  if (!uv.ok()) return std::nullopt;
  return KeptResult{**std::move(record), *std::move(uv)};
}

StoredBlobPtr JobManager::OpenKeptResult(const std::string& work_key) {
  if (!blobs_->is_durable()) return nullptr;
  BlobId id;
  {
    const std::lock_guard lock(mutex_);
    const absl::StatusOr<std::optional<JobRecord>> record = store_->FindResult(work_key);
    if (!record.ok() || !record->has_value()) return nullptr;
    id = {(*record)->job().tenant(), (*record)->job().uv().uv_sha256()};
  }
  absl::StatusOr<StoredBlobPtr> uv = blobs_->Find(id);
  return uv.ok() ? *std::move(uv) : nullptr;
}

Work* JobManager::FindShared(const std::string& work_key) {
  const auto shared = shared_.find(work_key);
  if (shared == shared_.end()) return nullptr;
  Work& work = works_.at(shared->second);
  return work.cancelled || work.stopped ? nullptr : &work;
}

void JobManager::JoinWork(Live& live, const JobNeeds& needs) {
  const JobRecord& record = live.record;
  if (unended_.contains(record.work())) return;  // it ends with that
  const auto [found, is_new] = works_.try_emplace(record.work());
  Work& work = found->second;
  if (is_new) {
    work.name = record.work();
    work.key = record.work_key();
    work.tenant = record.job().tenant();
    work.mesh_bytes = record.job().mesh_bytes();
    work.needs = needs;
    work.attempt = record.attempt();
    shared_[work.key] = work.name;
  }
  work.jobs.push_back(record.job().name());
  if (!work.running) Enqueue(work);
}

void JobManager::Enqueue(Work& work) {
  std::pair<absl::Time, std::int64_t> first = {absl::InfiniteFuture(), 0};
  work.alone = false;
  for (const std::string& name : work.jobs) {
    const JobRecord& record = live_.at(name).record;
    work.alone = work.alone || (record.server_crashes() > 0 && record.crashes() + 1 >= options_.max_attempts);
    const absl::Time created = absl::FromUnixNanos(TimeUtil::TimestampToNanoseconds(record.job().create_time()));
    first = std::min(first, {QueueTime(created, record.job().scheduling().priority()), record.number()});
  }
  queue_.Push({work.name, work.tenant, first.first, first.second, work.mesh_bytes, work.needs.run_seconds},
              options_.steady_clock());
  work_or_stop_.notify_one();
}

void JobManager::LeaveWork(Live& live) {
  Work& work = works_.at(live.work());
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
    if (work.alone) --alone_running_;
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

Work* JobManager::NextWork() {
  const absl::Time now = options_.steady_clock();
  if (now < next_start_) return nullptr;
  const std::optional<std::string> name = queue_.Front(now);
  if (!name.has_value()) return nullptr;
  Work& work = works_.at(*name);
  if (queue_.running() == 0) return &work;
  const bool fits = reserved_memory_ + work.needs.memory_bytes <= options_.memory_bytes;
  return fits && !work.alone && alone_running_ == 0 ? &work : nullptr;
}

Turn JobManager::TakeNext(absl::Duration patience, JobAssignment* assignment) {
  // What was read, without the lock, for the work that was next when that began.
  std::string loaded_for;
  absl::StatusOr<std::vector<BlobPtr>> loaded = std::vector<BlobPtr>();
  Wakeups wakeups;
  std::unique_lock lock(mutex_);
  const auto until = std::chrono::steady_clock::now() + absl::ToChronoNanoseconds(std::min(patience, absl::Hours(24)));
  for (;;) {
    Work* next = nullptr;
    const auto ready = [&] { return stopped_ || (next = NextWork()) != nullptr; };
    if (!work_or_stop_.wait_until(lock, until, ready)) return Turn::kNothing;
    if (stopped_) return Turn::kOver;
    Work& work = *next;
    if (loaded_for != work.name) {
      loaded_for = work.name;
      const JobRecord& record = live_.at(work.jobs.front()).record;
      const std::vector<std::string> digests = {record.mesh_sha256(), record.seams_sha256()};
      const std::string tenant = work.tenant;
      lock.unlock();
      loaded = LoadBlobs(tenant, digests);
      lock.lock();
      continue;
    }
    loaded_for.clear();
    if (absl::IsNotFound(loaded.status()) || absl::IsDataLoss(loaded.status())) {
      // Their request ids are free: a caller that has the mesh sends it again, for a new job.
      absl::Status written;
      for (const std::string& name : std::vector<std::string>(work.jobs)) {
        if (written.ok()) written = Fail(live_.at(name), MeshLost(loaded.status()), /*forget=*/true, &wakeups);
      }
      if (!written.ok()) Postpone(written);
      continue;
    }
    if (!loaded.ok()) {
      Postpone(loaded.status());
      continue;
    }
    if (const absl::Status status = StartWork(work, &wakeups); !status.ok()) {
      Postpone(status);
      continue;
    }
    *assignment = Assign(work, *std::move(loaded));
    return Turn::kWork;
  }
}

absl::StatusOr<std::vector<BlobPtr>> JobManager::LoadBlobs(const std::string& tenant,
                                                           const std::vector<std::string>& digests) {
  std::vector<BlobPtr> blobs;
  for (const std::string& sha256 : digests) {
    if (sha256.empty()) continue;
    PLANISH_ASSIGN_OR_RETURN(BlobPtr blob, blobs_->Load({tenant, sha256}));
    blobs.push_back(std::move(blob));
  }
  return blobs;
}

absl::Status JobManager::MeshLost(const absl::Status& why) {
  return MakeError(absl::StatusCode::kDataLoss, "MESH_LOST",
                   absl::StrCat("the server's store has lost the mesh, send it again: ", why.message()));
}

void JobManager::Postpone(const absl::Status& why) {
  next_start_ = options_.steady_clock() + options_.retry_delay;
  if (options_.on_store_error) options_.on_store_error(why);
}

absl::Status JobManager::StartWork(Work& work, Wakeups* wakeups) {
  // A process that has the store to itself needs no end of leases.
  PLANISH_ASSIGN_OR_RETURN(std::vector<ClaimedWork> claimed,
                           store_->Claim(Context(), {instance_, absl::InfiniteDuration(), 1, 0, work.name}));
  if (claimed.empty()) return InternalError(absl::StrCat(work.name, " does not wait, as the store has it"));
  work.running = true;
  work.attempt = claimed[0].lease.attempt;
  work.start = options_.steady_clock();
  queue_.Start(work.name, work.start);
  reserved_memory_ += work.needs.memory_bytes;
  if (work.alone) ++alone_running_;
  for (JobChange& change : claimed[0].jobs) {
    Live& live = live_.at(change.record.job().name());
    StartBudget(live);
    Adopt(live, std::move(change), nullptr, wakeups);
  }
  return absl::OkStatus();
}

JobAssignment JobManager::Assign(const Work& work, std::vector<BlobPtr> blobs) const {
  const JobRecord& record = live_.at(work.jobs.front()).record;
  JobAssignment assignment;
  assignment.name = work.name;
  assignment.attempt = work.attempt;
  assignment.blobs = std::move(blobs);
  worker::v1::WorkRequest& request = assignment.request;
  request.set_job(work.name);
  *request.mutable_options() = record.job().options();
  request.set_max_threads(options_.threads);
  request.set_seam_corners(record.seam_corners());
  request.set_uncut_corners(record.uncut_corners());
  if (record.has_array_vertices()) request.set_array_vertices(record.array_vertices());
  // What was reserved is all there is: the jobs beside it have the rest.
  request.set_expected_bytes(work.needs.memory_bytes);
  request.set_memory_bytes(work.needs.memory_bytes);
  request.set_max_triangles(options_.max_triangles);
  request.set_failpoint(record.failpoint());
  request.set_traceparent(record.job().traceparent());
  return assignment;
}

void JobManager::StartBudget(Live& live) {
  const v1::Scheduling& scheduling = live.record.job().scheduling();
  if (!scheduling.has_compute_budget()) return;
  SetAlarm(live, options_.clock() + absl::Nanoseconds(TimeUtil::DurationToNanoseconds(scheduling.compute_budget())));
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
    if (live.events->last_sequence() >= live.record.reserved_sequence()) {
      absl::StatusOr<JobChange> change = store_->ReserveSequences(Context(), job, kSequenceBlock);
      if (!change.ok()) continue;  // numbers that may be given twice are worse than news that do not come
      live.record = std::move(change->record);
    }
    live.events->Append(std::move(event));
    wakeups.logs.push_back(live.events);
  }
  work->progress = std::move(progress);
}

void JobManager::ReportResult(const std::string& name, int attempt, worker::v1::WorkResult result, BlobPtr uv) {
  std::string tenant;  // whose UV were kept
  StoredBlobPtr kept;
  if (result.status().code() == 0) {
    {
      const std::lock_guard lock(mutex_);
      const Work* work = FindAttempt(name, attempt);
      if (work == nullptr) return;
      tenant = work->tenant;
    }
    absl::StatusOr<StoredBlobPtr> stored = KeepUv(tenant, result.uv(), uv);
    if (stored.ok()) {
      kept = *std::move(stored);
    } else {
      *result.mutable_status() = ToRpcStatus(stored.status());
    }
    uv = nullptr;  // the store has them
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
  Ending ending;
  ending.work = work;
  ending.outcome.status = std::move(*result.mutable_status());
  ending.outcome.report = std::move(*result.mutable_report());
  ending.outcome.uv = std::move(*result.mutable_uv());
  ending.outcome.blobs = Pending(work.tenant, {ending.outcome.uv.uv_sha256()});
  ending.uv = std::move(kept);
  Finish(std::move(ending), &wakeups);
}

// Not under the lock: results may be large.
absl::StatusOr<StoredBlobPtr> JobManager::KeepUv(const std::string& tenant, const v1::UvDescription& description,
                                                 const BlobPtr& uv) {
  if (uv == nullptr || description.total_bytes() != static_cast<std::int64_t>(uv->bytes().size())) {
    return InternalError("the worker sent UV of another length than it says");
  }
  const std::string sha256 = Sha256(uv->bytes());
  if (sha256 != description.uv_sha256()) return InternalError("the worker sent other UV than it says");
  return PutBlob(tenant, uv->bytes(), sha256);
}

bool JobManager::Finish(Ending ending, Wakeups* wakeups) {
  const Work& work = ending.work;
  absl::StatusOr<std::vector<JobChange>> changes =
      store_->Finish(Context(), {work.name, work.attempt, instance_}, ending.outcome);
  if (absl::IsAborted(changes.status())) return true;  // all of its jobs have ended otherwise
  if (!changes.ok()) {
    if (options_.on_store_error) options_.on_store_error(changes.status());
    const std::string name = work.name;
    unended_.insert_or_assign(name, std::move(ending));
    return false;
  }
  Committed(ending.outcome.blobs);
  std::vector<std::string> again;
  for (const JobChange& change : *changes) {
    if (change.record.job().state() != v1::JOB_STATE_QUEUED) continue;
    again.push_back(change.record.job().name());
    live_.at(again.back()).record = change.record;
  }
  if (ending.outcome.loss.has_value() && options_.observer != nullptr) {
    options_.observer->OnWorkLost(live_.at(work.jobs.front()).record.job(), ending.loss, static_cast<int>(again.size()),
                                  ending.duration);
  }
  if (!again.empty()) Requeue(work, std::move(again));
  for (JobChange& change : *changes) {
    Live& live = live_.at(change.record.job().name());
    const bool succeeded = change.record.job().state() == v1::JOB_STATE_SUCCEEDED;
    Adopt(live, std::move(change), succeeded ? ending.uv : nullptr, wakeups);
  }
  return true;
}

void JobManager::Requeue(const Work& work, std::vector<std::string> jobs) {
  Work& next = works_[work.name];
  next.name = work.name;
  next.key = work.key;
  next.tenant = work.tenant;
  next.jobs = std::move(jobs);
  next.mesh_bytes = work.mesh_bytes;
  next.needs = work.needs;
  next.attempt = work.attempt;
  shared_.try_emplace(next.key, next.name);
  Enqueue(next);
}

void JobManager::ReportLost(const std::string& name, int attempt, WorkerLoss loss) {
  Wakeups wakeups;
  const std::lock_guard lock(mutex_);
  if (FindAttempt(name, attempt) == nullptr) return;
  Ending ending;
  ending.work = Remove(name);
  ending.outcome.loss = {loss.reason, loss.message, loss.metadata, IsOutOfMemory(loss) || stopped_};
  ending.loss = std::move(loss);
  ending.duration = options_.steady_clock() - ending.work.start;
  Finish(std::move(ending), &wakeups);
}

}  // namespace planish
