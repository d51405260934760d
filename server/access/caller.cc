#include "server/access/caller.h"

#include "core/base/error.h"

namespace planish {
namespace {

absl::Status Missing(const std::string& right) {
  return MakeError(absl::StatusCode::kPermissionDenied, "RIGHT_MISSING",
                   "these credentials lack the right \"" + right + "\", which this call takes", {{"right", right}});
}

}  // namespace

absl::Status Caller::CheckRight(Need need) const {
  if (need == Need::kSubmit && !rights.submit) return Missing("submit");
  const bool has_jobs = rights.jobs || rights.all_jobs;
  if (need == Need::kFollow && !rights.submit && !has_jobs) return Missing("jobs");
  if (need == Need::kJobs && !has_jobs) return Missing("jobs");
  if (need == Need::kAdmin && !rights.admin) return Missing("admin");
  return absl::OkStatus();
}

}  // namespace planish
