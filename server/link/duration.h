// Conversions of google.protobuf.Duration.
#pragma once

#include "absl/time/time.h"
#include "google/protobuf/duration.pb.h"

namespace planish {

// Exact to the nanosecond. A time out of Duration's range becomes the nearest value in range.
google::protobuf::Duration ToDuration(absl::Duration time);
inline google::protobuf::Duration ToDuration(double seconds) {
  return ToDuration(absl::Seconds(seconds));
}

double ToSeconds(const google::protobuf::Duration& duration);

}  // namespace planish
