// What the exit codes of the command mean.
#pragma once

#include <string>

#include "planish/error.h"

namespace planish::cli {

enum ExitCode : int {
  kOk = 0,                 // a usable result
  kFailed = 1,             // the job failed, or its result is not usable
  kUsage = 2,              // bad usage, unreadable input, or credentials that the server refuses
  kServerUnreachable = 3,  // no server, or a full queue; the user may try later, or another server
  kInterrupted = 130,      // Ctrl-C
};

inline ExitCode ExitCodeOf(const Error& error) {
  const std::string& reason = error.reason();
  if (reason.rfind("FILE_", 0) == 0 || reason.rfind("BATCH_", 0) == 0 || reason == "OPTIONS_INVALID" ||
      reason == "REQUEST_INVALID" || reason == "OUTPUT_UNSUPPORTED" || reason.rfind("IMAGE_", 0) == 0) {
    return kUsage;
  }
  if (error.code() == ErrorCode::kUnauthenticated || error.code() == ErrorCode::kPermissionDenied) return kUsage;
  if (error.code() == ErrorCode::kUnavailable || reason == "QUEUE_FULL") return kServerUnreachable;
  return kFailed;
}

}  // namespace planish::cli
