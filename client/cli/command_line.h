// Parses the command line into the arguments of one command.
//
// A command is a struct of its arguments and these functions, in a header of its own:
//   void AddFlags(CLI::App& app, InspectArguments& arguments);            adds its flags and the text below them
//   std::string Check(InspectArguments& arguments);                       optional: returns what is wrong with the
//                                                                         flags together; may complete them
//   int Run(const InspectArguments& arguments, Interrupts& interrupts);   does its work: returns an exit code, or
//                                                                         throws planish::Error
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
// planish.toml in $XDG_CONFIG_HOME or ~/.config. The file is TOML with the names of flags, without dashes. Flags at the
// top are for every command that has them; flags in a section ([unwrap], [jobs.list]) are for that command only.
ParsedArguments ParseArguments(int argc, const char* const* argv);

}  // namespace planish::cli
