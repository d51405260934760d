// Gives access to the current access file, which can be read again.
#pragma once

#include <functional>
#include <memory>
#include <mutex>
#include <string>
#include <vector>

#include "server/access/access_file.h"

namespace planish {

// The access file of a server as it was last read. Thread-safe.
class AccessSource {
 public:
  // Loads the file. Errors of LoadAccessFile().
  static absl::StatusOr<std::unique_ptr<AccessSource>> Open(const std::string& file);

  // The current table. A call keeps the table it got, also after a reload.
  std::shared_ptr<const AccessTable> table() const;

  // Reads the file again; calling the returned function puts the new table in force. Errors of LoadAccessFile().
  absl::StatusOr<std::function<void()>> Prepare();

  // Prepare(), and then the returned function. If the file is wrong, the table does not change and the error says why.
  absl::Status Reload();

  const std::string& file() const { return file_; }

  // The warnings of the last LoadAccessFile().
  std::vector<std::string> warnings() const;

 private:
  explicit AccessSource(std::string file) : file_(std::move(file)) {}

  const std::string file_;
  mutable std::mutex mutex_;
  LoadedAccess loaded_;  // guarded by mutex_
};

}  // namespace planish
