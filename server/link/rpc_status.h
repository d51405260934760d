// absl::Status as google.rpc.Status: the one form in which errors leave a worker or the server.
#pragma once

#include "absl/status/status.h"
#include "absl/time/time.h"
#include "google/rpc/status.pb.h"

namespace planish {

// Tells the caller to wait at least `delay` before it tries again; becomes a google.rpc.RetryInfo. `status` must not
// be OK.
absl::Status WithRetryDelay(absl::Status status, absl::Duration delay);

// Code, message, and as details one ErrorInfo of domain "planish" (reason "INTERNAL" or the code's name if `status`
// was not made by MakeError), then the RetryInfo if there is one. Code 0 and nothing else for OK.
google::rpc::Status ToRpcStatus(const absl::Status& status);

// The reason in the ErrorInfo among the details; empty if there is none.
std::string ReasonOf(const google::rpc::Status& status);

}  // namespace planish
