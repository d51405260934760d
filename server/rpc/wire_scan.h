// Checks a message in the wire format of Protocol Buffers without parsing it, since parsing two bytes may take a
// hundred bytes of memory.
#pragma once

#include <cstdint>

#include "absl/status/statusor.h"
#include "google/protobuf/descriptor.h"
#include "google/protobuf/io/zero_copy_stream.h"

namespace planish {

// The cost of parsing a message.
struct WireCost {
  std::int64_t fields = 0;  // at every depth, with unknown ones; a packed list counts as one
  std::int64_t bytes = 0;   // of memory, roughly
};

// Scans `length` bytes of `stream` as a message of `type` (null: a message without known fields). Stops at the first
// error. INVALID_ARGUMENT with REQUEST_INVALID for:
//   - more than `max_fields` fields;
//   - not in the wire format, or nested too deeply;
//   - a NUL byte in a string (metadata "field"): some stores cannot hold it.
absl::StatusOr<WireCost> ScanMessage(google::protobuf::io::ZeroCopyInputStream* stream, std::int64_t length,
                                     const google::protobuf::Descriptor* type, std::int64_t max_fields);

// The error INVALID_ARGUMENT with REQUEST_INVALID for bytes that are not a message of `type` (may be null).
absl::Status NoSuchMessage(const google::protobuf::Descriptor* type);

}  // namespace planish
