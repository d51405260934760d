// The caller of an RPC: tenant, credentials and rights.
#pragma once

#include <string>

#include "absl/status/status.h"

namespace planish {

// The tenant of all callers if there is no access file.
inline constexpr char kDefaultTenant[] = "default";

struct Rights {
  bool submit = false;    // create jobs and uploads, and follow what the same call created
  bool jobs = false;      // see, watch, stop, cancel and delete the jobs of one's own tenant
  bool all_jobs = false;  // the same with every tenant's jobs
  bool admin = false;     // planish.admin.v1.Admin

  static Rights All() { return {true, true, true, true}; }
  bool operator==(const Rights&) const = default;
};

// The right that a call needs.
enum class Need {
  kNobody,   // no credentials at all
  kNothing,  // valid credentials, with or without rights
  kSubmit,
  kFollow,  // follow and end jobs of one's own Unwrap: "submit" or "jobs"
  kJobs,
  kAdmin,
};

struct Caller {
  std::string tenant;
  // Which of the tenant's credentials was used, for logs: "token farm", "certificate render-7", "user 1000".
  std::string credential;
  Rights rights;
  // W3C trace context (the header "traceparent"), a new one if the caller sent none.
  std::string traceparent;

  // Whether this caller may see jobs of the tenant `owner`. Other jobs do not exist for it.
  bool MaySee(const std::string& owner) const { return rights.all_jobs || (rights.jobs && owner == tenant); }

  // OK if the caller has the right; otherwise PERMISSION_DENIED with RIGHT_MISSING and metadata "right".
  absl::Status CheckRight(Need need) const;
};

}  // namespace planish
