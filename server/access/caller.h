// Who calls, and what they may do.
#pragma once

#include <string>

#include "absl/status/status.h"

namespace planish {

// The tenant of callers where no access file tells them apart.
inline constexpr char kDefaultTenant[] = "default";

struct Rights {
  bool submit = false;    // create jobs and uploads, and follow what the same call created
  bool jobs = false;      // see, watch, stop, cancel and delete the jobs of one's own tenant
  bool all_jobs = false;  // the same with every tenant's jobs
  bool admin = false;     // planish.admin.v1.Admin

  static Rights All() { return {true, true, true, true}; }
  bool operator==(const Rights&) const = default;
};

// What a call is about, as far as rights go.
enum class Need {
  kNobody,   // no credentials at all
  kNothing,  // credentials, with any rights or none
  kSubmit,
  kFollow,  // follow and end what one's own Unwrap began: "submit" or "jobs"
  kJobs,
  kAdmin,
};

struct Caller {
  std::string tenant;
  // Which of the tenant's credentials it was, for logs: e.g. "token farm", "certificate render-7", "user 1000".
  std::string credential;
  Rights rights;
  // W3C trace context (the header "traceparent"), made up where the caller gave none.
  std::string traceparent;

  // Whether a job of `owner` is this caller's to know of. One that is not does not exist for it.
  bool MaySee(const std::string& owner) const { return rights.all_jobs || (rights.jobs && owner == tenant); }

  // PERMISSION_DENIED with RIGHT_MISSING and metadata "right".
  absl::Status CheckRight(Need need) const;
};

}  // namespace planish
