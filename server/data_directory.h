// The data directory of planishd.
#pragma once

#include <sys/types.h>

#include <atomic>
#include <map>
#include <memory>
#include <string>
#include <utility>

#include "absl/status/status.h"
#include "absl/status/statusor.h"

namespace planish {

// A directory that one planishd owns at a time. Movable. The destructor, or the end of the process, releases it.
class DataDirectory {
 public:
  // Creates missing directories, for this user only. UNAVAILABLE with a message that names `path` if another process
  // owns it, or if it cannot be created or written.
  static absl::StatusOr<DataDirectory> Take(const std::string& path);

  DataDirectory(DataDirectory&& other) noexcept;
  DataDirectory& operator=(DataDirectory&& other) noexcept;
  ~DataDirectory();

  const std::string& path() const { return path_; }
  std::string jobs() const { return path_ + "/jobs.sqlite"; }
  std::string blobs() const { return path_ + "/blobs"; }
  std::string uploads() const { return path_ + "/uploads"; }

  // Remembers the identities of the directory and its files. Call it once, when jobs() exists.
  absl::Status Remember();
  // Checks that the directory and its files are still those of Remember(). UNAVAILABLE with DATA_DIRECTORY_LOST if one
  // was removed or replaced: then nothing that this process writes would be found again. Once lost, it stays lost.
  // Thread-safe.
  absl::Status Check() const;

 private:
  // Identifies a file or directory, independent of its name.
  using Identity = std::pair<dev_t, ino_t>;

  DataDirectory(std::string path, int lock) : path_(std::move(path)), lock_(lock) {}

  std::string path_;
  int lock_ = -1;
  std::map<std::string, Identity> identities_;  // by path
  // Set by Check(), which several threads may call.
  std::unique_ptr<std::atomic<bool>> lost_ = std::make_unique<std::atomic<bool>>(false);
};

}  // namespace planish
