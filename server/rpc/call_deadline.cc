#include "server/rpc/call_deadline.h"

#include "absl/time/clock.h"
#include "server/jobs/steady_clock.h"

namespace planish {
namespace {

constexpr absl::Duration kSlack = absl::Milliseconds(100);
// gRPC represents "never" by a time that is centuries away.
constexpr absl::Duration kNever = absl::Hours(24 * 365 * 50);

}  // namespace

std::optional<absl::Time> DeadlineOf(const grpc::CallbackServerContext& context) {
  const absl::Duration left = absl::FromChrono(context.deadline()) - absl::Now();
  if (left > kNever) return std::nullopt;
  return SteadyNow() + left;
}

bool HasPassed(const std::optional<absl::Time>& deadline) {
  return deadline.has_value() && SteadyNow() >= *deadline - kSlack;
}

}  // namespace planish
