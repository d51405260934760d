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

// Blobs that somebody else stopped using are found by a look at all of them.
constexpr absl::Duration kSweepInterval = absl::Minutes(10);

absl::Duration ToDuration(const google::protobuf::Duration& duration) {
  return absl::Nanoseconds(TimeUtil::DurationToNanoseconds(duration));
}

absl::Time ToTime(const google::protobuf::Timestamp& timestamp) {
  return absl::FromUnixNanos(TimeUtil::TimestampToNanoseconds(timestamp));
}

}  // namespace

// ---- one place for every change

void JobManager::Apply(JobAction action, Live& live, BlobPtr uv, Wakeups* wakeups) {
  const absl::Time now = options_.clock();
  v1::Job* job = live.record.mutable_job();
  if (!Advance(action, now, job).ok()) return;
  if (job->state() == v1::JOB_STATE_SUCCEEDED && options_.limits.retained_time < absl::InfiniteDuration()) {
    *job->mutable_expire_time() = ToTimestamp(now + options_.limits.retained_time);
  }
  if (!IsTerminal(job->state())) return Announce(live, wakeups);

  v1::JobEvent event = NextEvent(live);
  wakeups->logs.push_back(live.events);
  if (options_.on_transition) options_.on_transition(*job);
  live.events->AppendLast(event, std::move(uv));
  Finish(live, event, wakeups);
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

void JobManager::Save(const JobRecord& record, const v1::JobEvent* event) {
  const absl::Status status = store_->Put(record, event);
  if (!status.ok() && options_.on_store_error) options_.on_store_error(status);
}

void JobManager::Finish(Live& live, const v1::JobEvent& event, Wakeups* wakeups) {
  const JobRecord record = std::move(live.record);
  const std::string& name = record.job().name();
  ended_logs_.emplace_front(name, std::move(live.events));
  if (ended_logs_.size() > kEndedLogs) ended_logs_.pop_back();
  live_.erase(name);
  if (const absl::Status status = store_->Put(record, &event); !status.ok()) {
    if (options_.on_store_error) options_.on_store_error(status);
    unsaved_[name] = {record, event};
  }
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

// ---- early ends

absl::Status JobManager::TimedOut(const v1::Job& job) {
  return MakeError(absl::StatusCode::kDeadlineExceeded, "DEADLINE_EXCEEDED",
                   absl::StrCat("the job had not ended ", absl::FormatDuration(ToDuration(job.scheduling().timeout())),
                                " after it was accepted (Scheduling.timeout)"));
}

void JobManager::StartClocks(const Live& live) {
  const v1::Job& job = live.record.job();
  if (job.scheduling().has_timeout()) {
    alarms_.emplace(ToTime(job.create_time()) + ToDuration(job.scheduling().timeout()), job.name());
  }
}

void JobManager::CheckClocks(const std::string& name, absl::Time now, Wakeups* wakeups) {
  const auto found = live_.find(name);
  if (found == live_.end()) return;
  Live& live = found->second;
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
  if (live.record.cancel_requested() || live.timed_out) return;
  if (why == EarlyEnd::kCancel) {
    live.record.set_cancel_requested(true);
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
  if (job->stop_requested()) return;
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
  Wakeups wakeups;
  const std::lock_guard lock(mutex_);
  if (suspended_) return;
  const absl::Time now = options_.clock();
  while (!alarms_.empty() && alarms_.begin()->first <= now) {
    const std::string name = alarms_.begin()->second;
    alarms_.erase(alarms_.begin());
    CheckClocks(name, now, &wakeups);
  }
  std::erase_if(unsaved_,
                [this](const auto& entry) { return store_->Put(entry.second.record, &entry.second.event).ok(); });
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
  if (const absl::Status status = store_->Put(record, nullptr); !status.ok()) {
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
  unsaved_.erase(job.name());
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
  const absl::Time now = options_.clock();
  if (now >= next_sweep_) {
    next_sweep_ = now + kSweepInterval;
    unused_blobs_.clear();
    return blobs_->Collect([this](const BlobId& id) { return IsBlobUsed(id); });
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
  CollectBlobs();
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
    alarms_.emplace(live.orphaned + options_.limits.reattach_grace, name);
  }
  if (live.record.cancel_requested()) {
    if (job->state() != v1::JOB_STATE_STOPPING) Apply(JobAction::kCancel, live, nullptr, wakeups);
    if (live_.contains(name)) Apply(JobAction::kCancelled, live, nullptr, wakeups);
    return absl::OkStatus();
  }
  const absl::StatusOr<BlobPtr> mesh = blobs_->Find({job->tenant(), live.record.mesh_sha256()});
  const bool has_seams = live.record.seams_sha256().empty() || blobs_->Has({job->tenant(), live.record.seams_sha256()});
  if (!mesh.ok() || !has_seams) {
    Fail(live,
         MakeError(absl::StatusCode::kDataLoss, "MESH_LOST", "the server was restarted and no longer has the mesh"),
         wakeups);
    return absl::OkStatus();
  }
  const absl::StatusOr<JobNeeds> needs = NeedsOf((*mesh)->bytes(), job->mesh_bytes(), v1::MeshSize(), job->options());
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
