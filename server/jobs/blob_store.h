// Meshes and results by their content.
#pragma once

#include <cstdint>
#include <functional>
#include <memory>
#include <mutex>
#include <string>
#include <string_view>
#include <unordered_map>

#include "absl/status/status.h"
#include "absl/status/statusor.h"
#include "server/link/blob.h"

namespace planish {

// Each blob is known by its SHA-256 (32 bytes, as in planish.v1); equal bytes are kept once. Blobs stay until they are
// removed, and none goes while somebody holds its BlobPtr. Thread-safe.
class BlobStore {
 public:
  // In files below `directory`, which exists and belongs to this store alone; they outlive the process. Empty: in
  // memory. At most `max_bytes` in all.
  BlobStore(std::string directory, std::int64_t max_bytes);

  // Finds the blobs that an earlier process left. Removes what it left half-written.
  absl::Status Open();

  // Keeps `bytes` and returns the kept blob; computes the digest unless the caller knows it (`sha256` not empty).
  // RESOURCE_EXHAUSTED with STORAGE_FULL when there is no room here or on the disk.
  absl::StatusOr<BlobPtr> Put(std::string_view bytes, std::string sha256 = {});

  // Takes over the complete file `path` (on the same file system as the directory; in memory: copies it), whose digest
  // the caller has checked, and removes it from where it is. Errors of Put(), after which it is where it was.
  absl::StatusOr<BlobPtr> PutFile(const std::string& path, const std::string& sha256);

  // NOT_FOUND if there is no such blob (any more).
  absl::StatusOr<BlobPtr> Find(const std::string& sha256);

  bool Has(const std::string& sha256) const;

  // Bytes of all blobs.
  std::int64_t bytes() const;
  std::int64_t max_bytes() const { return max_bytes_; }

  // Whether there is no such blob any more; false if somebody holds its BlobPtr.
  bool Remove(const std::string& sha256);

  // Removes every blob that `is_used` denies, unless it is held.
  void Collect(const std::function<bool(const std::string& sha256)>& is_used);

 private:
  struct Entry {
    std::int64_t bytes = 0;
    std::weak_ptr<const Blob> open;  // files: while somebody holds it
    BlobPtr kept;                    // memory only
  };

  std::string PathOf(const std::string& sha256) const;
  // All require mutex_.
  static bool IsHeld(const Entry& entry);
  // Takes the entry's bytes away, to be unmapped without the lock.
  BlobPtr Discard(const std::string& sha256, Entry* entry);
  absl::Status CheckRoom(std::int64_t bytes) const;
  absl::StatusOr<BlobPtr> FindLocked(const std::string& sha256);

  const std::string directory_;
  const std::int64_t max_bytes_;

  mutable std::mutex mutex_;
  // Guarded by mutex_.
  std::unordered_map<std::string, Entry> entries_;
  std::int64_t bytes_ = 0;
  std::int64_t next_temporary_ = 0;
};

}  // namespace planish
