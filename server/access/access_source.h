// The access file as it is now.
#pragma once

#include <functional>
#include <memory>
#include <mutex>
#include <string>
#include <vector>

#include "server/access/access_file.h"

namespace planish {

// Thread-safe.
class AccessSource {
 public:
  // Errors of LoadAccessFile().
  static absl::StatusOr<std::unique_ptr<AccessSource>> Open(const std::string& file);

  // For calls from now on: who got theirs before keeps the old one until they let go of it.
  std::shared_ptr<const AccessTable> table() const;

  // Reads the file again; the function puts what it says in force. Errors of LoadAccessFile().
  absl::StatusOr<std::function<void()>> Prepare();

  // Both at once. If the file is wrong, the table stays as it was and the error says why.
  absl::Status Reload();

  const std::string& file() const { return file_; }

  // What LoadAccessFile() warned about, last time.
  std::vector<std::string> warnings() const;

 private:
  explicit AccessSource(std::string file) : file_(std::move(file)) {}

  const std::string file_;
  mutable std::mutex mutex_;
  LoadedAccess loaded_;  // guarded by mutex_
};

}  // namespace planish
