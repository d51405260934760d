#include "server/data_directory.h"

#include <fcntl.h>
#include <sys/file.h>
#include <sys/stat.h>
#include <unistd.h>

#include <cerrno>
#include <cstring>
#include <filesystem>
#include <system_error>
#include <utility>

#include "absl/strings/str_cat.h"
#include "core/base/error.h"

namespace planish {
namespace {

absl::Status Failed(const std::string& what, const std::string& path, int error) {
  return absl::UnavailableError(absl::StrCat("cannot ", what, " ", path, ": ", std::strerror(error)));
}

// The directory has the meshes and results of all callers, so nobody else may enter. For a directory that exists
// already, such as a mounted volume, its creator has decided the mode.
absl::Status MakeDirectory(const std::string& path) {
  std::error_code error;
  const bool made = std::filesystem::create_directories(path, error);
  if (error) return Failed("make the data directory", path, error.value());
  if (made && chmod(path.c_str(), 0700) != 0) return Failed("keep others out of", path, errno);
  // The contents are only as durable as the directory's entry in its parent. An earlier process may have created the
  // directory and died before it synced the entry.
  const std::string absolute = std::filesystem::absolute(path, error).lexically_normal();
  for (std::filesystem::path folder = absolute; folder.has_relative_path(); folder = folder.parent_path()) {
    const int parent = open(folder.parent_path().c_str(), O_RDONLY | O_DIRECTORY | O_CLOEXEC);
    if (parent < 0) break;  // a parent that this process may not open was not created by it
    const int synced = fsync(parent);
    close(parent);
    if (synced != 0 && errno == EIO) return Failed("sync", folder.parent_path(), errno);
    if (!made) break;
  }
  return absl::OkStatus();
}

}  // namespace

absl::StatusOr<DataDirectory> DataDirectory::Take(const std::string& path) {
  for (const char* part : {"", "/blobs", "/uploads"}) {
    if (absl::Status status = MakeDirectory(path + part); !status.ok()) return status;
  }
  const std::string lock_path = path + "/lock";
  const int lock = open(lock_path.c_str(), O_RDWR | O_CREAT | O_CLOEXEC, 0600);
  if (lock < 0) return Failed("create", lock_path, errno);
  DataDirectory directory(path, lock);
  if (flock(lock, LOCK_EX | LOCK_NB) != 0) {
    if (errno != EWOULDBLOCK) return Failed("lock", lock_path, errno);
    return absl::UnavailableError(
        absl::StrCat("the data directory ", path, " belongs to another planishd that is running"));
  }
  return directory;
}

absl::Status DataDirectory::Remember() {
  for (const std::string& name : {path_, path_ + "/lock", jobs(), blobs(), uploads()}) {
    struct stat file = {};
    if (stat(name.c_str(), &file) != 0) return Failed("look at", name, errno);
    identities_[name] = {file.st_dev, file.st_ino};
  }
  return absl::OkStatus();
}

absl::Status DataDirectory::Check() const {
  for (const auto& [name, identity] : identities_) {
    struct stat file = {};
    // Any error other than a missing name may be transient.
    const bool is_gone = stat(name.c_str(), &file) != 0 ? errno == ENOENT || errno == ENOTDIR
                                                        : Identity(file.st_dev, file.st_ino) != identity;
    if (is_gone) *lost_ = true;
  }
  if (!*lost_) return absl::OkStatus();
  return MakeError(absl::StatusCode::kUnavailable, "DATA_DIRECTORY_LOST",
                   "the server's data directory was removed or replaced while the server ran: nothing new is stored, "
                   "and the server has to be restarted");
}

DataDirectory::DataDirectory(DataDirectory&& other) noexcept
    : path_(std::move(other.path_)),
      lock_(std::exchange(other.lock_, -1)),
      identities_(std::move(other.identities_)),
      lost_(std::move(other.lost_)) {}

DataDirectory& DataDirectory::operator=(DataDirectory&& other) noexcept {
  std::swap(path_, other.path_);
  std::swap(lock_, other.lock_);
  std::swap(identities_, other.identities_);
  std::swap(lost_, other.lost_);
  return *this;
}

DataDirectory::~DataDirectory() {
  if (lock_ >= 0) close(lock_);
}

}  // namespace planish
