// Retention of ended jobs, and collection of blobs that nothing refers to.
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

// Protects a blob from collection until a record in the store refers to it. Not thread-safe; must not outlive the
// JobRetention.
class BlobHold {
 public:
  BlobHold() = default;
  BlobHold(JobRetention* retention, BlobId id) : retention_(retention), id_(std::move(id)) {}
  BlobHold(BlobHold&& other) noexcept { *this = std::move(other); }
  BlobHold& operator=(BlobHold&& other) noexcept;
  ~BlobHold() { Release(); }

  // From now on the blob may be collected if nothing refers to it.
  void Release();

 private:
  JobRetention* retention_ = nullptr;
  BlobId id_;
};

// Drops old results and records, and collects unused blobs. Thread-safe. No lock that calls of clients need is held
// while the store is asked.
class JobRetention {
 public:
  // `context` outlives the object.
  explicit JobRetention(JobContext* context) : context_(*context) {}

  // Removes unused blobs that an earlier process left.
  void Open();

  BlobHold Hold(const BlobId& id);
  // Puts a blob into the blob store. If the store is full, evicts old results: the tenant's own, or, if the tenant has
  // less than an equal part of the store, those of the tenant that has most. Call Hold() first.
  absl::StatusOr<StoredBlobPtr> Put(const std::string& tenant, std::string_view bytes, const std::string& sha256);
  // Pending: small blobs of the tenant that are to be committed with a record. Committed: call it when they were.
  std::vector<BlobRow> Pending(const std::string& tenant, const std::vector<std::string>& digests) const;
  void Committed(const std::vector<BlobRow>& blobs) const;

  // Call it when jobs have ended: their blobs may be unused, and the limit of records may be exceeded.
  void NoteEnds(const std::vector<JobChange>& changes);
  // Drops results and records that are too old, or beyond a tenant's limits.
  void Retain();
  // Deletes the record and its events.
  absl::Status Forget(const JobRecord& record);
  // Evicts old results so that the tenant may keep `bytes` more. False if there is nothing left to evict.
  bool MakeRoom(const std::string& tenant, std::int64_t bytes);
  // OK if `bytes` more can be stored without using the disk's headroom. Evicts old results for that, as MakeRoom()
  // does, if that would free enough. RESOURCE_EXHAUSTED with STORAGE_FULL; UNAVAILABLE with DATA_DIRECTORY_LOST.
  absl::Status CheckDisk(const std::string& tenant, std::int64_t bytes);
  // Whether there is room for the result of work that starts now. Evicts old results as CheckDisk() does.
  bool HasRoomForResults();
  // Collects blobs that may have become unused, and from time to time checks a few of all others.
  void CollectBlobs();
  // The limits have changed: results and records may be beyond them.
  void NoteLimits();

 private:
  friend class BlobHold;

  void Unhold(const BlobId& id);
  // Drops the job's UV. True if the record is now EXPIRED.
  bool Expire(const JobRecord& record);
  // Drops UV and records that are too old. Returns when the next ones will be too old.
  absl::StatusOr<absl::Time> DropOld(absl::Time now);
  void RetainOf(const std::string& tenant, const TenantTotals& totals);
  void NoteUnused(const JobRecord& record);
  bool IsUsed(const BlobId& id) const;
  // Removes the blob unless it is used or held. Returns false if that must be tried again later.
  bool Collect(const BlobId& id);

  JobContext& context_;

  // Lets one thread at a time drop results. It is held while the store is asked, so calls of clients never wait for it.
  std::mutex retaining_;

  std::mutex mutex_;
  std::condition_variable collected_;
  // Guarded by mutex_.
  std::map<BlobId, int> held_;
  std::set<BlobId> collecting_;
  std::set<BlobId> unused_;                        // blobs that may be unused: to be checked
  std::vector<BlobId> sweep_;                      // other blobs to be checked, a few at a time
  absl::Time next_sweep_ = absl::InfinitePast();   // next check of all blobs, by the steady clock
  absl::Time next_expiry_ = absl::InfinitePast();  // when the next result or record is too old, by the store's clock
};

}  // namespace planish
