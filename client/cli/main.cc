// planish: the command line.
#include <malloc.h>

#include <cstdlib>
#include <exception>
#include <iostream>

#include "client/cli/arguments.h"
#include "client/cli/commands.h"
#include "client/cli/results.h"
#include "client/cli/session.h"
#include "client/cli/text.h"

namespace planish::cli {
namespace {

int Run(const Arguments& arguments) {
  Interrupts interrupts;
  try {
    switch (arguments.command) {
      case Command::kUnwrap:
        return RunUnwrap(arguments, interrupts);
      case Command::kPack:
        return RunPack(arguments, interrupts);
      case Command::kTransfer:
        return RunTransfer(arguments, interrupts);
      case Command::kCheck:
        return RunCheck(arguments, interrupts);
      case Command::kReport:
        return RunReport(arguments, interrupts);
      case Command::kInspect:
        return RunInspect(arguments);
      case Command::kEstimate:
        return RunEstimate(arguments, interrupts);
      case Command::kJobsWatch:
        return RunJobsWatch(arguments, interrupts);
      case Command::kHealth:
        return RunHealth(arguments);
      case Command::kAdminDrain:
      case Command::kAdminUndrain:
      case Command::kAdminStats:
      case Command::kAdminConfig:
        return RunAdmin(arguments, interrupts);
      case Command::kVersion:
        return RunVersion(arguments, interrupts);
      default:
        return RunJobs(arguments, interrupts);
    }
  } catch (const Error& error) {
    std::cerr << ErrorText(error, "", StderrTerminal());
    if (arguments.json) std::cout << ToText(ReportJson(FailureOf(error)));
    return ExitCodeOf(error);
  } catch (const std::exception& exception) {
    std::cerr << "planish: internal error: " << exception.what() << "\n";
    return kFailed;
  }
}

}  // namespace
}  // namespace planish::cli

int main(int argc, char** argv) {
  // Images and their mipmaps are given back to the system as soon as they are freed.
  mallopt(M_MMAP_THRESHOLD, 4 << 20);
  // gRPC would log what the command says in its own words.
  setenv("GRPC_VERBOSITY", "NONE", 0);
  const planish::cli::ParsedArguments parsed = planish::cli::ParseArguments(argc, argv);
  std::cout << parsed.out << std::flush;
  std::cerr << parsed.err;
  if (!parsed.arguments) return parsed.exit_code;
  planish::cli::SetColorMode(parsed.arguments->color);
  return planish::cli::Run(*parsed.arguments);
}
