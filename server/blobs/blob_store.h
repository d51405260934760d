// Meshes and results by their content: durable, verified, counted for each tenant.
#pragma once

#include <compare>
#include <cstdint>
#include <functional>
#include <map>
#include <memory>
#include <mutex>
#include <string>
#include <string_view>
#include <utility>
#include <vector>

#include "absl/status/status.h"
#include "absl/status/statusor.h"
#include "server/access/tenant.h"
#include "server/blobs/file_layer.h"
#include "server/blobs/stored_blob.h"
#include "server/link/blob.h"

namespace planish {

// SHA-256 of a blob's bytes (32 bytes, as in planish.v1), and whose it is.
struct BlobId {
  std::string tenant;
  std::string sha256;

  auto operator<=>(const BlobId&) const = default;
};

// A small blob on its way into the database that has the records: both are committed together, which saves the syncs of
// a file and its folder.
struct BlobRow {
  BlobId id;
  StoredBlobPtr bytes;  // in memory
};

// Small blobs in a database (JobStore). Whoever commits a record passes rows on to JobStore::Write().
class BlobRows {
 public:
  // Blobs up to this size become rows.
  static constexpr std::int64_t kMostBytes = std::int64_t{256} << 10;

  virtual ~BlobRows() = default;

  // All rows: whose, and how many bytes.
  virtual absl::StatusOr<std::vector<std::pair<BlobId, std::int64_t>>> List() = 0;
  // NOT_FOUND with BLOB_NOT_FOUND. Thread-safe.
  virtual absl::StatusOr<std::string> Read(const BlobId& id) = 0;
  // Only for a thread that may call JobStore.
  virtual absl::Status Remove(const BlobId& id) = 0;
};

// Where the bytes of a store are. Both outlive the store.
struct BlobPlaces {
  std::string directory;                   // exists and belongs to the store alone; empty: in memory
  BlobRows* rows = nullptr;                // null: files only
  FileLayer* files = FileLayer::System();  // not null
};

// Equal bytes of one tenant are kept once; each tenant has its own, so that nobody can tell what others have from room,
// time or errors. Blobs stay until they are removed, and none goes while somebody holds it. Thread-safe.
//
// A blob in a file is durable when Put() or PutFile() returns: the file and its folder are synced. A small one is
// pending until the caller has committed it with its record (Pending(), Committed()).
//
// The bytes of a blob that another process left are verified against their SHA-256 when this process first opens it.
// A blob that is damaged or missing is dropped: from then on the store does not have it, and takes it again.
//
// Errors: NOT_FOUND with BLOB_NOT_FOUND; DATA_LOSS with BLOB_DAMAGED to the caller that found the damage;
// RESOURCE_EXHAUSTED with STORAGE_FULL, or with OUT_OF_MEMORY (no descriptors, no memory), which pass; INTERNAL.
class BlobStore {
 public:
  // At most `max_bytes` in all, and of each tenant as many as its TenantLimits::store_bytes say (null: no limits).
  BlobStore(BlobPlaces places, std::int64_t max_bytes, TenantLimitsSource limits = nullptr);

  // Called, without a lock, with each blob that was found damaged. Before any other call.
  void SetOnDamage(std::function<void(const absl::Status&)> on_damage) { on_damage_ = std::move(on_damage); }

  // Finds the blobs that an earlier process left. Removes what it left half-written.
  absl::Status Open();

  // Keeps `bytes` for the tenant and returns the kept blob; computes the digest unless the caller knows it (`sha256`
  // not empty).
  absl::StatusOr<StoredBlobPtr> Put(const std::string& tenant, std::string_view bytes, std::string sha256 = {});

  // Takes over the complete file `path` (on the same file system as the directory; in memory: copies it), whose digest
  // the caller has checked, and removes it from where it is. After an error it is where it was.
  absl::Status PutFile(const BlobId& id, const std::string& path);

  // The blob, open for reading.
  absl::StatusOr<StoredBlobPtr> Find(const BlobId& id);

  // All its bytes in sealed memory, verified once more if they come from a file: for workers.
  absl::StatusOr<BlobPtr> Load(const BlobId& id);

  // Whether the store has the blob and would have it after a restart (in memory: has it).
  bool Has(const BlobId& id) const;

  // The blob if it waits to be committed with a record, otherwise null.
  StoredBlobPtr Pending(const BlobId& id) const;
  // The blob was committed.
  void Committed(const BlobId& id);

  // Whether blobs outlive the process, so that opening one may take long.
  bool has_files() const { return !places_.directory.empty(); }

  // Bytes of all blobs, and of a tenant's.
  std::int64_t bytes() const;
  std::int64_t bytes(const std::string& tenant) const;
  std::int64_t max_bytes() const { return max_bytes_; }

  // Whose bytes must go before `tenant` can have `more`: its own, unless the store is full and the tenant would stay
  // within an equal part of it for each tenant that has any; then of the tenant that has most.
  std::string WhoGivesWay(const std::string& tenant, std::int64_t more) const;

  // All blobs of this moment.
  std::vector<BlobId> Ids() const;

  // Whether there is no such blob any more; false if somebody holds it. Calls BlobRows::Remove().
  bool Remove(const BlobId& id);

  // Removes every blob that `is_used` denies, unless it is held. Calls BlobRows::Remove().
  void Collect(const std::function<bool(const BlobId& id)>& is_used);

 private:
  enum class Place { kMemory, kPending, kRow, kFile };

  struct Entry {
    std::int64_t number = 0;  // tells it from another entry of the same id, before or after it
    std::int64_t bytes = 0;
    Place place = Place::kMemory;
    StoredBlobPtr kept;                    // kMemory, kPending
    std::weak_ptr<const StoredBlob> open;  // kRow, kFile: while somebody holds it
    int opening = 0;                       // callers that are about to hold it
    bool verified = false;                 // its bytes were those of its digest, in this process
    bool durable = true;                   // kFile: its folder was synced
  };

  std::string FolderOf(const BlobId& id) const;
  std::string PathOf(const BlobId& id) const;
  // Without mutex_. Reads what `entry`, a copy, stands for, and verifies it unless that was done.
  absl::StatusOr<StoredBlobPtr> OpenEntry(const BlobId& id, const Entry& entry);
  absl::Status Verify(const BlobId& id, int fd, std::int64_t size);
  // Drops the entry if its bytes are not what they should be; returns `status`.
  absl::Status Refuse(const BlobId& id, std::int64_t number, absl::Status status);
  // The file `path`, which was synced, becomes the blob.
  absl::Status Install(const BlobId& id, const std::string& path, std::int64_t size);
  absl::Status WriteFile(const std::string& path, std::string_view bytes);

  // All require mutex_.
  static bool IsHeld(const Entry& entry);
  void Discard(const BlobId& id, const Entry& entry);
  std::int64_t BytesOf(const std::string& tenant) const;
  // -1: none.
  std::int64_t LimitOf(const std::string& tenant) const;
  absl::Status CheckRoom(const std::string& tenant, std::int64_t bytes) const;
  Entry& Add(const BlobId& id, std::int64_t bytes, Place place);
  void Count(const std::string& tenant, std::int64_t bytes);

  const BlobPlaces places_;
  const std::int64_t max_bytes_;
  const TenantLimitsSource limits_;
  std::function<void(const absl::Status&)> on_damage_;

  mutable std::mutex mutex_;
  // Guarded by mutex_.
  std::map<BlobId, Entry> entries_;
  std::int64_t bytes_ = 0;
  std::map<std::string, std::int64_t> tenant_bytes_;  // of tenants that have any
  std::int64_t next_temporary_ = 0;
  std::int64_t next_number_ = 1;
};

}  // namespace planish
