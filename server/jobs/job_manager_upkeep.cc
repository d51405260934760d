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

// Pieces of work that a transaction takes over from the server before.
constexpr int kReapSlice = 100;

absl::Duration ToDuration(const google::protobuf::Duration& duration) {
  return absl::Nanoseconds(TimeUtil::DurationToNanoseconds(duration));
}

absl::Time ToTime(const google::protobuf::Timestamp& timestamp) {
  return absl::FromUnixNanos(TimeUtil::TimestampToNanoseconds(timestamp));
}

}  // namespace

// ---- one place for every change

VerbContext JobManager::Context() const {
  VerbContext context;
  context.now = options_.clock();
  context.retained_time = options_.limits.retained_time;
  context.max_attempts = options_.max_attempts;
  context.told = [this](const std::string& name) {
    const auto live = live_.find(name);
    return live == live_.end() ? 0 : live->second.events->last_sequence();
  };
  return context;
}

void JobManager::Adopt(Live& live, JobChange change, StoredBlobPtr uv, Wakeups* wakeups) {
  live.record = std::move(change.record);
  wakeups->logs.push_back(live.events);
  for (v1::JobEvent& event : change.events) {
    if (options_.on_transition) options_.on_transition(event.job());
    if (IsTerminal(event.job().state())) return Conclude(live, std::move(event), std::move(uv), wakeups);
    if (&event == &change.events.back()) *event.mutable_job() = Snapshot(live.record);
    live.events->Append(std::move(event));
  }
}

void JobManager::Conclude(Live& live, v1::JobEvent event, StoredBlobPtr uv, Wakeups* wakeups) {
  const JobRecord record = std::move(live.record);
  const std::string& name = record.job().name();
  live.events->AppendLast(std::move(event), std::move(uv));
  ended_logs_.emplace_front(name, std::move(live.events));
  if (ended_logs_.size() > kEndedLogs) ended_logs_.pop_back();
  for (const absl::Time alarm : live.alarms) alarms_.erase({alarm, name});
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

std::vector<BlobRow> JobManager::Pending(const std::string& tenant, const std::vector<std::string>& digests) const {
  std::vector<BlobRow> rows;
  for (const std::string& sha256 : digests) {
    const BlobId id = {tenant, sha256};
    if (StoredBlobPtr pending = sha256.empty() ? nullptr : blobs_->Pending(id))
      rows.push_back({id, std::move(pending)});
  }
  return rows;
}

void JobManager::Committed(const std::vector<BlobRow>& blobs) {
  for (const BlobRow& blob : blobs) blobs_->Committed(blob.id);
}

void JobManager::FinishWhatIsLeft(Wakeups* wakeups) {
  while (!unended_.empty()) {
    Ending ending = std::move(unended_.begin()->second);
    unended_.erase(unended_.begin());
    if (!Finish(std::move(ending), wakeups)) return;  // the others fare no better
  }
}

// ---- early ends

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
  const v1::Job& job = live.record.job();
  const v1::Scheduling& limits = job.scheduling();
  const bool left_alone = live.attachments == 0 && live.record.attached();
  const bool runs = job.state() == v1::JOB_STATE_RUNNING;
  absl::Status status;
  if (left_alone && now - live.orphaned >= options_.limits.reattach_grace) {
    status = EndEarly(live, EarlyEnd::kCancel, /*forget=*/true, wakeups);
  } else if (limits.has_timeout() && now - ToTime(job.create_time()) >= ToDuration(limits.timeout())) {
    status = EndEarly(live, EarlyEnd::kTimeout, /*forget=*/false, wakeups);
  } else if (runs && limits.has_compute_budget() &&
             now - ToTime(job.start_time()) >= ToDuration(limits.compute_budget())) {
    status = RequestStop(live, wakeups);
  }
  if (!status.ok()) SetAlarm(live, now + options_.retry_delay);  // nothing changed: once more
}

absl::Status JobManager::EndEarly(Live& live, EarlyEnd why, bool forget, Wakeups* wakeups) {
  PLANISH_RETURN_IF_ERROR(CheckOpen(live));
  const std::string name = live.record.job().name();
  if (live.record.job().cancel_requested() || live.record.timed_out()) return absl::OkStatus();
  absl::StatusOr<JobChange> change = store_->EndEarly(Context(), name, why, forget);
  if (!change.ok()) return NotWritten(change.status());
  Work& work = works_.at(live.work());
  if (IsTerminal(change->record.job().state())) {
    LeaveWork(live);
  } else {
    // The worker has to answer first.
    work.obey_by = options_.clock() + options_.obey_limit;
    work.SendCancel();
  }
  Adopt(live, *std::move(change), nullptr, wakeups);
  return absl::OkStatus();
}

absl::Status JobManager::RequestStop(Live& live, Wakeups* wakeups) {
  PLANISH_RETURN_IF_ERROR(CheckOpen(live));
  if (live.record.job().stop_requested()) return absl::OkStatus();
  absl::StatusOr<JobChange> change = store_->RequestStop(Context(), live.record.job().name());
  if (!change.ok()) return NotWritten(change.status());
  Adopt(live, *std::move(change), nullptr, wakeups);
  SendStopIfAllWant(works_.at(live.work()));
  return absl::OkStatus();
}

absl::Status JobManager::Fail(Live& live, const absl::Status& error, bool forget, Wakeups* wakeups) {
  absl::StatusOr<JobChange> change = store_->Fail(Context(), live.record.job().name(), ToRpcStatus(error), forget);
  if (!change.ok()) return NotWritten(change.status());
  if (works_.contains(live.work())) LeaveWork(live);
  Adopt(live, *std::move(change), nullptr, wakeups);
  return absl::OkStatus();
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
  FinishWhatIsLeft(&wakeups);
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

bool JobManager::Expire(const JobRecord& record) {
  const absl::StatusOr<JobChange> change = store_->Expire(Context(), record.job().name());
  if (!change.ok() && options_.on_store_error) options_.on_store_error(change.status());
  if (!change.ok() || change->record.job().state() != v1::JOB_STATE_EXPIRED) return false;
  const v1::Job& job = change->record.job();
  if (options_.on_transition) options_.on_transition(job);
  totals_.tenants[job.tenant()].result_bytes -= job.uv().total_bytes();
  ended_logs_.remove_if([&](const auto& ended) { return ended.first == job.name(); });
  ReleaseBlobs(record);
  return true;
}

absl::Status JobManager::Forget(const JobRecord& record) {
  PLANISH_RETURN_IF_ERROR(store_->Delete(record.job().name()));
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
  // A server that ended in order has released what it ran. Whoever dies without that may have died of the job.
  for (;;) {
    PLANISH_ASSIGN_OR_RETURN(const std::vector<JobChange> lost, store_->Reap(Context(), instance_, kReapSlice));
    if (lost.empty()) break;
    for (const JobChange& change : lost) {
      const v1::Job& job = change.record.job();
      if (IsTerminal(job.state())) last_ended_[job.tenant()] = job.name();
      if (!options_.on_transition) continue;
      for (const v1::JobEvent& event : change.events) options_.on_transition(event.job());
    }
  }
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
  const v1::Job& job = live.record.job();
  if (live.record.attached()) {
    live.orphaned = options_.clock();
    SetAlarm(live, live.orphaned + options_.limits.reattach_grace);
  }
  const absl::StatusOr<std::vector<BlobPtr>> blobs =
      LoadBlobs(job.tenant(), {live.record.mesh_sha256(), live.record.seams_sha256()});
  if (absl::IsNotFound(blobs.status()) || absl::IsDataLoss(blobs.status())) {
    // Its request id is free: a caller that has the mesh sends it again, for a new job.
    return Fail(live, MeshLost(blobs.status()), /*forget=*/true, wakeups);
  }
  PLANISH_RETURN_IF_ERROR(blobs.status());
  std::optional<std::int64_t> array_vertices;
  if (live.record.has_array_vertices()) array_vertices = live.record.array_vertices();
  const absl::StatusOr<JobNeeds> needs =
      NeedsOf(blobs->front()->bytes(), array_vertices, job.mesh_bytes(), v1::MeshSize(), job.options());
  if (!needs.ok()) return Fail(live, needs.status(), /*forget=*/false, wakeups);  // the limits are lower than they were
  JoinWork(live, *needs);
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
  for (const std::string& name : names) {
    EndEarly(live_.at(name), EarlyEnd::kCancel, /*forget=*/false, &wakeups).IgnoreError();  // was told of
  }
}

void JobManager::Suspend() {
  Wakeups wakeups;
  const std::lock_guard lock(mutex_);
  draining_ = ending_ = suspended_ = stopped_ = true;
  work_or_stop_.notify_all();
  const absl::Status status = WithRetryDelay(MakeError(absl::StatusCode::kUnavailable, "DRAINING",
                                                       "the server is shutting down; the job goes on when it is back"),
                                             options_.retry_delay);
  // An end that cannot be written is lost, and the job runs again.
  FinishWhatIsLeft(&wakeups);
  unended_.clear();
  const absl::Status released = store_->Release(Context(), instance_).status();
  if (!released.ok() && options_.on_store_error) options_.on_store_error(released);
  for (auto& [name, live] : live_) {
    live.events->Interrupt(status);
    wakeups.logs.push_back(live.events);
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
    if (const auto work = works_.find(live.work()); work != works_.end() && work->second.link != nullptr) {
      work->second.link->Close();
    }
    Fail(live, error, /*forget=*/false, &wakeups).IgnoreError();  // was told of
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
