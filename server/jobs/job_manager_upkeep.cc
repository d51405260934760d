// The manager's books: every change of state, early ends, what is kept and for how long, restart and shutdown.
#include <algorithm>
#include <utility>

#include "absl/strings/str_cat.h"
#include "core/base/error.h"
#include "core/base/status_macros.h"
#include "google/protobuf/util/time_util.h"
#include "server/jobs/job_manager.h"
#include "server/link/rpc_status.h"

namespace planish {
namespace {

using google::protobuf::util::TimeUtil;

constexpr std::size_t kEndedLogs = 64;

// Blobs that somebody else stopped using are found by a look at all of them, every so often.
constexpr absl::Duration kSweepInterval = absl::Minutes(10);
// So many at a time: each takes a look into the store, under the lock.
constexpr std::size_t kSweepSlice = 64;

absl::Duration ToDuration(const google::protobuf::Duration& duration) {
  return absl::Nanoseconds(TimeUtil::DurationToNanoseconds(duration));
}

absl::Time ToTime(const google::protobuf::Timestamp& timestamp) {
  return absl::FromUnixNanos(TimeUtil::TimestampToNanoseconds(timestamp));
}

}  // namespace

// ---- one place for every change

void JobManager::Apply(JobAction action, Live& live, StoredBlobPtr uv, Wakeups* wakeups) {
  if (live.ending.has_value()) return;
  const absl::Time now = options_.clock();
  v1::Job* job = live.record.mutable_job();
  const v1::JobState before = job->state();
  if (!Advance(action, now, job).ok()) return;
  if (job->state() == v1::JOB_STATE_SUCCEEDED && options_.limits.retained_time < absl::InfiniteDuration()) {
    *job->mutable_expire_time() = ToTimestamp(now + options_.limits.retained_time);
  }
  if (!IsTerminal(job->state())) return Announce(live, wakeups);

  Ending ending;
  ending.event = NextEvent(live);
  ending.record = std::move(live.record);
  ending.uv = std::move(uv);
  if (WriteEnd(ending)) return Conclude(live, std::move(ending), wakeups);
  // Nobody hears of an end that a loss of power could take back: as far as others see, the job goes on.
  live.record = ending.record;
  job = live.record.mutable_job();
  job->set_state(before);
  job->clear_report();
  job->clear_uv();
  job->clear_error();
  job->clear_end_time();
  job->clear_expire_time();
  unended_.insert(job->name());
  live.ending = std::move(ending);
}

void JobManager::Announce(Live& live, Wakeups* wakeups) {
  v1::JobEvent event = NextEvent(live);
  if (options_.on_transition) options_.on_transition(live.record.job());
  Save(live.record, &event);
  live.events->Append(std::move(event));
  wakeups->logs.push_back(live.events);
}

v1::JobEvent JobManager::NextEvent(Live& live) {
  Reserve(live);
  v1::JobEvent event;
  event.set_sequence(live.events->last_sequence() + 1);
  *event.mutable_time() = ToTimestamp(options_.clock());
  *event.mutable_job() = Snapshot(live.record);
  return event;
}

bool JobManager::Reserve(Live& live) {
  if (live.events->last_sequence() < live.record.reserved_sequence()) return false;
  live.record.set_reserved_sequence(live.events->last_sequence() + kSequenceBlock);
  return true;
}

absl::Status JobManager::Write(const JobRecord& record, const v1::JobEvent* event) {
  JobWrite write = {&record, event, {}};
  for (const std::string& sha256 : {record.mesh_sha256(), record.seams_sha256(), record.job().uv().uv_sha256()}) {
    if (sha256.empty()) continue;
    const BlobId id = {record.job().tenant(), sha256};
    if (StoredBlobPtr pending = blobs_->Pending(id)) write.blobs.push_back({id, std::move(pending)});
  }
  PLANISH_RETURN_IF_ERROR(store_->Write({write}, Durability::kNow));
  for (const BlobRow& blob : write.blobs) blobs_->Committed(blob.id);
  return absl::OkStatus();
}

void JobManager::Save(const JobRecord& record, const v1::JobEvent* event) {
  const absl::Status status = Write(record, event);
  if (status.ok()) {
    unsaved_.erase(record.job().name());
    return;
  }
  unsaved_.insert(record.job().name());
  if (options_.on_store_error) options_.on_store_error(status);
}

bool JobManager::WriteEnd(const Ending& ending) {
  const absl::Status status = Write(ending.record, &ending.event);
  if (!status.ok() && options_.on_store_error) options_.on_store_error(status);
  return status.ok();
}

void JobManager::Conclude(Live& live, Ending ending, Wakeups* wakeups) {
  const JobRecord& record = ending.record;
  const std::string& name = record.job().name();
  wakeups->logs.push_back(live.events);
  if (options_.on_transition) options_.on_transition(record.job());
  live.events->AppendLast(std::move(ending.event), std::move(ending.uv));
  ended_logs_.emplace_front(name, std::move(live.events));
  if (ended_logs_.size() > kEndedLogs) ended_logs_.pop_back();
  for (const absl::Time alarm : live.alarms) alarms_.erase({alarm, name});
  unsaved_.erase(name);
  unended_.erase(name);
  live_.erase(name);
  const std::string& tenant = record.job().tenant();
  ++totals_.tenants[tenant].ended;
  if (record.job().state() == v1::JOB_STATE_SUCCEEDED) {
    totals_.tenants[tenant].result_bytes += record.job().uv().total_bytes();
  }
  last_ended_[tenant] = name;
  ReleaseBlobs(record);
  Retain();
  CheckIdle(wakeups);
}

void JobManager::WriteWhatIsLeft(Wakeups* wakeups) {
  for (const std::string& name : std::vector<std::string>(unended_.begin(), unended_.end())) {
    Live& live = live_.at(name);
    if (!WriteEnd(*live.ending)) return;  // the others fare no better
    Ending ending = *std::move(live.ending);
    Conclude(live, std::move(ending), wakeups);
  }
  for (const std::string& name : std::vector<std::string>(unsaved_.begin(), unsaved_.end())) {
    const JobRecord& record = live_.at(name).record;
    if (!Write(record, nullptr).ok()) return;
    unsaved_.erase(name);
  }
}

// ---- early ends

absl::Status JobManager::TimedOut(const v1::Job& job) {
  return MakeError(absl::StatusCode::kDeadlineExceeded, "DEADLINE_EXCEEDED",
                   absl::StrCat("the job had not ended ", absl::FormatDuration(ToDuration(job.scheduling().timeout())),
                                " after it was accepted (Scheduling.timeout)"));
}

void JobManager::StartClocks(Live& live) {
  const v1::Job& job = live.record.job();
  if (job.scheduling().has_timeout()) {
    SetAlarm(live, ToTime(job.create_time()) + ToDuration(job.scheduling().timeout()));
  }
}

void JobManager::SetAlarm(Live& live, absl::Time time) {
  if (alarms_.emplace(time, live.record.job().name()).second) live.alarms.push_back(time);
}

void JobManager::CheckClocks(const std::string& name, absl::Time now, Wakeups* wakeups) {
  const auto found = live_.find(name);
  if (found == live_.end()) return;
  Live& live = found->second;
  if (live.ending.has_value()) return;
  const v1::Job& job = live.record.job();
  const v1::Scheduling& limits = job.scheduling();
  const bool left_alone = live.attachments == 0 && live.record.attached();
  if (left_alone && now - live.orphaned >= options_.limits.reattach_grace) {
    live.record.clear_request_id();
    return EndEarly(live, EarlyEnd::kCancel, wakeups);
  }
  if (limits.has_timeout() && now - ToTime(job.create_time()) >= ToDuration(limits.timeout())) {
    return EndEarly(live, EarlyEnd::kTimeout, wakeups);
  }
  const bool runs = job.state() == v1::JOB_STATE_RUNNING;
  if (runs && limits.has_compute_budget() && now - ToTime(job.start_time()) >= ToDuration(limits.compute_budget())) {
    StopLocked(live, wakeups);
  }
}

void JobManager::EndEarly(Live& live, EarlyEnd why, Wakeups* wakeups) {
  if (live.record.job().cancel_requested() || live.timed_out || live.ending.has_value()) return;
  if (why == EarlyEnd::kCancel) {
    live.record.mutable_job()->set_cancel_requested(true);
  } else {
    live.timed_out = true;
  }
  Work& work = works_.at(live.work);
  if (work.running && work.jobs.size() == 1) {
    // The worker has to answer first.
    work.obey_by = options_.clock() + options_.obey_limit;
    work.SendCancel();
    if (live.record.job().state() == v1::JOB_STATE_RUNNING) return Apply(JobAction::kCancel, live, nullptr, wakeups);
    return Save(live.record, nullptr);
  }
  LeaveWork(live);
  if (why == EarlyEnd::kTimeout) return Fail(live, TimedOut(live.record.job()), wakeups);
  const bool was_queued = live.record.job().state() == v1::JOB_STATE_QUEUED;
  if (was_queued) return Apply(JobAction::kCancel, live, nullptr, wakeups);
  if (live.record.job().state() == v1::JOB_STATE_RUNNING) Apply(JobAction::kCancel, live, nullptr, wakeups);
  Apply(JobAction::kCancelled, live, nullptr, wakeups);
}

void JobManager::StopLocked(Live& live, Wakeups* wakeups) {
  v1::Job* job = live.record.mutable_job();
  if (job->stop_requested() || live.ending.has_value()) return;
  job->set_stop_requested(true);
  if (job->state() == v1::JOB_STATE_RUNNING) {
    Apply(JobAction::kStop, live, nullptr, wakeups);
  } else {
    Announce(live, wakeups);
  }
  SendStopIfAllWant(works_.at(live.work));
}

void JobManager::Fail(Live& live, const absl::Status& error, Wakeups* wakeups) {
  *live.record.mutable_job()->mutable_error() = ToRpcStatus(error);
  Apply(JobAction::kFail, live, nullptr, wakeups);
}

// ---- what is kept

void JobManager::Tick() {
  const absl::Time now = options_.clock();
  bool sweeps = false;
  {
    const std::lock_guard lock(mutex_);
    sweeps = !suspended_ && now >= next_sweep_;
    if (sweeps) next_sweep_ = now + kSweepInterval;
  }
  std::vector<BlobId> sweep;
  if (sweeps) sweep = blobs_->Ids();  // without the lock: there may be many
  Wakeups wakeups;
  const std::lock_guard lock(mutex_);
  if (suspended_) return;
  if (sweeps) sweep_ = std::move(sweep);
  while (!alarms_.empty() && alarms_.begin()->first <= now) {
    const auto [time, name] = *alarms_.begin();
    alarms_.erase(alarms_.begin());
    if (const auto live = live_.find(name); live != live_.end()) std::erase(live->second.alarms, time);
    CheckClocks(name, now, &wakeups);
  }
  WriteWhatIsLeft(&wakeups);
  if (next_start_ > absl::InfinitePast() && options_.steady_clock() >= next_start_) {
    next_start_ = absl::InfinitePast();
    work_or_stop_.notify_all();
  }
  Retain();
  CollectBlobs();
}

void JobManager::Retain() {
  const absl::Time now = options_.clock();
  while (now >= next_expiry_) {
    const absl::StatusOr<std::optional<JobRecord>> oldest = store_->FirstEnded("", v1::JOB_STATE_SUCCEEDED);
    if (!oldest.ok()) break;
    next_expiry_ = (oldest->has_value() ? ToTime((*oldest)->job().end_time()) : now) + options_.limits.retained_time;
    if (!oldest->has_value() || now < next_expiry_ || !Expire(**oldest)) break;
  }
  std::vector<std::string> tenants;
  for (const auto& [tenant, totals] : totals_.tenants) tenants.push_back(tenant);
  for (const std::string& tenant : tenants) RetainOf(tenant);
}

void JobManager::RetainOf(const std::string& tenant) {
  TenantTotals& totals = totals_.tenants[tenant];
  while (totals.result_bytes > options_.limits.retained_bytes) {
    const absl::StatusOr<std::optional<JobRecord>> oldest = store_->FirstEnded(tenant, v1::JOB_STATE_SUCCEEDED);
    if (!oldest.ok() || !oldest->has_value() || (*oldest)->job().name() == last_ended_[tenant]) break;
    if (!Expire(**oldest)) break;
  }
  while (totals.ended > std::max(options_.limits.retained_jobs, 1)) {
    const absl::StatusOr<std::optional<JobRecord>> oldest = store_->FirstEnded(tenant, v1::JOB_STATE_UNSPECIFIED);
    if (!oldest.ok() || !oldest->has_value() || !Forget(**oldest).ok()) break;
  }
}

bool JobManager::Expire(JobRecord record) {
  v1::Job* job = record.mutable_job();
  if (!Advance(JobAction::kExpire, options_.clock(), job).ok()) return false;
  record.clear_request_id();  // a caller that asks again wants UV
  if (const absl::Status status = store_->Write({{&record, nullptr, {}}}, Durability::kLater); !status.ok()) {
    if (options_.on_store_error) options_.on_store_error(status);
    return false;
  }
  if (options_.on_transition) options_.on_transition(*job);
  totals_.tenants[job->tenant()].result_bytes -= job->uv().total_bytes();
  ended_logs_.remove_if([&](const auto& ended) { return ended.first == job->name(); });
  ReleaseBlobs(record);
  return true;
}

absl::Status JobManager::Forget(const JobRecord& record) {
  PLANISH_RETURN_IF_ERROR(store_->Delete(record.number()));
  const v1::Job& job = record.job();
  TenantTotals& totals = totals_.tenants[job.tenant()];
  --totals.ended;
  if (job.state() == v1::JOB_STATE_SUCCEEDED) totals.result_bytes -= job.uv().total_bytes();
  ended_logs_.remove_if([&](const auto& ended) { return ended.first == job.name(); });
  ReleaseBlobs(record);
  return absl::OkStatus();
}

void JobManager::ReleaseBlobs(const JobRecord& record) {
  for (const std::string& sha256 : {record.mesh_sha256(), record.seams_sha256(), record.job().uv().uv_sha256()}) {
    if (!sha256.empty()) unused_blobs_.insert({record.job().tenant(), sha256});
  }
}

bool JobManager::IsBlobUsed(const BlobId& id) const {
  if (options_.is_blob_used != nullptr && options_.is_blob_used(id)) return true;
  const absl::StatusOr<bool> used = store_->UsesBlob(id);
  return !used.ok() || *used;
}

void JobManager::CollectBlobs() {
  for (std::size_t i = 0; i < kSweepSlice && !sweep_.empty(); ++i) {
    unused_blobs_.insert(std::move(sweep_.back()));
    sweep_.pop_back();
  }
  std::erase_if(unused_blobs_, [this](const BlobId& id) { return IsBlobUsed(id) || blobs_->Remove(id); });
}

// ---- restart

absl::Status JobManager::Recover() {
  Wakeups wakeups;
  const std::lock_guard lock(mutex_);
  PLANISH_ASSIGN_OR_RETURN(totals_, store_->Totals());
  PLANISH_ASSIGN_OR_RETURN(std::vector<JobRecord> records, store_->Unfinished());
  for (JobRecord& record : records) PLANISH_RETURN_IF_ERROR(RecoverJob(std::move(record), &wakeups));
  next_sweep_ = options_.clock() + kSweepInterval;
  blobs_->Collect([this](const BlobId& id) { return IsBlobUsed(id); });
  return absl::OkStatus();
}

absl::Status JobManager::RecoverJob(JobRecord record, Wakeups* wakeups) {
  const std::string name = record.job().name();
  PLANISH_ASSIGN_OR_RETURN(std::vector<v1::JobEvent> events, store_->Events(record.number()));
  Live& live = live_[name];
  live.events = std::make_shared<JobEventLog>(options_.events_per_job);
  for (v1::JobEvent& event : events) live.events->Restore(std::move(event), record.reserved_sequence());
  live.record = std::move(record);
  Reserve(live);
  v1::Job* job = live.record.mutable_job();
  if (live.record.attached()) {
    live.orphaned = options_.clock();
    SetAlarm(live, live.orphaned + options_.limits.reattach_grace);
  }
  // A server that ended in order has released what it ran. Whoever dies without that may have died of the job.
  const bool was_lost = !live.record.owner().empty() && job->state() != v1::JOB_STATE_QUEUED;
  if (was_lost) {
    live.record.set_crashes(live.record.crashes() + 1);
    live.record.set_server_crashes(live.record.server_crashes() + 1);
  }
  live.record.clear_owner();
  if (live.record.job().cancel_requested()) {
    if (job->state() != v1::JOB_STATE_STOPPING) Apply(JobAction::kCancel, live, nullptr, wakeups);
    if (live_.contains(name)) Apply(JobAction::kCancelled, live, nullptr, wakeups);
    return absl::OkStatus();
  }
  if (was_lost && live.record.crashes() >= options_.max_attempts) {
    Fail(live,
         MakeError(absl::StatusCode::kInternal, "SERVER_CRASHED",
                   absl::StrCat("the server died while it ran the job (", job->attempts(), " attempts)"),
                   {{"attempts", absl::StrCat(job->attempts())}}),
         wakeups);
    return absl::OkStatus();
  }
  const absl::StatusOr<std::vector<BlobPtr>> blobs =
      LoadBlobs(job->tenant(), {live.record.mesh_sha256(), live.record.seams_sha256()});
  if (absl::IsNotFound(blobs.status()) || absl::IsDataLoss(blobs.status())) {
    live.record.clear_request_id();  // a caller that has the mesh sends it again, for a new job
    Fail(live, MeshLost(blobs.status()), wakeups);
    return absl::OkStatus();
  }
  PLANISH_RETURN_IF_ERROR(blobs.status());
  std::optional<std::int64_t> array_vertices;
  if (live.record.has_array_vertices()) array_vertices = live.record.array_vertices();
  const absl::StatusOr<JobNeeds> needs =
      NeedsOf(blobs->front()->bytes(), array_vertices, job->mesh_bytes(), v1::MeshSize(), job->options());
  if (!needs.ok()) {
    Fail(live, needs.status(), wakeups);  // the limits are lower than they were
    return absl::OkStatus();
  }
  job->set_memory_bytes(needs->memory_bytes);
  job->clear_result_of();
  JoinWork(live, *needs);
  if (job->state() == v1::JOB_STATE_QUEUED) {
    Save(live.record, nullptr);
  } else {
    Apply(JobAction::kRequeue, live, nullptr, wakeups);
  }
  StartClocks(live);
  return absl::OkStatus();
}

// ---- shutdown

void JobManager::Drain(std::function<void()> on_idle) {
  Wakeups wakeups;
  const std::lock_guard lock(mutex_);
  draining_ = true;
  if (on_idle == nullptr) return;
  ending_ = true;
  on_idle_ = std::move(on_idle);
  CheckIdle(&wakeups);
}

absl::Status JobManager::Undrain() {
  const std::lock_guard lock(mutex_);
  if (ending_ || suspended_) {
    return MakeError(absl::StatusCode::kFailedPrecondition, "SHUTTING_DOWN",
                     "the server is about to end: that cannot be taken back");
  }
  draining_ = false;
  return absl::OkStatus();
}

void JobManager::CheckIdle(Wakeups* wakeups) {
  if (on_idle_ && live_.empty()) wakeups->on_idle = std::exchange(on_idle_, nullptr);
}

void JobManager::CancelAll() {
  Wakeups wakeups;
  const std::lock_guard lock(mutex_);
  if (suspended_) return;
  std::vector<std::string> names;
  for (const auto& [name, live] : live_) names.push_back(name);
  for (const std::string& name : names) EndEarly(live_.at(name), EarlyEnd::kCancel, &wakeups);
}

void JobManager::Suspend() {
  Wakeups wakeups;
  const std::lock_guard lock(mutex_);
  draining_ = ending_ = suspended_ = stopped_ = true;
  work_or_stop_.notify_all();
  const absl::Status status = WithRetryDelay(MakeError(absl::StatusCode::kUnavailable, "DRAINING",
                                                       "the server is shutting down; the job goes on when it is back"),
                                             options_.retry_delay);
  WriteWhatIsLeft(&wakeups);
  std::vector<JobWrite> released;
  for (auto& [name, live] : live_) {
    // An end that cannot be written is lost, and the job runs again.
    if (!live.record.owner().empty() && live.record.job().state() != v1::JOB_STATE_QUEUED) {
      live.record.clear_owner();
      released.push_back({&live.record, nullptr, {}});
    }
    live.events->Interrupt(status);
    wakeups.logs.push_back(live.events);
  }
  if (!released.empty()) {
    const absl::Status written = store_->Write(released, Durability::kNow);
    if (!written.ok() && options_.on_store_error) options_.on_store_error(written);
  }
  for (auto& [name, work] : works_) {
    if (work.link != nullptr) work.link->Close();
  }
  works_.clear();
  shared_.clear();
  if (on_idle_) wakeups.on_idle = std::exchange(on_idle_, nullptr);
}

void JobManager::FailAll(const absl::Status& error) {
  Wakeups wakeups;
  const std::lock_guard lock(mutex_);
  draining_ = ending_ = true;
  if (suspended_) return;
  std::vector<std::string> names;
  for (const auto& [name, live] : live_) names.push_back(name);
  for (const std::string& name : names) {
    Live& live = live_.at(name);
    if (live.ending.has_value()) continue;
    Work& work = works_.at(live.work);
    if (work.running && work.link != nullptr) work.link->Close();
    LeaveWork(live);
    Fail(live, error, &wakeups);
  }
}

void JobManager::CloseLinks() {
  const std::lock_guard lock(mutex_);
  for (const auto& [name, work] : works_) {
    if (work.link != nullptr) work.link->Close();
  }
}

void JobManager::StopWorkers() {
  const std::lock_guard lock(mutex_);
  stopped_ = true;
  work_or_stop_.notify_all();
}

}  // namespace planish
