// The command line: which commands there are, and what their flags say.
//
// A command is a struct of its arguments and functions over it, in a header of its own:
//   void AddFlags(CLI::App& app, InspectArguments& arguments);            its flags and the text below them
//   std::string Check(InspectArguments& arguments);                       what is wrong with its flags together, in
//                                                                         words; may complete them. May be missing
//   int Run(const InspectArguments& arguments, Interrupts& interrupts);   its work: returns an exit code, or throws
//                                                                         planish::Error
// command_line.cc has the table of names.
#pragma once

#include <optional>
#include <string>
#include <variant>

#include "client/cli/admin_command.h"
#include "client/cli/check_command.h"
#include "client/cli/estimate_command.h"
#include "client/cli/health_command.h"
#include "client/cli/inspect_command.h"
#include "client/cli/jobs_command.h"
#include "client/cli/jobs_watch_command.h"
#include "client/cli/pack_command.h"
#include "client/cli/report_command.h"
#include "client/cli/transfer_command.h"
#include "client/cli/unwrap_arguments.h"
#include "client/cli/version_command.h"

namespace planish::cli {

// The arguments of the command that was given.
using Arguments =
    std::variant<UnwrapArguments, PackArguments, TransferArguments, CheckArguments, ReportArguments, InspectArguments,
                 EstimateArguments, JobsListArguments, JobsShowArguments, JobsWatchArguments, JobsStopArguments,
                 JobsCancelArguments, JobsDeleteArguments, HealthArguments, AdminDrainArguments, AdminUndrainArguments,
                 AdminStatsArguments, AdminConfigArguments, VersionArguments>;

// Either arguments, or what to print and the code to exit with.
struct ParsedArguments {
  std::optional<Arguments> arguments;
  int exit_code = 0;
  std::string out;  // for stdout: help
  std::string err;  // for stderr: an error message
};

// Flags override environment variables, and these override the configuration file: $PLANISH_CONFIG, otherwise
// planish.toml in $XDG_CONFIG_HOME or ~/.config. It is TOML: the names of flags without dashes, for every command that
// has such a flag, or in the section of a command for that one ([unwrap], [jobs.list]).
ParsedArguments ParseArguments(int argc, const char* const* argv);

}  // namespace planish::cli
