#include "server/jobs/job_retention.h"

#include <algorithm>
#include <optional>

#include "absl/strings/str_cat.h"
#include "core/base/error.h"
#include "core/base/status_macros.h"
#include "google/protobuf/util/time_util.h"
#include "server/store/lifecycle.h"

namespace planish {
namespace {

// Interval between scans of all blobs, which find those that another process stopped using.
constexpr absl::Duration kSweepInterval = absl::Minutes(10);
// Blobs checked at a time: each check queries the store.
constexpr std::size_t kSweepSlice = 64;
// More than the free pages that SQLite keeps when rows are deleted.
constexpr std::int64_t kMostFreeBytes = std::int64_t{8} << 20;
// Jobs that one transaction deletes.
constexpr int kForgottenAtOnce = 100;

}  // namespace

BlobHold& BlobHold::operator=(BlobHold&& other) noexcept {
  Release();
  retention_ = std::exchange(other.retention_, nullptr);
  id_ = std::move(other.id_);
  return *this;
}

void BlobHold::Release() {
  if (JobRetention* retention = std::exchange(retention_, nullptr); retention != nullptr) retention->Unhold(id_);
}

// ---- blobs

void JobRetention::Open() {
  {
    const std::lock_guard lock(mutex_);
    next_sweep_ = context_.options.steady_clock() + kSweepInterval;
  }
  context_.blobs.Collect([this](const BlobId& id) { return IsUsed(id); });
}

BlobHold JobRetention::Hold(const BlobId& id) {
  std::unique_lock lock(mutex_);
  collected_.wait(lock, [&] { return !collecting_.contains(id); });
  ++held_[id];
  return BlobHold(this, id);
}

void JobRetention::Unhold(const BlobId& id) {
  const std::lock_guard lock(mutex_);
  if (--held_[id] == 0) held_.erase(id);
  unused_.insert(id);
}

absl::StatusOr<StoredBlobPtr> JobRetention::Put(const std::string& tenant, std::string_view bytes,
                                                const std::string& sha256) {
  for (;;) {
    absl::StatusOr<StoredBlobPtr> blob = context_.blobs.Put(tenant, bytes, sha256);
    if (blob.ok() || ErrorInfoOf(blob.status()).reason != "STORAGE_FULL") return blob;
    // A new blob has precedence over old results.
    if (!MakeRoom(tenant, static_cast<std::int64_t>(bytes.size()))) return blob;
  }
}

std::vector<BlobRow> JobRetention::Pending(const std::string& tenant, const std::vector<std::string>& digests) const {
  std::vector<BlobRow> rows;
  for (const std::string& sha256 : digests) {
    const BlobId id = {tenant, sha256};
    if (StoredBlobPtr pending = sha256.empty() ? nullptr : context_.blobs.Pending(id)) {
      rows.push_back({id, std::move(pending)});
    }
  }
  return rows;
}

void JobRetention::Committed(const std::vector<BlobRow>& blobs) const {
  for (const BlobRow& blob : blobs) context_.blobs.Committed(blob.id);
}

bool JobRetention::IsUsed(const BlobId& id) const {
  const auto& is_used = context_.options.is_blob_used;
  if (is_used != nullptr && is_used(id)) return true;
  const absl::StatusOr<bool> used = context_.store.UsesBlob(id);
  return !used.ok() || *used;
}

bool JobRetention::Collect(const BlobId& id) {
  {
    const std::lock_guard lock(mutex_);
    if (held_.contains(id)) return true;  // its BlobHold adds it to unused_ when released
    collecting_.insert(id);
  }
  const bool done = IsUsed(id) || context_.blobs.Remove(id);
  {
    const std::lock_guard lock(mutex_);
    collecting_.erase(id);
  }
  collected_.notify_all();
  return done;
}

void JobRetention::CollectBlobs() {
  const absl::Time now = context_.options.steady_clock();
  bool sweeps = false;
  {
    const std::lock_guard lock(mutex_);
    sweeps = now >= next_sweep_;
    const double sweeps_per_second = 1 / absl::ToDoubleSeconds(kSweepInterval);
    if (sweeps) next_sweep_ = now + std::max(kSweepInterval, context_.Pace(sweeps_per_second, kSweepInterval));
  }
  std::vector<BlobId> all;
  if (sweeps && context_.store.is_shared()) {
    if (const absl::Status status = context_.blobs.Refresh(); !status.ok()) context_.TellError(status);
  }
  if (sweeps) all = context_.blobs.Ids();
  std::set<BlobId> unused;
  {
    const std::lock_guard lock(mutex_);
    if (sweeps) sweep_ = std::move(all);
    for (std::size_t i = 0; i < kSweepSlice && !sweep_.empty(); ++i) {
      unused_.insert(std::move(sweep_.back()));
      sweep_.pop_back();
    }
    unused.swap(unused_);
  }
  std::erase_if(unused, [this](const BlobId& id) { return Collect(id); });
  const std::lock_guard lock(mutex_);
  unused_.merge(unused);
}

void JobRetention::NoteUnused(const JobRecord& record) {
  const std::lock_guard lock(mutex_);
  for (const std::string& sha256 : {record.mesh_sha256(), record.elements_sha256(), record.job().uv().uv_sha256()}) {
    if (!sha256.empty()) unused_.insert({record.job().tenant(), sha256});
  }
}

// ---- records

void JobRetention::NoteEnds(const std::vector<JobChange>& changes) {
  bool any = false;
  for (const JobChange& change : changes) {
    if (!IsTerminal(change.record.job().state())) continue;
    NoteUnused(change.record);
    any = true;
  }
  // If servers share the store, JobManager::Tidy() does this for all of them.
  if (any && !context_.store.is_shared()) Retain();
}

void JobRetention::NoteLimits() {
  const std::lock_guard lock(mutex_);
  next_expiry_ = absl::InfinitePast();
}

void JobRetention::Retain() {
  // If another thread is dropping results now, that thread or the next Tick() also does what this call was to do.
  const std::unique_lock turn(retaining_, std::try_to_lock);
  if (!turn.owns_lock()) return;
  const absl::StatusOr<absl::Time> now = context_.store.Now();
  if (!now.ok()) return context_.TellError(now.status());
  absl::Time next_expiry;
  {
    const std::lock_guard lock(mutex_);
    next_expiry = next_expiry_;
  }
  if (*now >= next_expiry) {
    const absl::StatusOr<absl::Time> next = DropOld(*now);
    if (!next.ok()) return context_.TellError(next.status());
    const std::lock_guard lock(mutex_);
    next_expiry_ = *next;
  }
  const absl::StatusOr<JobTotals> totals = context_.store.Totals();
  if (!totals.ok()) return context_.TellError(totals.status());
  for (const auto& [tenant, each] : totals->tenants) RetainOf(tenant, each);
}

absl::StatusOr<absl::Time> JobRetention::DropOld(absl::Time now) {
  const JobLimits limits = context_.Limits();
  // No job that ends from now on is too old before this time.
  absl::Time next = now + std::min(limits.retained_time, limits.retained_record_time);
  // Whether `record`, the oldest of its kind, is too old. If not, `next` becomes at most the time at which it will be.
  const auto is_old = [&](const std::optional<JobRecord>& record, absl::Duration retained_time) {
    if (!record.has_value()) return false;
    const absl::Time end =
        absl::FromUnixNanos(google::protobuf::util::TimeUtil::TimestampToNanoseconds(record->job().end_time()));
    if (now >= end + retained_time) return true;
    next = std::min(next, end + retained_time);
    return false;
  };
  for (;;) {
    PLANISH_ASSIGN_OR_RETURN(const std::optional<JobRecord> oldest,
                             context_.store.FirstEnded("", v1::JOB_STATE_SUCCEEDED));
    if (!is_old(oldest, limits.retained_time)) break;
    if (!Expire(*oldest)) return now;
  }
  for (;;) {
    PLANISH_ASSIGN_OR_RETURN(const std::optional<JobRecord> oldest,
                             context_.store.FirstEnded("", v1::JOB_STATE_UNSPECIFIED));
    if (!is_old(oldest, limits.retained_record_time)) break;
    const absl::Status status = Forget(*oldest);
    if (!status.ok() && !absl::IsNotFound(status)) return status;
  }
  return next;
}

void JobRetention::RetainOf(const std::string& tenant, const TenantTotals& totals) {
  const JobLimits limits = context_.Limits();
  std::int64_t bytes = totals.result_bytes, record_bytes = totals.record_bytes, ended = totals.ended;
  while (bytes > limits.retained_bytes) {
    const absl::StatusOr<std::optional<JobRecord>> oldest = context_.store.FirstEnded(tenant, v1::JOB_STATE_SUCCEEDED);
    const absl::StatusOr<std::optional<JobRecord>> last = context_.store.LastEnded(tenant);
    if (!oldest.ok() || !last.ok() || !oldest->has_value() || !last->has_value()) break;
    if ((*oldest)->job().name() == (*last)->job().name() || !Expire(**oldest)) break;
    bytes -= (*oldest)->job().uv().total_bytes();
  }
  while (record_bytes > limits.retained_record_bytes && ended > 1) {
    // If all records had the same size, `share` of them would exceed the limit. Drops half as many and looks again, so
    // that hardly more are dropped than necessary.
    const double share = 1 - static_cast<double>(limits.retained_record_bytes) / static_cast<double>(record_bytes);
    const double surplus = std::clamp(share * static_cast<double>(ended) / 2, 1.0, double{kForgottenAtOnce});
    const absl::StatusOr<std::vector<JobRecord>> gone = context_.store.DeleteOldest(tenant, static_cast<int>(surplus));
    if (!gone.ok() || gone->empty()) break;  // empty: another process is deleting them
    for (const JobRecord& record : *gone) {
      NoteUnused(record);
      record_bytes -= record.kept_bytes();
      --ended;
    }
  }
}

bool JobRetention::Expire(const JobRecord& record) {
  const absl::StatusOr<JobChange> change = context_.store.Expire(context_.Verb(), record.job().name());
  if (!change.ok() && !absl::IsNotFound(change.status())) context_.TellError(change.status());
  if (!change.ok() || change->record.job().state() != v1::JOB_STATE_EXPIRED) return absl::IsNotFound(change.status());
  if (context_.options.on_transition) context_.options.on_transition(change->record.job());
  NoteUnused(record);
  return true;
}

absl::Status JobRetention::Forget(const JobRecord& record) {
  PLANISH_RETURN_IF_ERROR(context_.store.Delete(record.job().name()));
  NoteUnused(record);
  return absl::OkStatus();
}

absl::Status JobRetention::CheckDisk(const std::string& tenant, std::int64_t bytes) {
  if (context_.options.disk_shortage == nullptr) return absl::OkStatus();
  std::int64_t may_go = -1;
  for (;;) {
    PLANISH_ASSIGN_OR_RETURN(const std::int64_t shortage, context_.options.disk_shortage(bytes));
    if (shortage <= 0) return absl::OkStatus();
    // Other programs that fill the disk must not make us drop all results: drop only as many bytes as are missing, plus
    // the pages that SQLite does not give back at once.
    const std::int64_t kept = context_.blobs.bytes();
    if (may_go < 0) may_go = shortage <= kept ? 2 * shortage + kMostFreeBytes : 0;
    if (may_go > 0 && MakeRoom(tenant, bytes)) {
      may_go -= std::max<std::int64_t>(kept - context_.blobs.bytes(), 1);
      continue;
    }
    return MakeError(absl::StatusCode::kResourceExhausted, "STORAGE_FULL",
                     absl::StrCat("the server's disk is nearly full: ", shortage,
                                  " bytes more must be free so that results of accepted jobs have room"),
                     {{"bytes", absl::StrCat(shortage)}});
  }
}

bool JobRetention::HasRoomForResults() {
  const auto& has_room = context_.options.has_room_for_results;
  if (has_room == nullptr || has_room()) return true;
  CheckDisk("", 0).IgnoreError();
  return has_room();
}

bool JobRetention::MakeRoom(const std::string& tenant, std::int64_t bytes) {
  const std::string gives_way = context_.blobs.WhoGivesWay(tenant, bytes);
  const std::int64_t before = context_.blobs.bytes();
  bool gave = false;
  for (const std::string& whose : {gives_way, tenant}) {
    const absl::StatusOr<std::optional<JobRecord>> oldest = context_.store.FirstEnded(whose, v1::JOB_STATE_SUCCEEDED);
    gave = oldest.ok() && oldest->has_value() && Expire(**oldest);
    if (gave) break;
  }
  CollectBlobs();
  return gave || context_.blobs.bytes() < before;
}

}  // namespace planish
