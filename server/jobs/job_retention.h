// What is kept of jobs that ended, and which blobs anybody needs.
#pragma once

#include <condition_variable>
#include <cstdint>
#include <map>
#include <mutex>
#include <set>
#include <string>
#include <string_view>
#include <utility>
#include <vector>

#include "absl/status/status.h"
#include "absl/status/statusor.h"
#include "server/jobs/job_options.h"

namespace planish {

class JobRetention;

// Keeps a blob from being collected that the store is about to refer to. Not thread-safe; must not outlive the
// JobRetention.
class BlobHold {
 public:
  BlobHold() = default;
  BlobHold(JobRetention* retention, BlobId id) : retention_(retention), id_(std::move(id)) {}
  BlobHold(BlobHold&& other) noexcept { *this = std::move(other); }
  BlobHold& operator=(BlobHold&& other) noexcept;
  ~BlobHold() { Release(); }

  // From now on the blob goes unless somebody needs it.
  void Release();

 private:
  JobRetention* retention_ = nullptr;
  BlobId id_;
};

// Thread-safe. No lock is held while the store is asked.
class JobRetention {
 public:
  // `context` outlives the object.
  explicit JobRetention(JobContext* context) : context_(*context) {}

  // Removes blobs that nobody needs and an earlier process left.
  void Open();

  BlobHold Hold(const BlobId& id);
  // Puts a blob into the blob store, at the price of old results if need be: the tenant's own, or where it has little
  // those of the tenant that has most. Hold it before.
  absl::StatusOr<StoredBlobPtr> Put(const std::string& tenant, std::string_view bytes, const std::string& sha256);
  // Small blobs of the tenant that wait to be committed with a record; and that they were.
  std::vector<BlobRow> Pending(const std::string& tenant, const std::vector<std::string>& digests) const;
  void Committed(const std::vector<BlobRow>& blobs) const;

  // Jobs have ended: their blobs may be unused, and there may be more records than are kept.
  void NoteEnds(const std::vector<JobChange>& changes);
  // Drops what was kept long enough, and what is more than tenants may keep.
  void Retain();
  // The record and its events go.
  absl::Status Forget(const JobRecord& record);
  // Gives up old results so that the tenant may keep `bytes` more. False if there is nothing left to give up.
  bool MakeRoom(const std::string& tenant, std::int64_t bytes);
  // Looks at blobs that may have become unused, and every so often at a few of all others.
  void CollectBlobs();
  // Whatever is kept may be too much: the limits have changed.
  void NoteLimits();

 private:
  friend class BlobHold;

  void Unhold(const BlobId& id);
  // Whether the record says so now.
  bool Expire(const JobRecord& record);
  // Drops UV and records that are too old; returns when the next ones will be.
  absl::StatusOr<absl::Time> DropOld(absl::Time now);
  void RetainOf(const std::string& tenant, const TenantTotals& totals);
  void NoteUnused(const JobRecord& record);
  bool IsUsed(const BlobId& id) const;
  // Whether the blob need not be looked at again.
  bool Collect(const BlobId& id);

  JobContext& context_;

  std::mutex retaining_;  // one thread at a time; held while the store is asked, and by nobody who answers calls

  std::mutex mutex_;
  std::condition_variable collected_;
  // Guarded by mutex_.
  std::map<BlobId, int> held_;
  std::set<BlobId> collecting_;
  std::set<BlobId> unused_;                        // may be unused: to be looked at
  std::vector<BlobId> sweep_;                      // likewise, a few at a time
  absl::Time next_sweep_ = absl::InfinitePast();   // over all blobs, by the steady clock
  absl::Time next_expiry_ = absl::InfinitePast();  // no result or record is too old before, by the store's clock
};

}  // namespace planish
