#pragma once

#include <optional>

#include "absl/time/time.h"
#include "grpcpp/server_context.h"

namespace planish {

// The caller's deadline by the steady clock; empty if it has none.
std::optional<absl::Time> DeadlineOf(const grpc::CallbackServerContext& context);

// Whether a call that was just cut off ended because its deadline passed. Allows some slack, since the caller measures
// the deadline by its own clock, and may cancel a little early by ours.
bool HasPassed(const std::optional<absl::Time>& deadline);

}  // namespace planish
