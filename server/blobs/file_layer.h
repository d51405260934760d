// The system calls by which blobs and uploads become files. Tests put a layer in between that refuses or counts.
#pragma once

#include <sys/types.h>

#include <cstddef>
#include <cstdint>
#include <string>

#include "absl/status/status.h"
#include "server/link/blob.h"

namespace planish {

// Each function is the system call of the same meaning; it returns 0 (or a count of bytes) for success and a negated
// errno otherwise. An interrupted call is made again. Thread-safe.
class FileLayer {
 public:
  virtual ~FileLayer() = default;

  // `flags` as for open(2); O_CLOEXEC is added, and a new file is for this user only.
  virtual int Open(const std::string& path, int flags, Descriptor* file);
  virtual ssize_t Read(int fd, char* bytes, std::size_t size, std::int64_t offset);
  virtual ssize_t Write(int fd, const char* bytes, std::size_t size, std::int64_t offset);
  // fsync(2) of a file or a folder.
  virtual int Sync(int fd);
  virtual int Rename(const std::string& from, const std::string& to);
  virtual int Remove(const std::string& path);
  // The file was modified now, by the clock of its file system.
  virtual int Touch(const std::string& path);
  // 0 if the folder is there already, which `made` (may be null) tells.
  virtual int MakeFolder(const std::string& path, bool* made);

  // The operating system's own calls.
  static FileLayer* System();
};

// What a failed call means. `error` is an errno, positive. RESOURCE_EXHAUSTED with STORAGE_FULL (the disk or a quota is
// full), RESOURCE_EXHAUSTED with OUT_OF_MEMORY (no descriptors or no memory: it passes), NOT_FOUND with BLOB_NOT_FOUND
// (there is no such file, or another machine removed it), DATA_LOSS with BLOB_DAMAGED (the device cannot read it), INTERNAL.
absl::Status FileError(const std::string& what, const std::string& path, int error);

// Makes the names in `folder` durable. Errors of FileError().
absl::Status SyncFolder(FileLayer* files, const std::string& folder);

// Makes `folder` if it is not there, and its name durable. Its parent must be there. Errors of FileError().
absl::Status MakeDurableFolder(FileLayer* files, const std::string& folder);

}  // namespace planish
