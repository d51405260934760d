// Errors with a machine-readable reason, carried inside absl::Status.
#pragma once

#include <map>
#include <string>

#include "absl/status/status.h"

namespace planish {

// The cause of a failure for programs. The server converts it to google.rpc.ErrorInfo.
struct ErrorInfo {
  std::string reason;                           // UPPER_SNAKE_CASE; the list is at planish.v1.Job.error
  std::map<std::string, std::string> metadata;  // e.g. {"vertices", "12,40"}, ids 0-based
};

// A status of `code` with `message` for people and `reason` and `metadata` for programs.
// `code` must not be kOk.
absl::Status MakeError(absl::StatusCode code, const std::string& reason, const std::string& message,
                       const std::map<std::string, std::string>& metadata = {});

// INVALID_ARGUMENT, OPTIONS_INVALID, with the field's name in the message and the metadata.
absl::Status OptionError(const std::string& field, const std::string& message,
                         std::map<std::string, std::string> metadata = {});

// The reason and metadata given to MakeError; an empty reason for any other status.
ErrorInfo ErrorInfoOf(const absl::Status& status);

// INTERNAL, reason "INTERNAL": a fault of this program, not of its input.
absl::Status InternalError(const std::string& message);

}  // namespace planish
