// The bytes of one upload that have arrived so far.
#pragma once

#include <cstdint>
#include <memory>
#include <string>
#include <string_view>

#include "absl/status/status.h"
#include "absl/status/statusor.h"
#include "server/blobs/running_sha256.h"
#include "server/link/blob.h"

namespace planish {

// A file that exists from the start, or anonymous memory. Not thread-safe.
class UploadFile {
 public:
  // The file at `path`, with `size` bytes that an earlier process wrote. Memory if `path` is empty.
  explicit UploadFile(std::string path, std::int64_t size = 0) : path_(std::move(path)), size_(size) {}

  std::int64_t size() const { return size_; }
  const std::string& path() const { return path_; }

  // Adds all of `bytes` or, after an error, none of them. RESOURCE_EXHAUSTED with STORAGE_FULL.
  absl::Status Append(std::string_view bytes);

  // Undoes the last Append().
  absl::Status UndoAppend();

  // SHA-256 of all bytes. Takes long only if an earlier process wrote some of the bytes, which are then read again
  // once.
  absl::StatusOr<std::string> Digest();

  // All bytes; valid as long as the result is held, and nothing may be appended meanwhile.
  absl::StatusOr<BlobPtr> Map();

  // Closes the descriptor of a named file until it is needed again.
  void Rest();

 private:
  absl::Status EnsureOpen();
  absl::Status CutTo(std::int64_t size);
  // Hashes the bytes from hashed_ to size_.
  absl::Status HashTheRest();

  const std::string path_;
  std::int64_t size_;
  Descriptor file_;
  RunningSha256 hash_, hash_before_;  // of the first hashed_ bytes, now and before the last Append()
  std::int64_t hashed_ = 0;           // bytes that went into hash_
  std::int64_t size_before_ = 0;
};

// The error for `error_number` of a failed write: STORAGE_FULL if there is no room, INTERNAL otherwise.
absl::Status WriteError(int error_number, const std::string& what);

}  // namespace planish
