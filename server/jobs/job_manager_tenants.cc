// The manager's side towards tenants: what each may have, and what all of them make of the server.
#include <algorithm>
#include <chrono>
#include <utility>

#include "absl/strings/str_cat.h"
#include "core/base/error.h"
#include "google/protobuf/util/time_util.h"
#include "server/jobs/job_manager.h"
#include "server/link/rpc_status.h"
#include "server/store/lifecycle.h"

namespace planish {
namespace {

using google::protobuf::util::TimeUtil;

// Advice to come back is neither a flood nor a farewell.
constexpr double kLeastRetrySeconds = 0.05;
constexpr double kMostRetrySeconds = 60;

}  // namespace

absl::Time SteadyNow() {
  return absl::UnixEpoch() + absl::FromChrono(std::chrono::steady_clock::now().time_since_epoch());
}

int JobManager::QueueCapacity(const Caller& caller) const {
  const std::lock_guard lock(mutex_);
  return queue_.Capacity(caller.tenant);
}

absl::Status JobManager::CheckRoom(const std::string& tenant, std::int64_t mesh_bytes) const {
  const Room room = queue_.RoomFor(tenant, mesh_bytes);
  if (room == Room::kYes) return absl::OkStatus();
  const int capacity = queue_.Capacity(tenant);
  const std::string message =
      room == Room::kTenantFull
          ? absl::StrCat("the queue is full (", capacity, " jobs of tenant ", tenant, " may wait)")
          : absl::StrCat("the queue of all tenants is full (", options_.queue_total, " jobs or ",
                         options_.max_queued_bytes, " bytes may wait), and tenant ", tenant, " has its part of it");
  const std::optional<double> seconds = queue_.SecondsUntilRoom(tenant, room, options_.steady_clock());
  return WithRetryDelay(MakeError(absl::StatusCode::kResourceExhausted, "QUEUE_FULL", message,
                                  {{"queue_capacity", absl::StrCat(capacity)}}),
                        seconds.has_value() ? absl::Seconds(std::clamp(*seconds, kLeastRetrySeconds, kMostRetrySeconds))
                                            : options_.retry_delay);
}

absl::StatusOr<StoredBlobPtr> JobManager::PutBlob(const std::string& tenant, std::string_view bytes,
                                                  const std::string& sha256) {
  for (;;) {
    absl::StatusOr<StoredBlobPtr> blob = blobs_->Put(tenant, bytes, sha256);
    if (blob.ok() || ErrorInfoOf(blob.status()).reason != "STORAGE_FULL") return blob;
    // What is new goes before what was fetched long ago.
    if (!MakeRoom(tenant, static_cast<std::int64_t>(bytes.size()))) return blob;
  }
}

bool JobManager::MakeRoom(const std::string& tenant, std::int64_t bytes) {
  const std::string gives_way = blobs_->WhoGivesWay(tenant, bytes);
  const std::lock_guard lock(mutex_);
  if (suspended_) return false;
  const std::int64_t before = blobs_->bytes();
  bool gave = false;
  for (const std::string& whose : {gives_way, tenant}) {
    const absl::StatusOr<std::optional<JobRecord>> oldest = store_->FirstEnded(whose, v1::JOB_STATE_SUCCEEDED);
    gave = oldest.ok() && oldest->has_value() && Expire(**oldest);
    if (gave) break;
  }
  CollectBlobs();
  return gave || blobs_->bytes() < before;
}

bool JobManager::IsDraining() const {
  const std::lock_guard lock(mutex_);
  return draining_;
}

ManagerStats JobManager::Stats() const {
  const std::lock_guard lock(mutex_);
  const absl::Time now = options_.clock();
  ManagerStats stats;
  stats.draining = draining_;
  stats.workers = options_.workers;
  stats.queued_work = queue_.size();
  stats.running_work = queue_.running();
  stats.queue_total = options_.queue_total;
  stats.alarms = static_cast<int>(alarms_.size());
  stats.reserved_memory_bytes = reserved_memory_;
  stats.memory_bytes = options_.memory_bytes;
  stats.stored_bytes = blobs_->bytes();
  stats.store_bytes = blobs_->max_bytes();
  stats.refused_by_reason = refused_by_reason_;
  std::map<std::string, TenantStats> tenants;
  for (const auto& [tenant, totals] : totals_.tenants) tenants[tenant].ended_kept = totals.ended;
  for (const auto& [tenant, calls] : calls_) {
    tenants[tenant].accepted = calls.accepted;
    tenants[tenant].refused = calls.refused;
    tenants[tenant].shared = calls.shared;
  }
  for (const auto& [name, live] : live_) {
    const v1::Job& job = live.record.job();
    TenantStats& tenant = tenants[job.tenant()];
    if (job.state() != v1::JOB_STATE_QUEUED) {
      ++stats.running;
      ++tenant.running;
      continue;
    }
    ++stats.queued;
    ++tenant.queued;
    const v1::Priority asked = job.scheduling().priority();
    WaitingJobs& waiting = tenant.waiting[asked == v1::PRIORITY_UNSPECIFIED ? v1::PRIORITY_NORMAL : asked];
    ++waiting.jobs;
    const absl::Time created = absl::FromUnixNanos(TimeUtil::TimestampToNanoseconds(job.create_time()));
    waiting.longest = std::max(waiting.longest, now - created);
    stats.oldest_wait = std::max(stats.oldest_wait, waiting.longest);
  }
  for (auto& [name, tenant] : tenants) {
    tenant.tenant = name;
    tenant.stored_bytes = blobs_->bytes(name);
    stats.tenants.push_back(std::move(tenant));
  }
  return stats;
}

}  // namespace planish
