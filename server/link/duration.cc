#include "server/link/duration.h"

#include <algorithm>
#include <cstdint>

namespace planish {
namespace {

// Ten thousand years: the range of a google.protobuf.Duration.
constexpr std::int64_t kMostSeconds = 315'576'000'000;

}  // namespace

google::protobuf::Duration ToDuration(absl::Duration time) {
  time = std::clamp(time, absl::Seconds(-kMostSeconds), absl::Seconds(kMostSeconds));
  google::protobuf::Duration duration;
  duration.set_seconds(absl::IDivDuration(time, absl::Seconds(1), &time));
  duration.set_nanos(static_cast<std::int32_t>(absl::ToInt64Nanoseconds(time)));
  return duration;
}

double ToSeconds(const google::protobuf::Duration& duration) {
  return static_cast<double>(duration.seconds()) + 1e-9 * duration.nanos();
}

}  // namespace planish
