// Meshes and results by their content.
#pragma once

#include <compare>
#include <cstdint>
#include <functional>
#include <map>
#include <memory>
#include <mutex>
#include <string>
#include <string_view>

#include "absl/status/status.h"
#include "absl/status/statusor.h"
#include "server/access/tenant.h"
#include "server/link/blob.h"

namespace planish {

// SHA-256 of a blob's bytes (32 bytes, as in planish.v1), and whose it is.
struct BlobId {
  std::string tenant;
  std::string sha256;

  auto operator<=>(const BlobId&) const = default;
};

// Equal bytes of one tenant are kept once; each tenant has its own, so that nobody can tell what others have from room,
// time or errors. Blobs stay until they are removed, and none goes while somebody holds its BlobPtr. Thread-safe.
class BlobStore {
 public:
  // In files below `directory`, which exists and belongs to this store alone; they outlive the process. Empty: in
  // memory. At most `max_bytes` in all, and of each tenant as many as its TenantLimits::store_bytes say (null: no
  // limits).
  BlobStore(std::string directory, std::int64_t max_bytes, TenantLimitsSource limits = nullptr);

  // Finds the blobs that an earlier process left. Removes what it left half-written.
  absl::Status Open();

  // Keeps `bytes` for the tenant and returns the kept blob; computes the digest unless the caller knows it (`sha256`
  // not empty). RESOURCE_EXHAUSTED with STORAGE_FULL when there is no room here, for this tenant or on the disk.
  absl::StatusOr<BlobPtr> Put(const std::string& tenant, std::string_view bytes, std::string sha256 = {});

  // Takes over the complete file `path` (on the same file system as the directory; in memory: copies it), whose digest
  // the caller has checked, and removes it from where it is. Errors of Put(), after which it is where it was.
  absl::StatusOr<BlobPtr> PutFile(const BlobId& id, const std::string& path);

  // NOT_FOUND if there is no such blob (any more).
  absl::StatusOr<BlobPtr> Find(const BlobId& id);

  bool Has(const BlobId& id) const;

  // Bytes of all blobs, and of a tenant's.
  std::int64_t bytes() const;
  std::int64_t bytes(const std::string& tenant) const;
  std::int64_t max_bytes() const { return max_bytes_; }

  // Whose bytes must go before `tenant` can have `more`: its own, unless the store is full and the tenant would stay
  // within an equal part of it for each tenant that has any; then of the tenant that has most.
  std::string WhoGivesWay(const std::string& tenant, std::int64_t more) const;

  // Whether there is no such blob any more; false if somebody holds its BlobPtr.
  bool Remove(const BlobId& id);

  // Removes every blob that `is_used` denies, unless it is held.
  void Collect(const std::function<bool(const BlobId& id)>& is_used);

 private:
  struct Entry {
    std::int64_t bytes = 0;
    std::weak_ptr<const Blob> open;  // files: while somebody holds it
    BlobPtr kept;                    // memory only
  };

  std::string PathOf(const BlobId& id) const;
  // All require mutex_.
  static bool IsHeld(const Entry& entry);
  // Takes the entry's bytes away, to be unmapped without the lock.
  BlobPtr Discard(const BlobId& id, Entry* entry);
  std::int64_t BytesOf(const std::string& tenant) const;
  // -1: none.
  std::int64_t LimitOf(const std::string& tenant) const;
  absl::Status CheckRoom(const std::string& tenant, std::int64_t bytes) const;
  absl::StatusOr<BlobPtr> FindLocked(const BlobId& id);
  void Count(const std::string& tenant, std::int64_t bytes);

  const std::string directory_;
  const std::int64_t max_bytes_;
  const TenantLimitsSource limits_;

  mutable std::mutex mutex_;
  // Guarded by mutex_.
  std::map<BlobId, Entry> entries_;
  std::int64_t bytes_ = 0;
  std::map<std::string, std::int64_t> tenant_bytes_;  // of tenants that have any
  std::int64_t next_temporary_ = 0;
};

}  // namespace planish
