// Conversion of absl::Status to google.rpc.Status. All errors leave a worker or the server in this form.
#pragma once

#include "absl/status/status.h"
#include "absl/time/time.h"
#include "google/rpc/status.pb.h"

namespace planish {

// Puts `path` before the field that the error names (metadata "field"): "padding" with the path "options." becomes
// "options.padding". Changes INVALID_ARGUMENT only.
absl::Status WithinField(const absl::Status& status, const std::string& path);

// Adds a google.rpc.RetryInfo: the caller should wait at least `delay` before it tries again. `status` must not be OK.
absl::Status WithRetryDelay(absl::Status status, absl::Duration delay);

// Code, message, and as details an ErrorInfo of the domain "planish" and the RetryInfo, if there is one. The reason is
// "INTERNAL" or the code's name if `status` was not made by MakeError. OK becomes code 0 and nothing else.
google::rpc::Status ToRpcStatus(const absl::Status& status);

// The reason in the ErrorInfo among the details; empty if there is none.
std::string ReasonOf(const google::rpc::Status& status);

}  // namespace planish
