// What the subcommands do. Each returns an exit code and throws planish::Error for what stops it.
#pragma once

#include "client/cli/arguments.h"
#include "client/cli/interrupts.h"

namespace planish::cli {

int RunUnwrap(const Arguments& arguments, Interrupts& interrupts);
int RunBatch(const Arguments& arguments, Interrupts& interrupts);   // unwrap of several files
int RunPack(const Arguments& arguments, Interrupts& interrupts);    // asks no server
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
