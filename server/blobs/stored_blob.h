// A blob of the store that is open for reading.
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

// Bytes in memory, or in a file that is read where it is asked for: never mapped, since a read of a file that somebody
// cuts short is an error, and an access to its mapping a signal that ends the process. Whoever holds one keeps the
// blob in its store. Thread-safe.
class StoredBlob {
 public:
  static StoredBlobPtr InMemory(BlobPtr bytes);
  // `files` outlives the blob; `size` is that of the file, whose bytes were verified.
  static StoredBlobPtr InFile(FileLayer* files, Descriptor file, std::int64_t size);

  std::int64_t size() const { return size_; }

  // Replaces *bytes by those from `offset` on, `length` of them, all of which must be there. DATA_LOSS with
  // BLOB_DAMAGED if the file has become shorter or cannot be read; other errors of FileError().
  absl::Status Read(std::int64_t offset, std::int64_t length, std::string* bytes) const;

  // All of them. Errors of Read().
  absl::StatusOr<std::string> ReadAll() const;

  // Null for a file.
  const BlobPtr& memory() const { return memory_; }

  // Reads a part of a file into `bytes`. Errors of Read().
  static absl::Status ReadFile(FileLayer* files, int fd, std::int64_t offset, std::int64_t length, char* bytes);

 private:
  StoredBlob(BlobPtr memory, FileLayer* files, Descriptor file, std::int64_t size)
      : memory_(std::move(memory)), files_(files), file_(std::move(file)), size_(size) {}

  const BlobPtr memory_;
  FileLayer* const files_;
  const Descriptor file_;
  const std::int64_t size_;
};

}  // namespace planish
