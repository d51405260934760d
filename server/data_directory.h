// Where planishd keeps what outlives it.
#pragma once

#include <string>

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

  std::string jobs() const { return path_ + "/jobs.sqlite"; }
  std::string blobs() const { return path_ + "/blobs"; }
  std::string uploads() const { return path_ + "/uploads"; }

 private:
  DataDirectory(std::string path, int lock) : path_(std::move(path)), lock_(lock) {}

  std::string path_;
  int lock_ = -1;
};

}  // namespace planish
