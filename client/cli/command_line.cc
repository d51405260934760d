#include "client/cli/command_line.h"

#include <algorithm>
#include <cmath>
#include <cstddef>
#include <cstdlib>
#include <filesystem>
#include <fstream>
#include <functional>
#include <memory>
#include <set>
#include <sstream>
#include <string>
#include <system_error>
#include <vector>

#include "CLI/CLI.hpp"
#include "client/cli/exit_codes.h"
#include "core/base/command_pages.h"
#include "planish/client.h"

namespace planish::cli {
namespace {

ManFrame ManPage() {
  return {1, "User Commands", R"(.SH SYNOPSIS
.B planish unwrap
.I IN
.B \-o
.I OUT
.RI [ OPTIONS ]
.br
.B planish
.I COMMAND
.RI [ OPTIONS ]
.SH DESCRIPTION
.B planish
sends triangle meshes to a
.BR planishd (8)
server, shows the progress of their unwrapping, and writes the texture coordinates into a copy of the file. Without
.B \-\-server
it starts a private server for the life of the command.
.PP
Results go to standard output; progress, summaries and errors go to standard error.
)",
          R"(.SH ENVIRONMENT
.TP
.B PLANISH_SERVER
The server, if
.B \-\-server
is not given.
.TP
.BR PLANISH_TLS ", " PLANISH_TLS_CA ", " PLANISH_TLS_CERT ", " PLANISH_TLS_KEY ", " PLANISH_TOKEN ", " PLANISH_TOKEN_FILE
Encryption and credentials, if the flags of the same names are not given.
.TP
.B PLANISH_CONFIG
The configuration file; empty: none.
.TP
.BR NO_COLOR ", " TERM
Whether standard error gets colours and bars.
.SH CONFIGURATION
The file that
.B PLANISH_CONFIG
names, or
.I $XDG_CONFIG_HOME/planish.toml
(without that variable
.IR ~/.config/planish.toml ),
holds flags that are added to every call which does not have them, under their names without dashes. Flags at the top
are for all commands that have them; flags in the section of a command are for that command only.
.PP
.nf
server = "farm:7741"
color = "never"
[unwrap]
texture\-size = 2048
[jobs.list]
limit = 10
.fi
.PP
Flags override variables, and variables override the file.
.SH FILES
.TP
.I ~/.config/planish.toml
Settings for every call, see CONFIGURATION.
.TP
.I OUT/.planish\-batch.json
Record of what a batch has done. If the command is repeated, it continues from there.
.SH EXIT STATUS
.TP
.B 0
A usable map, or whatever else was asked for.
.TP
.B 1
The job failed, or its map is not usable (it is written nevertheless).
.TP
.B 2
Bad usage, or input that cannot be read.
.TP
.B 3
The server cannot be reached, or its queue is full.
.TP
.B 130
Interrupted. The first Ctrl\-C cancels the job on the server; the second one exits at once.
.SH SEE ALSO
.BR planishd (8)
)"};
}

constexpr char kExamples[] = R"(Examples:
  planish unwrap face.obj -o face_uv.obj             unwrap a mesh; starts a server of its own
  planish unwrap face.ply -o face.obj --json         and print the report as JSON
  planish unwrap face.obj -o uv.obj --server=farm:7741
  planish unwrap props/ hero.glb -o done/            a job and an output for each mesh
  planish unwrap big.obj --detach --server=farm:7741
  planish pack hero.obj -o packed.obj --padding=8    packs its existing UV islands again
  planish check hero.glb --require=no-overlap        checks its UV, whatever program made them
  planish report before.glb after.glb -o compare.html  a page that shows both maps, opened from disk
  planish inspect scan.stl                           what is wrong with it, and what unwrap would do
  planish estimate scan.stl --server=farm:7741       memory, time, and whether it would be accepted
  planish jobs watch jobs/1a2b --mesh big.obj -o big_uv.obj --server=farm:7741

Exit codes: 0 usable result, 1 job failed or result not usable, 2 bad usage or unreadable input,
3 no server or a full queue, 130 interrupted (the first Ctrl-C cancels the job, a second exits at once).)";

// ---- Suggestions

// The least number of steps that turn `a` into `b`; a step adds, removes or replaces a letter, or swaps two neighbours.
std::size_t EditDistance(const std::string& a, const std::string& b) {
  std::vector<std::vector<std::size_t>> cost(a.size() + 1, std::vector<std::size_t>(b.size() + 1));
  for (std::size_t i = 0; i <= a.size(); ++i) {
    for (std::size_t j = 0; j <= b.size(); ++j) {
      if (i == 0 || j == 0) {
        cost[i][j] = i + j;
        continue;
      }
      cost[i][j] = std::min({cost[i - 1][j] + 1, cost[i][j - 1] + 1, cost[i - 1][j - 1] + (a[i - 1] != b[j - 1])});
      if (i > 1 && j > 1 && a[i - 1] == b[j - 2] && a[i - 2] == b[j - 1]) {
        cost[i][j] = std::min(cost[i][j], cost[i - 2][j - 2] + 1);
      }
    }
  }
  return cost[a.size()][b.size()];
}

// The name that `word` was probably meant to be: at most a third of its letters are wrong. Empty if there is no such
// name.
std::string Nearest(const std::string& word, const std::vector<std::string>& names) {
  std::string nearest;
  std::size_t least = word.size() / 3 + 1;
  for (const std::string& name : names) {
    if (const std::size_t distance = EditDistance(word, name); distance < least) least = distance, nearest = name;
  }
  return nearest;
}

// "Did you mean unwrap?" for the first unknown command or flag of the command line; empty if no name is similar.
std::string Suggestion(const CLI::App& root, int argc, const char* const* argv) {
  const CLI::App* app = &root;
  for (int i = 1; i < argc; ++i) {
    const std::string word = argv[i];
    std::vector<std::string> names;
    if (word.starts_with("--")) {
      for (const CLI::Option* option : app->get_options()) {
        for (const std::string& name : option->get_lnames()) names.push_back("--" + name);
      }
    } else if (!word.starts_with("-")) {
      for (const CLI::App* command : app->get_subcommands(nullptr)) names.push_back(command->get_name());
    }
    const std::string name = word.substr(0, word.starts_with("--") ? word.find('=') : word.npos);
    if (std::find(names.begin(), names.end(), name) == names.end()) {
      const std::string nearest = Nearest(name, names);
      if (!nearest.empty()) return "Did you mean " + nearest + "?\n";
    } else if (!name.starts_with("-")) {
      app = app->get_subcommand(name);
    }
  }
  return "";
}

// ---- The command line, and the configuration file under it

// Makes flags for numbers refuse "nan", which CLI11 accepts as a number within every range.
void RefuseNan(CLI::App& app) {
  const auto is_number = [](const std::string& text) -> std::string {
    double number = 0;
    const bool is_nan = CLI::detail::lexical_cast(text, number) && std::isnan(number);
    return is_nan ? "Value " + text + " is not a number" : "";
  };
  for (CLI::Option* option : app.get_options()) {
    const std::string type = option->get_type_name();
    if (type == "FLOAT" || type == "SECONDS" || type == "N" || type == "X") {
      option->check(CLI::Validator(is_number, ""));
    }
  }
  for (CLI::App* command : app.get_subcommands(nullptr)) RefuseNan(*command);
}

// Checks the arguments of a command. Returns them, or the message and exit code of a mistake.
template <typename CommandArguments>
ParsedArguments Checked(CommandArguments& arguments) {
  ParsedArguments parsed;
  std::string problem;
  if constexpr (requires { Check(arguments); }) problem = Check(arguments);
  if (problem.empty()) {
    parsed.arguments = arguments;
  } else {
    parsed.exit_code = kUsage;
    parsed.err = "planish: " + problem + "\n";
  }
  return parsed;
}

struct CommandLine {
  CLI::App app{"Unwraps triangle meshes by Angle Based Flattening", "planish"};
  std::function<ParsedArguments()> chosen;  // after parsing: the arguments of the command that was given, checked

  CommandLine() {
    AddHelp(app);
    app.require_subcommand(1);
    Add<UnwrapArguments>(app, "unwrap", "Flatten a mesh and write it with UV");
    Add<PackArguments>(app, "pack", "Pack the existing UV islands of a mesh again, without solving");
    Add<TransferArguments>(app, "transfer", "Redraw the images of a model for the UV of another file");
    Add<CheckArguments>(app, "check", "Check the UV of a mesh, whatever program made them");
    Add<ReportArguments>(app, "report", "Write a page that shows the UV of a mesh, of two side by side, or of many");
    Add<InspectArguments>(app, "inspect", "Say what a mesh is like and what unwrap would do with it");
    Add<EstimateArguments>(app, "estimate", "Estimate the memory and time of unwrap on a server, without doing it");
    CLI::App& jobs = *app.add_subcommand("jobs", "List, watch, stop and delete the jobs of a server");
    jobs.require_subcommand(1);
    Add<JobsListArguments>(jobs, "list", "Jobs, newest first");
    Add<JobsShowArguments>(jobs, "show", "One job with its report");
    Add<JobsWatchArguments>(jobs, "watch", "Follow a job to its end; with --mesh and -o, write its UV");
    Add<JobsStopArguments>(jobs, "stop", "End a job soon, with the best map so far");
    Add<JobsCancelArguments>(jobs, "cancel", "End a job and discard its result");
    Add<JobsDeleteArguments>(jobs, "delete", "Delete a job that has ended, and its result");
    Add<HealthArguments>(app, "health", "Ask a server by HTTP whether it is ready for jobs");
    CLI::App& admin = *app.add_subcommand("admin", "Administer a running server; needs the right \"admin\"");
    admin.require_subcommand(1);
    Add<AdminDrainArguments>(admin, "drain", "Accept no new jobs, and tell load balancers so; accepted jobs go on");
    Add<AdminUndrainArguments>(admin, "undrain", "Accept new jobs again");
    Add<AdminStatsArguments>(admin, "stats", "What the server is doing");
    Add<AdminConfigArguments>(admin, "config",
                              "Settings in effect, in the form of a configuration file, with the source of each");
    Add<VersionArguments>(app, "version", "Versions of this command and of the server");
    RefuseNan(app);
    app.footer(kExamples);  // after the commands, which would inherit it
    app.set_version_flag(
        "--version", [] { return std::string("planish ") + Version(); }, "Print the version and exit");
    AddGenerate(app, Version(), ManPage());
  }
  CommandLine(const CommandLine&) = delete;
  CommandLine& operator=(const CommandLine&) = delete;

  template <typename CommandArguments>
  void Add(CLI::App& parent, const std::string& name, const std::string& description) {
    CLI::App& command = *parent.add_subcommand(name, description);
    const auto arguments = std::make_shared<CommandArguments>();
    AddFlags(command, *arguments);
    command.parse_complete_callback([this, arguments] { chosen = [arguments] { return Checked(*arguments); }; });
  }
};

// The path of the configuration file: PLANISH_CONFIG if it is set, or else planish.toml in the user's directory for
// configurations, if the file exists. Empty: none.
std::string ConfigPath() {
  const auto variable = [](const char* name) -> std::string {
    const char* const value = std::getenv(name);
    return value == nullptr ? "" : value;
  };
  if (std::getenv("PLANISH_CONFIG") != nullptr) return variable("PLANISH_CONFIG");
  std::string directory = variable("XDG_CONFIG_HOME");
  if (directory.empty() && !variable("HOME").empty()) directory = variable("HOME") + "/.config";
  std::error_code ignored;
  const std::string path = directory + "/planish.toml";
  return !directory.empty() && std::filesystem::exists(path, ignored) ? path : "";
}

// Finds a command by its path, as in the section [jobs.list]. Null if there is no such command.
const CLI::App* FindCommand(const CLI::App& root, const std::vector<std::string>& path) {
  const CLI::App* app = &root;
  for (const std::string& name : path) {
    const std::vector<const CLI::App*> found =
        app->get_subcommands([&](const CLI::App* each) { return each->get_name() == name; });
    if (found.empty()) return nullptr;
    app = found.front();
  }
  return app;
}

// Whether `app` or a command below it has the flag.
bool AnyHas(const CLI::App& app, const std::string& flag) {
  if (app.get_option_no_throw(flag) != nullptr) return true;
  const std::vector<const CLI::App*> commands = app.get_subcommands([](const CLI::App*) { return true; });
  return std::any_of(commands.begin(), commands.end(), [&](const CLI::App* each) { return AnyHas(*each, flag); });
}

// Whether the command line, or the environment, decided on the option or on one that excludes it.
bool IsDecided(CLI::Option& option) {
  if (option.count() > 0) return true;
  if (!option.get_envname().empty() && std::getenv(option.get_envname().c_str()) != nullptr) return true;
  const std::set<CLI::Option*>& others = option.get_excludes();
  return std::any_of(others.begin(), others.end(), [](const CLI::Option* other) { return other->count() > 0; });
}

// The flags that the configuration file adds to the command line that `root` has parsed. Throws CLI::ParseError, with
// the reason, if the file is wrong.
std::vector<std::string> FlagsOfConfig(const std::string& path, CLI::App& root) {
  std::ifstream file(path);
  if (!file) throw CLI::FileError::Missing(path);
  CLI::App* chosen = &root;
  std::vector<std::string> chosen_path;
  while (!chosen->get_subcommands().empty()) {
    chosen = chosen->get_subcommands().front();
    chosen_path.push_back(chosen->get_name());
  }
  std::vector<std::string> own, common;  // the command's own section overrides entries for all commands
  for (const CLI::ConfigItem& item : CLI::ConfigTOML().from_config(file)) {
    if (item.name == "++" || item.name == "--") continue;  // a section begins or ends
    const std::string flag = "--" + item.name;
    const CLI::App* const section = FindCommand(root, item.parents);
    if (section == nullptr) throw CLI::ConfigError("there is no command " + CLI::detail::join(item.parents, " "));
    if (item.parents.empty() ? !AnyHas(root, flag) : section->get_option_no_throw(flag) == nullptr) {
      throw CLI::ConfigError("there is no flag " + flag +
                             (item.parents.empty() ? "" : " of " + CLI::detail::join(item.parents, " ")));
    }
    if (!item.parents.empty() && item.parents != chosen_path) continue;
    CLI::Option* const option = chosen->get_option_no_throw(flag);
    if (option == nullptr || IsDecided(*option)) continue;
    std::vector<std::string>& flags = item.parents.empty() ? common : own;
    for (const std::string& value : item.inputs) flags.push_back(flag + "=" + value);
  }
  const auto name = [](const std::string& flag) { return flag.substr(0, flag.find('=')); };
  for (const std::string& flag : common) {
    if (std::none_of(own.begin(), own.end(), [&](const std::string& other) { return name(other) == name(flag); })) {
      own.push_back(flag);
    }
  }
  return own;
}

// What to print, and the exit code, for a command line that is wrong or only asks for help.
ParsedArguments Ended(const CommandLine& line, const CLI::ParseError& error, int argc, const char* const* argv) {
  ParsedArguments parsed;
  std::ostringstream out, err;
  parsed.exit_code = line.app.exit(error, out, err) == 0 ? kOk : kUsage;
  parsed.out = out.str();
  parsed.err = parsed.exit_code == kOk ? "" : "planish: " + err.str() + Suggestion(line.app, argc, argv);
  return parsed;
}

}  // namespace

ParsedArguments ParseArguments(int argc, const char* const* argv) {
  auto line = std::make_unique<CommandLine>();
  try {
    line->app.parse(argc, argv);
  } catch (const CLI::ParseError& error) {
    return Ended(*line, error, argc, argv);
  }
  if (const std::string config = ConfigPath(); !config.empty()) {
    ParsedArguments parsed;
    try {
      std::vector<std::string> words(argv + 1, argv + argc);
      const std::vector<std::string> added = FlagsOfConfig(config, line->app);
      words.insert(std::find(words.begin(), words.end(), "--"), added.begin(), added.end());
      std::reverse(words.begin(), words.end());
      line = std::make_unique<CommandLine>();
      line->app.parse(std::move(words));
    } catch (const CLI::ParseError& error) {
      parsed.exit_code = kUsage;
      parsed.err = "planish: " + config + ": " + error.what() + "\n";
      return parsed;
    }
  }
  return line->chosen();
}

}  // namespace planish::cli
