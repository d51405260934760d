// google.protobuf.Duration from and to what the rest of the server counts in.
#pragma once

#include "absl/time/time.h"
#include "google/protobuf/duration.pb.h"

namespace planish {

// To the nanosecond; what a Duration cannot hold becomes the nearest it can.
google::protobuf::Duration ToDuration(absl::Duration time);
inline google::protobuf::Duration ToDuration(double seconds) {
  return ToDuration(absl::Seconds(seconds));
}

double ToSeconds(const google::protobuf::Duration& duration);

}  // namespace planish
