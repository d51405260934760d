// The system calls for the files of blobs and uploads. Tests replace them with ones that fail or count.
#pragma once

#include <sys/types.h>

#include <cstddef>
#include <cstdint>
#include <string>

#include "absl/status/status.h"
#include "server/link/blob.h"

namespace planish {

// Each function is the system call of the same meaning. It returns 0 (or a number of bytes) for success and a negated
// errno otherwise. Interrupted calls are repeated. Thread-safe.
class FileLayer {
 public:
  virtual ~FileLayer() = default;

  // `flags` as for open(2); O_CLOEXEC is added, and new files are accessible only to this user.
  virtual int Open(const std::string& path, int flags, Descriptor* file);
  virtual ssize_t Read(int fd, char* bytes, std::size_t size, std::int64_t offset);
  virtual ssize_t Write(int fd, const char* bytes, std::size_t size, std::int64_t offset);
  // fsync(2) of a file or a folder.
  virtual int Sync(int fd);
  virtual int Rename(const std::string& from, const std::string& to);
  virtual int Remove(const std::string& path);
  // Sets the modification time to now, by the clock of the file system.
  virtual int Touch(const std::string& path);
  // Creates a folder. Returns 0 also if it exists; `made` (may be null) says whether it was created.
  virtual int MakeFolder(const std::string& path, bool* made);

  // The operating system's calls.
  static FileLayer* System();
};

// Converts a positive errno of a failed call. RESOURCE_EXHAUSTED with STORAGE_FULL (the disk or a quota is full),
// RESOURCE_EXHAUSTED with OUT_OF_MEMORY (no descriptors or no memory; temporary), NOT_FOUND with BLOB_NOT_FOUND (no
// such file, or another machine removed it), DATA_LOSS with BLOB_DAMAGED (the device cannot read it), INTERNAL.
absl::Status FileError(const std::string& what, const std::string& path, int error);

// Syncs `folder`, which makes the names in it durable. Errors of FileError().
absl::Status SyncFolder(FileLayer* files, const std::string& folder);

// Creates `folder` if needed, and makes its name durable. Its parent must exist. Errors of FileError().
absl::Status MakeDurableFolder(FileLayer* files, const std::string& folder);

}  // namespace planish
