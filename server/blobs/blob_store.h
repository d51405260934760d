// Stores the bytes of meshes and results by content. The implementations are directories (directory_blobs.h),
// PostgreSQL (server/store/sql_blobs.h) and S3 (s3_blobs.h).
//
// Ages. Any number of processes may use one store. The age of a blob counts from its last Put() or Renew(), by the
// clock of the store. Before a process refers to a blob in a database, it calls Put() or Renew(), and writes the
// reference within kReferenceTime. A process that deletes first finds that nothing refers to the blob, and then calls
// Remove() with a minimal age of at least kReferenceTime. So a blob that is about to be referred to is too young to be
// removed. See CollectBlobs().
#pragma once

#include <compare>
#include <cstdint>
#include <functional>
#include <mutex>
#include <string>
#include <string_view>
#include <unordered_map>

#include "absl/status/status.h"
#include "absl/status/statusor.h"
#include "absl/time/time.h"
#include "server/blobs/stored_blob.h"
#include "server/link/blob.h"

namespace planish {

// SHA-256 of a blob's bytes (32 bytes, as in planish.v1), and its tenant.
struct BlobId {
  std::string tenant;  // 1 to 80 of a-z, 0-9, '_', '-' and '.'
  std::string sha256;

  auto operator<=>(const BlobId&) const = default;
};

struct BlobEntry {
  BlobId id;
  std::int64_t bytes = 0;
  absl::Duration age;
};

// Equal bytes of one tenant are stored once. Tenants do not share blobs.
//
// Verification. When this process first opens a blob that another process put, it compares the bytes with their
// SHA-256. A damaged blob is dropped and counts as absent, so it can be put again.
//
// Thread-safe. Errors of all functions:
//   NOT_FOUND with BLOB_NOT_FOUND
//   DATA_LOSS with BLOB_DAMAGED              to the caller that found the damage; later ones get NOT_FOUND
//   RESOURCE_EXHAUSTED with STORAGE_FULL     a disk or a quota is full
//   RESOURCE_EXHAUSTED with OUT_OF_MEMORY    no descriptors or no memory at the moment
//   UNAVAILABLE with STORE_UNAVAILABLE       the store cannot be reached, or does not answer in time
//   INTERNAL                                 a bug, or a store that is set up wrong: the message says which
class BlobStore {
 public:
  // Maximal time from Put() or Renew() to the reference in a database.
  static constexpr absl::Duration kReferenceTime = absl::Hours(1);

  virtual ~BlobStore() = default;

  // Stores `bytes`, whose digest is that of `id`. They are durable when the function returns.
  absl::Status Put(const BlobId& id, std::string_view bytes);

  // Like Put() with the bytes of the file `path`, which is removed. After an error the file is unchanged.
  absl::Status PutFile(const BlobId& id, const std::string& path);

  // The blob, open for range reads. A blob that is removed meanwhile may still be read, or give NOT_FOUND or DATA_LOSS.
  absl::StatusOr<StoredBlobPtr> Open(const BlobId& id);

  // All bytes of the blob in sealed memory, verified each time they are read.
  absl::StatusOr<BlobPtr> Load(const BlobId& id);

  // Whether the store has the blob. If so, the blob is durable, and its age becomes zero (or up to kReferenceTime / 4,
  // if that saves the store work).
  virtual absl::StatusOr<bool> Renew(const BlobId& id) = 0;

  virtual absl::StatusOr<bool> Has(const BlobId& id) = 0;

  // Calls `visit` for each blob, in no order. Blobs added or removed meanwhile may be missed.
  virtual absl::Status List(const std::function<void(const BlobEntry&)>& visit) = 0;

  // Removes the blob if its age is at least `min_age`. Returns whether the store has no such blob any more.
  virtual absl::StatusOr<bool> Remove(const BlobId& id, absl::Duration min_age) = 0;

  // Whether other processes may use the store.
  virtual bool is_shared() const = 0;

 protected:
  struct Found {
    StoredBlobPtr blob;
    // Distinguishes these bytes from others that may replace them.
    std::string version;
  };

  // Opens the blob without verifying its bytes. NOT_FOUND if there is no such blob.
  virtual absl::StatusOr<Found> OpenUnverified(const BlobId& id) = 0;
  // Stores the bytes durably. Returns their version; empty if another process put the blob meanwhile, which is kept.
  virtual absl::StatusOr<std::string> PutNew(const BlobId& id, std::string_view bytes) = 0;
  // Like PutNew() with the bytes of the file `path`. This default implementation reads the file, calls PutNew() and
  // removes the file.
  virtual absl::StatusOr<std::string> PutNewFile(const BlobId& id, const std::string& path);
  // Removes the damaged bytes of this version, and no others.
  virtual absl::Status Drop(const BlobId& id, const std::string& version) = 0;

 private:
  // Renews the blob and opens it. Returns whether the store has it undamaged.
  absl::StatusOr<bool> IsThere(const BlobId& id);
  // Reads all bytes. Copies them to `copy` unless null. Drops a blob that is found damaged twice.
  absl::Status Verify(const BlobId& id, const Found& found, char* copy);
  bool IsVerified(const BlobId& id, const std::string& version);
  void SetVerified(const BlobId& id, const std::string& version);

  std::mutex mutex_;
  // Versions whose bytes this process wrote or verified, by tenant and digest. Guarded by mutex_.
  std::unordered_map<std::string, std::string> verified_;
};

// Removes every blob that is older than `min_age` and for which `is_used` is false. If processes share the store,
// `min_age` must be at least kReferenceTime, and `is_used` must ask the database, never the memory of one process.
// Returns the number of removed blobs. A blob that cannot be removed is left for the next time; the last such error is
// returned after the others are done.
absl::StatusOr<std::int64_t> CollectBlobs(BlobStore* store, absl::Duration min_age,
                                          const std::function<absl::StatusOr<bool>(const BlobId& id)>& is_used);

// The errors NOT_FOUND with BLOB_NOT_FOUND, and DATA_LOSS with BLOB_DAMAGED.
absl::Status BlobNotFound(const BlobId& id);
absl::Status BlobDamaged(const BlobId& id, const std::string& how);

// Whether a status means that the blob is gone for good. Other errors may be temporary.
bool IsLost(const absl::Status& status);

}  // namespace planish
