#include "server/file_watch.h"

#include <sys/stat.h>

#include <utility>

namespace planish {

FileWatch::FileWatch(std::vector<std::string> files) : files_(std::move(files)), known_(Look()), seen_(known_) {}

bool FileWatch::Changed() {
  std::vector<Stamp> now = Look();
  const bool is_settled = now == seen_;
  seen_ = std::move(now);
  if (!is_settled || seen_ == known_) return false;
  known_ = seen_;
  return true;
}

std::vector<FileWatch::Stamp> FileWatch::Look() const {
  std::vector<Stamp> stamps;
  for (const std::string& file : files_) {
    struct stat info = {};
    Stamp& stamp = stamps.emplace_back();
    if (stat(file.c_str(), &info) != 0) continue;
    stamp = {info.st_dev, info.st_ino, info.st_size, info.st_mtim.tv_sec, info.st_mtim.tv_nsec};
  }
  return stamps;
}

}  // namespace planish
