#include "tests/server/blobs/power_loss.h"

#include <fcntl.h>
#include <sys/stat.h>
#include <sys/syscall.h>
#include <sys/sysmacros.h>
#include <unistd.h>

#include <cerrno>
#include <system_error>

#include "tests/testing/files.h"

namespace planish {
namespace {

std::mutex power_mutex;
PowerLoss* present_loss = nullptr;  // guarded by power_mutex

}  // namespace

PowerLoss::PowerLoss(std::filesystem::path root) : root_(std::filesystem::canonical(root)) {
  Keep(root_);
  for (const auto& entry : std::filesystem::recursive_directory_iterator(root_)) Keep(entry.path());
  const std::lock_guard lock(power_mutex);
  present_loss = this;
}

PowerLoss::~PowerLoss() {
  const std::lock_guard lock(power_mutex);
  present_loss = nullptr;
}

int PowerLoss::syncs() const {
  const std::lock_guard lock(mutex_);
  return syncs_;
}

void PowerLoss::Synced(int fd) {
  const int error = errno;
  const std::lock_guard watching(power_mutex);
  if (present_loss == nullptr) return;
  std::error_code failed;
  const std::filesystem::path path = std::filesystem::read_symlink("/proc/self/fd/" + std::to_string(fd), failed);
  if (!failed && (path.string() + "/").starts_with(present_loss->root_.string() + "/")) {
    const std::lock_guard lock(present_loss->mutex_);
    ++present_loss->syncs_;
    present_loss->Keep(path);
  }
  errno = error;
}

bool PowerLoss::Find(const std::filesystem::path& path, Inode* inode, bool* is_folder) {
  struct statx status = {};
  if (statx(AT_FDCWD, path.c_str(), 0, STATX_TYPE | STATX_INO | STATX_BTIME, &status) != 0) return false;
  const std::int64_t birth = status.stx_btime.tv_sec * 1'000'000'000 + status.stx_btime.tv_nsec;
  *inode = {makedev(status.stx_dev_major, status.stx_dev_minor), status.stx_ino, birth};
  *is_folder = S_ISDIR(status.stx_mode);
  return true;
}

void PowerLoss::Keep(const std::filesystem::path& path) {
  Inode inode;
  bool is_folder = false;
  if (!Find(path, &inode, &is_folder)) return;  // removed already
  if (!is_folder) {
    files_[inode] = ReadFile(path);
    return;
  }
  std::map<std::string, Inode> names;
  for (const auto& entry : std::filesystem::directory_iterator(path)) {
    if (!Find(entry.path(), &inode, &is_folder)) continue;
    names[entry.path().filename()] = inode;
    if (is_folder || files_.contains(inode)) continue;
    const std::string bytes = ReadFile(entry.path());
    unsynced_[inode] = bytes.substr(0, bytes.size() / 2);
  }
  folders_[path] = std::move(names);
}

void PowerLoss::Rescue(const std::filesystem::path& target) const {
  std::filesystem::remove_all(target);
  const std::lock_guard lock(mutex_);
  RescueFolder(root_, target);
}

void PowerLoss::RescueFolder(const std::filesystem::path& folder, const std::filesystem::path& target) const {
  std::filesystem::create_directories(target);
  const auto names = folders_.find(folder);
  if (names == folders_.end()) return;  // it never was synced: empty
  for (const auto& [name, inode] : names->second) {
    const std::filesystem::path path = folder / name;
    std::error_code error;
    const bool is_folder = folders_.contains(path) || std::filesystem::is_directory(path, error);
    const auto synced = files_.find(inode);
    const auto unsynced = unsynced_.find(inode);
    if (synced != files_.end()) {
      PutFile(target / name, synced->second);
    } else if (is_folder) {
      RescueFolder(path, target / name);
    } else if (unsynced != unsynced_.end()) {
      PutFile(target / name, unsynced->second);
    }
  }
}

}  // namespace planish

// In place of the C library's, for this program and the libraries it loads.
extern "C" int fsync(int fd) {
  const int result = static_cast<int>(syscall(SYS_fsync, fd));
  if (result == 0) planish::PowerLoss::Synced(fd);
  return result;
}

extern "C" int fdatasync(int fd) {
  const int result = static_cast<int>(syscall(SYS_fdatasync, fd));
  if (result == 0) planish::PowerLoss::Synced(fd);
  return result;
}
