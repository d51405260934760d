#include "server/access/access_source.h"

#include <utility>

#include "core/base/status_macros.h"

namespace planish {

absl::StatusOr<std::unique_ptr<AccessSource>> AccessSource::Open(const std::string& file) {
  std::unique_ptr<AccessSource> source(new AccessSource(file));
  PLANISH_RETURN_IF_ERROR(source->Reload());
  return source;
}

std::shared_ptr<const AccessTable> AccessSource::table() const {
  const std::lock_guard lock(mutex_);
  return loaded_.table;
}

absl::StatusOr<std::function<void()>> AccessSource::Prepare() {
  PLANISH_ASSIGN_OR_RETURN(LoadedAccess loaded, LoadAccessFile(file_));
  return std::function<void()>([this, loaded = std::move(loaded)] {
    const std::lock_guard lock(mutex_);
    loaded_ = loaded;
  });
}

absl::Status AccessSource::Reload() {
  PLANISH_ASSIGN_OR_RETURN(const std::function<void()> put_in_force, Prepare());
  put_in_force();
  return absl::OkStatus();
}

std::vector<std::string> AccessSource::warnings() const {
  const std::lock_guard lock(mutex_);
  return loaded_.warnings;
}

}  // namespace planish
