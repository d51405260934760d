#include "server/rpc/call_deadline.h"

#include "absl/time/clock.h"

namespace planish {
namespace {

constexpr absl::Duration kSlack = absl::Milliseconds(100);
// gRPC says "never" by a time that is centuries away.
constexpr absl::Duration kNever = absl::Hours(24 * 365 * 50);

}  // namespace

std::optional<absl::Time> DeadlineOf(const grpc::CallbackServerContext& context) {
  const absl::Time deadline = absl::FromChrono(context.deadline());
  if (deadline - absl::Now() > kNever) return std::nullopt;
  return deadline;
}

bool HasPassed(const std::optional<absl::Time>& deadline) {
  return deadline.has_value() && absl::Now() >= *deadline - kSlack;
}

}  // namespace planish
