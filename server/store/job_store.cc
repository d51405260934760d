#include "server/store/job_store.h"

#include <memory>
#include <string>
#include <string_view>
#include <utility>

#include "absl/strings/str_cat.h"
#include "core/base/error.h"
#include "core/base/status_macros.h"
#include "server/store/job_store_parts.h"

namespace planish {

JobStore::JobStore(std::unique_ptr<SqlDatabase> database, JobStoreOptions options)
    : parts_(std::make_unique<Parts>(std::move(database), std::move(options))) {
  parts_->database->Listen([this](std::string_view message) { parts_->listeners.Call(DecodeNews(message)); });
}

JobStore::~JobStore() = default;

const std::string& JobStore::id() const {
  return parts_->database->id();
}
bool JobStore::is_shared() const {
  return parts_->database->is_shared();
}
bool JobStore::hears_others() const {
  return parts_->database->hears();
}
BlobRows* JobStore::rows() {
  return parts_->database->outlives_process() ? &parts_->rows : nullptr;
}

JobStore::Subscription JobStore::Subscribe(Listener listener) {
  return parts_->listeners.Add(std::move(listener));
}

absl::Status JobNotFound(const std::string& name) {
  return MakeError(absl::StatusCode::kNotFound, "JOB_NOT_FOUND",
                   absl::StrCat("there is no job '", name, "': it never was, or it was deleted or dropped"),
                   {{"job", name}});
}

absl::Status LeaseLost(const Lease& lease) {
  return MakeError(absl::StatusCode::kAborted, "LEASE_LOST",
                   absl::StrCat("attempt ", lease.attempt, " at ", lease.work, " is no longer that of ", lease.owner));
}

absl::StatusOr<std::unique_ptr<JobStore>> OpenJobStore(const std::string& path, std::function<bool()> give_up_reserve) {
  PLANISH_ASSIGN_OR_RETURN(auto database, OpenSqliteDatabase(path, std::move(give_up_reserve)));
  return std::make_unique<JobStore>(std::move(database));
}

}  // namespace planish
