// Where planishd keeps what outlives it.
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

// A directory that belongs to one planishd at a time. Movable; the destructor, or the end of the process, lets it go.
class DataDirectory {
 public:
  // Makes what is missing, for this user only. UNAVAILABLE with a message that names `path` if another process has it,
  // or it cannot be made or written.
  static absl::StatusOr<DataDirectory> Take(const std::string& path);

  DataDirectory(DataDirectory&& other) noexcept;
  DataDirectory& operator=(DataDirectory&& other) noexcept;
  ~DataDirectory();

  const std::string& path() const { return path_; }
  std::string jobs() const { return path_ + "/jobs.sqlite"; }
  std::string blobs() const { return path_ + "/blobs"; }
  std::string uploads() const { return path_ + "/uploads"; }

  // Remembers which directories and files these names mean; to be called once, when jobs() is there.
  absl::Status Remember();
  // UNAVAILABLE with DATA_DIRECTORY_LOST if a name means another one, or none: somebody removed or replaced the
  // directory under this process, and what it writes would not be found again. From then on the answer stays the same.
  // Thread-safe.
  absl::Status Check() const;

 private:
  // A file or directory, whatever its name is.
  using Identity = std::pair<dev_t, ino_t>;

  DataDirectory(std::string path, int lock) : path_(std::move(path)), lock_(lock) {}

  std::string path_;
  int lock_ = -1;
  std::map<std::string, Identity> identities_;  // by path
  // Of Check(), which others may call meanwhile.
  std::unique_ptr<std::atomic<bool>> lost_ = std::make_unique<std::atomic<bool>>(false);
};

}  // namespace planish
