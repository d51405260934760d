#include "server/blobs/file_layer.h"

#include <fcntl.h>
#include <sys/stat.h>
#include <unistd.h>

#include <cerrno>
#include <cstdio>
#include <cstring>

#include "absl/strings/str_cat.h"
#include "core/base/error.h"
#include "core/base/status_macros.h"

namespace planish {
namespace {

// Repeats `call` while signals interrupt it; returns its result or a negated errno.
template <class Call>
ssize_t Uninterrupted(Call call) {
  for (;;) {
    const ssize_t result = call();
    if (result >= 0) return result;
    if (errno != EINTR) return -errno;
  }
}

}  // namespace

int FileLayer::Open(const std::string& path, int flags, Descriptor* file) {
  const ssize_t fd = Uninterrupted([&] { return open(path.c_str(), flags | O_CLOEXEC, 0600); });
  if (fd < 0) return static_cast<int>(fd);
  *file = Descriptor(static_cast<int>(fd));
  return 0;
}

ssize_t FileLayer::Read(int fd, char* bytes, std::size_t size, std::int64_t offset) {
  return Uninterrupted([&] { return pread(fd, bytes, size, offset); });
}

ssize_t FileLayer::Write(int fd, const char* bytes, std::size_t size, std::int64_t offset) {
  return Uninterrupted([&] { return pwrite(fd, bytes, size, offset); });
}

int FileLayer::Sync(int fd) {
  return static_cast<int>(Uninterrupted([&] { return fsync(fd); }));
}

int FileLayer::Rename(const std::string& from, const std::string& to) {
  return rename(from.c_str(), to.c_str()) == 0 ? 0 : -errno;
}

int FileLayer::Remove(const std::string& path) {
  return unlink(path.c_str()) == 0 ? 0 : -errno;
}

int FileLayer::Touch(const std::string& path) {
  return utimensat(AT_FDCWD, path.c_str(), nullptr, 0) == 0 ? 0 : -errno;
}

int FileLayer::MakeFolder(const std::string& path, bool* made) {
  const bool is_new = mkdir(path.c_str(), 0700) == 0;
  if (!is_new && errno != EEXIST) return -errno;
  if (made != nullptr) *made = is_new;
  return 0;
}

FileLayer* FileLayer::System() {
  static FileLayer* const system = new FileLayer;
  return system;
}

absl::Status FileError(const std::string& what, const std::string& path, int error) {
  const std::string message = absl::StrCat("cannot ", what, " ", path, ": ", std::strerror(error));
  switch (error) {
    case ENOSPC:
    case EDQUOT:
    case EFBIG:  // the process may not write files of this size
      return MakeError(absl::StatusCode::kResourceExhausted, "STORAGE_FULL", message);
    case EMFILE:
    case ENFILE:
    case ENOMEM:
    case EAGAIN:
      return MakeError(absl::StatusCode::kResourceExhausted, "OUT_OF_MEMORY", message);
    case ENOENT:
    case ESTALE:
      return MakeError(absl::StatusCode::kNotFound, "BLOB_NOT_FOUND", message);
    case EIO:
      return MakeError(absl::StatusCode::kDataLoss, "BLOB_DAMAGED", message);
    default:
      return InternalError(message);
  }
}

absl::Status SyncFolder(FileLayer* files, const std::string& folder) {
  Descriptor opened;
  if (const int error = files->Open(folder, O_RDONLY | O_DIRECTORY, &opened); error != 0) {
    return FileError("open", folder, -error);
  }
  if (const int error = files->Sync(opened.get()); error != 0) return FileError("sync", folder, -error);
  return absl::OkStatus();
}

absl::Status MakeDurableFolder(FileLayer* files, const std::string& folder) {
  bool made = false;
  if (const int error = files->MakeFolder(folder, &made); error != 0) return FileError("make", folder, -error);
  if (!made) return absl::OkStatus();
  absl::Status synced = SyncFolder(files, folder.substr(0, folder.rfind('/')));
  if (!synced.ok()) rmdir(folder.c_str());  // so that the next caller creates it again and syncs its name
  return synced;
}

}  // namespace planish
