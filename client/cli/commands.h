// What the subcommands do, and what their exit codes mean.
#pragma once

#include <string>

#include "client/cli/arguments.h"
#include "client/cli/session.h"
#include "planish/error.h"

namespace planish::cli {

// ---- Exit codes

enum ExitCode : int {
  kOk = 0,                 // a usable result
  kFailed = 1,             // the job failed, or its result is not usable
  kUsage = 2,              // bad usage, unreadable input, or credentials that the server refuses
  kServerUnreachable = 3,  // no server, or a full queue: try later, or another server
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

// ---- Commands. Each returns an exit code, or throws planish::Error

int RunUnwrap(const Arguments& arguments, Interrupts& interrupts);
int RunBatch(const Arguments& arguments, Interrupts& interrupts);   // unwrap of several files
int RunPack(const Arguments& arguments, Interrupts& interrupts);    // asks no server
int RunTransfer(const Arguments& arguments, Interrupts& interrupts);  // asks no server
int RunCheck(const Arguments& arguments, Interrupts& interrupts);   // asks no server
int RunReport(const Arguments& arguments, Interrupts& interrupts);  // asks no server
int RunInspect(const Arguments& arguments);                         // asks no server
int RunEstimate(const Arguments& arguments, Interrupts& interrupts);
int RunJobsWatch(const Arguments& arguments, Interrupts& interrupts);
int RunJobs(const Arguments& arguments, Interrupts& interrupts);   // list, show, stop, cancel, delete
int RunHealth(const Arguments& arguments);                         // by HTTP
int RunAdmin(const Arguments& arguments, Interrupts& interrupts);  // drain, undrain, stats, config
int RunVersion(const Arguments& arguments, Interrupts& interrupts);

}  // namespace planish::cli
