#pragma once

#include <optional>

#include "absl/time/time.h"
#include "grpcpp/server_context.h"

namespace planish {

// When, by the steady clock, the caller no longer waits; nothing if it waits for ever.
std::optional<absl::Time> DeadlineOf(const grpc::CallbackServerContext& context);

// Whether a call that was just cut off was so because its deadline passed. (The caller's clock measures it too, and its
// word may arrive a little before ours says so.)
bool HasPassed(const std::optional<absl::Time>& deadline);

}  // namespace planish
