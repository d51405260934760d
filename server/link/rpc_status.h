// absl::Status as google.rpc.Status: the one form in which errors leave a worker or the server.
#pragma once

#include "absl/status/status.h"
#include "absl/time/time.h"
#include "google/rpc/status.pb.h"

namespace planish {

// The same error for whoever sees the field that it names (metadata "field") within another one: "padding" within
// "options." is "options.padding". Only of INVALID_ARGUMENT; any other status stays as it is.
absl::Status WithinField(const absl::Status& status, const std::string& path);

// Tells the caller to wait at least `delay` before it tries again; becomes a google.rpc.RetryInfo. `status` must not
// be OK.
absl::Status WithRetryDelay(absl::Status status, absl::Duration delay);

// Code, message, and as details one ErrorInfo of domain "planish" (reason "INTERNAL" or the code's name if `status`
// was not made by MakeError), then the RetryInfo if there is one. Code 0 and nothing else for OK.
google::rpc::Status ToRpcStatus(const absl::Status& status);

// The reason in the ErrorInfo among the details; empty if there is none.
std::string ReasonOf(const google::rpc::Status& status);

}  // namespace planish
