// An open blob of a store.
#pragma once

#include <cstdint>
#include <memory>
#include <string>
#include <utility>

#include "absl/status/status.h"
#include "absl/status/statusor.h"
#include "server/blobs/file_layer.h"
#include "server/link/blob.h"

namespace planish {

class StoredBlob;
using StoredBlobPtr = std::shared_ptr<const StoredBlob>;

// Bytes that are read piece by piece from where they are stored. Files are never mapped: if a file is truncated, a read
// returns an error, but an access to its mapping kills the process. Thread-safe.
class StoredBlob {
 public:
  static StoredBlobPtr InMemory(BlobPtr bytes);
  // An open file as a blob. `files` outlives the blob; `size` is that of the file.
  static StoredBlobPtr InFile(FileLayer* files, Descriptor file, std::int64_t size);

  virtual ~StoredBlob() = default;
  StoredBlob(const StoredBlob&) = delete;
  StoredBlob& operator=(const StoredBlob&) = delete;

  std::int64_t size() const { return size_; }

  // Replaces *bytes by `length` bytes from `offset` on, all of which must exist. DATA_LOSS with BLOB_DAMAGED if there
  // are fewer or they cannot be read; otherwise errors of BlobStore (blob_store.h).
  absl::Status Read(std::int64_t offset, std::int64_t length, std::string* bytes) const;

  // Reads all bytes. Errors of Read().
  absl::StatusOr<std::string> ReadAll() const;

  // The bytes if they are in memory, otherwise null.
  virtual const BlobPtr& memory() const;

  // Reads a part of a file into `bytes`. Errors of Read().
  static absl::Status ReadFile(FileLayer* files, int fd, std::int64_t offset, std::int64_t length, char* bytes);

 protected:
  explicit StoredBlob(std::int64_t size) : size_(size) {}

  // Replaces *bytes. The range is within the blob and not empty.
  virtual absl::Status ReadRange(std::int64_t offset, std::int64_t length, std::string* bytes) const = 0;

 private:
  const std::int64_t size_;
};

}  // namespace planish
