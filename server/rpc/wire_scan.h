// Looks at a message in the wire format of Protocol Buffers without parsing it: parsing two bytes may take a hundred.
#pragma once

#include <cstdint>

#include "absl/status/statusor.h"
#include "google/protobuf/descriptor.h"
#include "google/protobuf/io/zero_copy_stream.h"

namespace planish {

// What parsing a message would cost.
struct WireCost {
  std::int64_t fields = 0;  // at every depth, unknown ones too; a packed list is one
  std::int64_t bytes = 0;   // of memory, roughly
};

// Scans `length` bytes of `stream` as a message of `type`; null: as one without known fields. Stops at the first thing
// that is wrong. INVALID_ARGUMENT with REQUEST_INVALID:
//   - more than `max_fields` fields;
//   - not in the wire format, or nested too deeply;
//   - a NUL byte in a string (metadata "field"): not every store keeps one.
absl::StatusOr<WireCost> ScanMessage(google::protobuf::io::ZeroCopyInputStream* stream, std::int64_t length,
                                     const google::protobuf::Descriptor* type, std::int64_t max_fields);

// INVALID_ARGUMENT with REQUEST_INVALID: bytes are no message of `type` (may be null).
absl::Status NoSuchMessage(const google::protobuf::Descriptor* type);

}  // namespace planish
