#include "server/disk_room.h"

#include <fcntl.h>
#include <sys/stat.h>
#include <sys/statvfs.h>
#include <unistd.h>

#include <algorithm>
#include <limits>
#include <utility>

#include "server/link/blob.h"

namespace planish {
namespace {

constexpr std::int64_t kPartOfDisk = 8, kPartOfHeadroom = 4, kParts = 4;

struct Disk {
  std::int64_t bytes = std::numeric_limits<std::int64_t>::max();
  std::int64_t available = std::numeric_limits<std::int64_t>::max();
};

// Free and total bytes; unlimited if the file system does not tell.
Disk DiskOf(const std::string& directory) {
  struct statvfs status = {};
  if (statvfs(directory.c_str(), &status) != 0 || status.f_blocks == 0) return {};
  const auto block = static_cast<std::int64_t>(status.f_frsize);
  return {static_cast<std::int64_t>(status.f_blocks) * block, static_cast<std::int64_t>(status.f_bavail) * block};
}

}  // namespace

DiskRoom::DiskRoom(std::string directory, std::int64_t headroom_bytes)
    : directory_(std::move(directory)), reserve_path_(directory_ + "/reserve") {
  headroom_ = std::min(headroom_bytes, DiskOf(directory_).bytes / kPartOfDisk);
  whole_reserve_ = headroom_ / kPartOfHeadroom;
  Tick();
}

std::int64_t DiskRoom::Shortage(std::int64_t more) const {
  return more - (DiskOf(directory_).available - headroom_);
}

bool DiskRoom::HasRoomForResults() const {
  return DiskOf(directory_).available >= whole_reserve_;
}

std::int64_t DiskRoom::reserve_bytes() const {
  struct stat file = {};
  return stat(reserve_path_.c_str(), &file) == 0 ? static_cast<std::int64_t>(file.st_size) : 0;
}

bool DiskRoom::GiveUpReserve() {
  const std::lock_guard lock(mutex_);
  const std::int64_t left = reserve_bytes();
  if (left <= 0) return false;
  const std::int64_t rest = std::max<std::int64_t>(left - std::max<std::int64_t>(whole_reserve_ / kParts, 1), 0);
  // Some file systems need room to shorten a file, but can still remove one.
  return truncate(reserve_path_.c_str(), rest) == 0 || unlink(reserve_path_.c_str()) == 0;
}

void DiskRoom::Tick() {
  const std::lock_guard lock(mutex_);
  const std::int64_t missing = whole_reserve_ - reserve_bytes();
  if (missing <= 0 || DiskOf(directory_).available < headroom_ + missing) return;
  const Descriptor file(open(reserve_path_.c_str(), O_WRONLY | O_CREAT | O_CLOEXEC, 0600));
  if (file.get() < 0) return;
  // A partial reserve is better than none, so errors are ignored.
  static_cast<void>(posix_fallocate(file.get(), 0, whole_reserve_));
}

}  // namespace planish
