// What the command's exit codes mean (DESIGN.md, section 6).
#pragma once

#include "planish/error.h"

namespace planish::cli {

enum ExitCode : int {
  kOk = 0,      // a usable result
  kFailed = 1,  // the job failed, or its result is not usable
  kUsage = 2,   // bad usage, unreadable input, or credentials that do not do
  kServerUnreachable = 3,
  kInterrupted = 130,  // Ctrl-C
};

inline ExitCode ExitCodeOf(const Error& error) {
  if (error.reason().rfind("FILE_", 0) == 0 || error.reason() == "OPTIONS_INVALID" ||
      error.reason() == "OUTPUT_UNSUPPORTED" || error.reason().rfind("BATCH_", 0) == 0) {
    return kUsage;
  }
  if (error.code() == ErrorCode::kUnauthenticated || error.code() == ErrorCode::kPermissionDenied) return kUsage;
  if (error.code() == ErrorCode::kUnavailable) return kServerUnreachable;
  return kFailed;
}

}  // namespace planish::cli
