#include "client/cli/arguments.h"

#include <algorithm>
#include <cmath>
#include <cstddef>
#include <cstdlib>
#include <filesystem>
#include <fstream>
#include <optional>
#include <sstream>
#include <system_error>
#include <vector>

#include "CLI/CLI.hpp"
#include "client/cli/commands.h"
#include "client/cli/flags.h"
#include "client/files/mesh_file.h"
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
Results go to standard output, what is for people to standard error.
)",
          R"(.SH ENVIRONMENT
.TP
.B PLANISH_SERVER
The server, where
.B \-\-server
does not name one.
.TP
.BR PLANISH_TLS ", " PLANISH_TLS_CA ", " PLANISH_TLS_CERT ", " PLANISH_TLS_KEY ", " PLANISH_TOKEN ", " PLANISH_TOKEN_FILE
How to reach it safely, and as whom, where flags do not say so.
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
holds flags that are added to every call which does not have them: names without dashes, for all commands that have such a flag, or
below the name of a command for that one.
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
Flags go over variables, and variables over the file.
.SH FILES
.TP
.I ~/.config/planish.toml
Settings for every call, see CONFIGURATION.
.TP
.I OUT/.planish\-batch.json
What a batch has done, by which the same command goes on where it ended.
.SH EXIT STATUS
.TP
.B 0
A usable map, or whatever else was asked for.
.TP
.B 1
The job failed, or its map is not usable (it is written all the same).
.TP
.B 2
Bad usage, or input that cannot be read.
.TP
.B 3
The server cannot be reached, or its queue is full.
.TP
.B 130
Interrupted. The first Ctrl\-C cancels the job on the server, a second one leaves at once.
.SH SEE ALSO
.BR planishd (8)
)"};
}

constexpr char kExamples[] = R"(Examples:
  planish unwrap face.obj -o face_uv.obj             unwrap a mesh; starts a server of its own
  planish unwrap face.ply -o face.obj --json         and print the report as JSON
  planish unwrap face.obj -o uv.obj --server=farm:7741
  planish unwrap props/ hero.glb -o done/            every mesh in there, a job and an output each
  planish unwrap big.obj --detach --server=farm:7741
  planish pack hero.obj -o packed.obj --padding=8    its UV islands, moved and scaled to fit
  planish check hero.glb --require=no-overlap        judges its UV, whoever made them
  planish report before.glb after.glb -o compare.html  a page that shows both maps, opened from disk
  planish inspect scan.stl                           what is wrong with it, and what unwrap would do
  planish estimate scan.stl --server=farm:7741       memory, time, and whether it would be accepted
  planish jobs watch jobs/1a2b --mesh big.obj -o big_uv.obj --server=farm:7741

Exit codes: 0 usable result, 1 job failed or result not usable, 2 bad usage or unreadable input,
3 no server or a full queue, 130 interrupted (the first Ctrl-C cancels the job, a second leaves at once).)";

// ---- What flags say together

bool IsGltf(const std::string& path) {
  const std::optional<MeshFormat> format = FormatOfPath(path);
  return format == MeshFormat::kGltf || format == MeshFormat::kGlb;
}

// Options without effect beside each other.
std::string CheckAtlas(const UnwrapOptions& options) {
  if (options.max_stretch != 0 && options.seams != Seams::kAuto) {
    return std::string("--max-stretch is what --seams=auto cuts by; with the policy ") + ToString(options.seams) +
           " no seam is added for stretch (name auto beside the sources, as in --seams=auto,uv)";
  }
  if (options.prefer != Prefer::kSeams && options.seams != Seams::kAuto) {
    return std::string("--prefer is what --seams=auto cuts for; with the policy ") + ToString(options.seams) +
           " it has no effect (name auto beside the sources, as in --seams=auto,uv)";
  }
  if (!options.pack &&
      (options.texture_size != 0 || options.padding || options.tiles != 0 || options.effort != Effort::kNormal)) {
    return "--pack=off leaves charts as they are, so --texture-size, --padding, --tiles and --effort have no effect";
  }
  return "";
}

// What several atlases, or weights, do not go with.
std::string CheckParts(const Arguments& arguments) {
  const UnwrapOptions& options = arguments.options;
  const bool is_stacked = options.atlas_layout == AtlasLayout::kStacked;
  if (is_stacked && !arguments.atlas_per) return "--atlas-layout says where the atlases of --atlas-per go; give both";
  if (is_stacked && !arguments.report.empty()) {
    return "--report shows one texture, and --atlas-layout=stacked makes several that lie one over the other; leave "
           "one "
           "of them out";
  }
  if (!arguments.atlas_per && arguments.material_weights.empty()) return "";
  const std::string flag = arguments.atlas_per ? "--atlas-per" : "--weight";
  if (!options.pack) return flag + " is about charts in an atlas; with --pack=off there is none";
  if (options.seams == Seams::kNone)
    return flag + " needs charts; with --seams=none the mesh is one that fills its tile";
  return "";
}

// "For example: planish unwrap in.stl -o in_uv.obj (or -o - for stdout)"
std::string OutputExample(const std::string& command, const std::string& input) {
  if (input == "-") return "For example: planish " + command + " - -o out.obj (or -o - for stdout)";
  const std::size_t dot = std::min(input.rfind('.'), input.size());
  const std::string extension = input.substr(dot);
  return "For example: planish " + command + " " + input + " -o " + input.substr(0, dot) + "_uv" +
         (extension == ".stl" || extension.empty() ? ".obj" : extension) + " (or -o - for stdout)";
}

bool IsDirectory(const std::string& path) {
  std::error_code ignored;
  return std::filesystem::is_directory(path, ignored);
}

// The names of all input files and directories.
std::vector<std::string> Inputs(const Arguments& arguments) {
  std::vector<std::string> inputs = {arguments.input};
  inputs.insert(inputs.end(), arguments.more_inputs.begin(), arguments.more_inputs.end());
  return inputs;
}

// What a batch cannot do; empty if all is well.
std::string CheckBatch(const Arguments& arguments) {
  if (arguments.output.empty()) return "where should the results go? A batch needs -o DIRECTORY/";
  if (arguments.output == "-") return "-o - takes one mesh; a batch needs -o DIRECTORY/";
  for (const std::string& input : Inputs(arguments)) {
    if (input == "-") return "- (standard input) is one mesh, and cannot be one of a batch";
  }
  if (!arguments.picture.empty() || !arguments.preview.empty()) {
    return "--picture and --preview draw one mesh; of a batch --report=DIR shows all";
  }
  if (!arguments.report.empty() && arguments.detach) {
    return "--detach does not wait for UV, so there is nothing to draw; --report goes with the run that fetches them";
  }
  if (!arguments.seams.edge_files.empty() || !arguments.seams.uncut_files.empty()) {
    return "--seams=edges:FILE and uncut:FILE list the vertices of one mesh; a batch cannot use them";
  }
  return "";
}

// What has to do with several files.
std::string CheckInputs(Arguments& arguments) {
  const std::vector<std::string> inputs = Inputs(arguments);
  const auto directory = std::find_if(inputs.begin(), inputs.end(), IsDirectory);
  const bool per_file = arguments.atlas_per == AtlasPer::kFile;
  if (arguments.one_atlas || per_file) {
    const std::string flag = per_file ? "--atlas-per=file" : "--one-atlas";
    if (directory != inputs.end()) return flag + " takes files; " + *directory + " is a directory";
    if (inputs.size() > 1 && arguments.output.empty() && !arguments.detach) {
      return "where should the results go? Several files need -o DIRECTORY/";
    }
  }
  arguments.batch = !arguments.one_atlas && !per_file && (inputs.size() > 1 || directory != inputs.end());
  if (arguments.batch) return CheckBatch(arguments);
  if (!arguments.format.empty()) return "--format is for batches; the name after -o says the format of one file";
  if (arguments.again) return "--again is for batches; one file is always done again";
  return "";
}

// Whether `report` makes a page of each file, and a sheet.
bool IsSheet(const Arguments& arguments) {
  const std::vector<std::string> inputs = Inputs(arguments);
  return inputs.size() > 2 || IsDirectory(arguments.output) || arguments.output.ends_with('/') ||
         std::any_of(inputs.begin(), inputs.end(), IsDirectory);
}

// What a sheet cannot be made of; empty if all is well.
std::string CheckSheet(const Arguments& arguments) {
  if (arguments.output == "-") return "-o - takes one page; those of many files need -o DIRECTORY/";
  if (!arguments.job_report.empty()) return "--job-report is about one file, and -o about many";
  const std::vector<std::string> inputs = Inputs(arguments);
  if (std::count(inputs.begin(), inputs.end(), "-") > 0) {
    return "- (standard input) is one mesh, and cannot be one of many";
  }
  return "";
}

// Decides what depends on several flags and on whether inputs are directories (`batch`), completes the job's name, and
// returns what is wrong, in words; empty if nothing.
std::string CheckTogether(Arguments& arguments) {
  if (arguments.command == Command::kUnwrap) {
    if (const std::string problem = CheckInputs(arguments); !problem.empty()) return problem;
  }
  if (arguments.command == Command::kReport) arguments.sheet = IsSheet(arguments);
  const std::vector<std::string> inputs = Inputs(arguments);
  const auto streams = std::count(inputs.begin(), inputs.end(), "-");
  if (streams > 1 || (streams == 1 && arguments.check.all_texcoords)) {
    return std::string("- (standard input) can be read once only") +
           (streams == 1 ? "; --texcoord=all reads a file once for each set of UV" : "");
  }
  const bool judges_several = arguments.command == Command::kCheck && !arguments.more_inputs.empty();
  if (arguments.texcoord > 0 && !judges_several && arguments.command != Command::kTransfer && !arguments.batch &&
      !arguments.sheet && !arguments.input.empty() && !IsStream(arguments.input) && !IsGltf(arguments.input)) {
    return "--texcoord=" + std::to_string(arguments.texcoord) + ": " + arguments.input +
           " is no glTF; other formats have one set of UV, number 0";
  }
  if (!arguments.preview.empty() && !arguments.preview.ends_with(".png") && !arguments.preview.ends_with(".svg")) {
    return "--preview=" + arguments.preview + ": the name must end in .png or .svg";
  }
  if (!arguments.job.empty() && arguments.job.rfind("jobs/", 0) != 0) arguments.job = "jobs/" + arguments.job;
  const bool to_stdout = arguments.output == "-";
  if (to_stdout && arguments.json) {
    return "-o - and --json both want stdout; write the mesh to a file, or leave --json out";
  }
  switch (arguments.command) {
    case Command::kUnwrap:
      if (const std::string problem = CheckAtlas(arguments.options); !problem.empty()) return problem;
      if (const std::string problem = CheckParts(arguments); !problem.empty()) return problem;
      if (arguments.detach && arguments.server.empty()) {
        return "--detach needs --server (or PLANISH_SERVER): a private server ends with this command, and the job "
               "with it";
      }
      if (arguments.batch) return "";
      if (arguments.detach && !arguments.more_inputs.empty()) {
        return "--detach takes one file where several are one job (--one-atlas, --atlas-per=file): jobs watch could "
               "not write "
               "the UV of several";
      }
      if (arguments.detach && !(arguments.preview.empty() && arguments.picture.empty() && arguments.report.empty())) {
        return "--detach does not wait for UV, so there is nothing to draw; jobs watch JOB --mesh IN -o OUT takes "
               "--preview too";
      }
      if (arguments.detach && !arguments.output.empty()) {
        return "--detach does not wait for UV, so there is nothing for -o; fetch them later with: planish jobs watch "
               "JOB --mesh " +
               arguments.input + " -o " + arguments.output;
      }
      if (!arguments.detach && arguments.output.empty()) {
        return "where should the result go? " + OutputExample("unwrap", arguments.input);
      }
      return "";
    case Command::kPack: {
      if (arguments.output.empty()) return "where should the result go? " + OutputExample("pack", arguments.input);
      const int size = arguments.options.texture_size != 0 ? arguments.options.texture_size : 1024;
      const int padding = arguments.options.padding.value_or(2);
      if (2 * ((padding + 1) / 2) >= size) {
        return "--padding=" + std::to_string(padding) + " leaves no room in a tile of " + std::to_string(size) +
               " texels";
      }
      return "";
    }
    case Command::kTransfer:
      if (arguments.output.empty()) return "where should the result go? " + OutputExample("transfer", arguments.input);
      return "";
    case Command::kEstimate:
      if (arguments.input.empty() == (arguments.triangles == 0)) {
        return "estimate what? Give a mesh file, or --triangles=N";
      }
      return "";
    case Command::kHealth:
      if (!arguments.health_url.starts_with("http://") || arguments.health_url.find('/', 7) == std::string::npos) {
        return "health asks an URL such as http://127.0.0.1:9741/readyz, not " + arguments.health_url;
      }
      return "";
    case Command::kAdminDrain:
    case Command::kAdminUndrain:
    case Command::kAdminStats:
    case Command::kAdminConfig:
      return arguments.server.empty() ? "admin is about a server: give --server=ADDR or set PLANISH_SERVER" : "";
    case Command::kReport:
      if (arguments.output.empty())
        return "where should the page go? planish report " + arguments.input + " -o report.html";
      return arguments.sheet ? CheckSheet(arguments) : "";
    case Command::kCheck:
    case Command::kInspect:
    case Command::kVersion:
      return "";
    case Command::kJobsWatch:
      if (arguments.input.empty() != arguments.output.empty()) {
        return "--mesh and -o go together: the UV go into a copy of the file that was sent";
      }
      if (!arguments.preview.empty() && arguments.input.empty()) {
        return "--preview draws the UV on the file that was sent: name it with --mesh, and -o for the result";
      }
      [[fallthrough]];
    default:
      if (arguments.server.empty()) return "jobs live on a server: give --server=ADDR or set PLANISH_SERVER";
      return "";
  }
}

// ---- Suggestions

// Letters to add, take away, replace or swap with the next one, to make `b` of `a`.
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

// The name that `word` was probably meant to be: at most a third of its letters are wrong. Empty: none.
std::string Nearest(const std::string& word, const std::vector<std::string>& names) {
  std::string nearest;
  std::size_t least = word.size() / 3 + 1;
  for (const std::string& name : names) {
    if (const std::size_t distance = EditDistance(word, name); distance < least) least = distance, nearest = name;
  }
  return nearest;
}

// "Did you mean unwrap?" for the first command or flag that there is not; empty if nothing is like it.
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

// To CLI11 "nan" is a number within every range.
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

struct CommandLine {
  Arguments arguments;
  CLI::App app{"Unwraps triangle meshes by Angle Based Flattening", "planish"};

  CommandLine() {
    AddHelp(app);
    app.require_subcommand(1);
    DefineUnwrap(app, arguments);
    DefineMapCommands(app, arguments);
    DefineServerCommands(app, arguments);
    RefuseNan(app);
    app.footer(kExamples);  // now, or every command would have it
    app.set_version_flag(
        "--version", [] { return std::string("planish ") + Version(); }, "Print the version and exit");
    AddGenerate(app, Version(), ManPage());
  }
  CommandLine(const CommandLine&) = delete;
  CommandLine& operator=(const CommandLine&) = delete;
};

// The file that PLANISH_CONFIG names, or planish.toml in the user's directory for configurations; empty: none.
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

// "jobs.list" in [jobs.list] or before a dot: the path of a command. Null: there is none of that name.
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

// The flags that the file adds to a command line that was parsed. Throws CLI::ParseError, with the reason.
std::vector<std::string> FlagsOfConfig(const std::string& path, CLI::App& root) {
  std::ifstream file(path);
  if (!file) throw CLI::FileError::Missing(path);
  CLI::App* chosen = &root;
  std::vector<std::string> chosen_path;
  while (!chosen->get_subcommands().empty()) {
    chosen = chosen->get_subcommands().front();
    chosen_path.push_back(chosen->get_name());
  }
  std::vector<std::string> own, common;  // the command's own section goes over what is said for all
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

// What to print and to exit with for a command line that is over, or wrong.
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
  ParsedArguments parsed;
  if (const std::string problem = CheckTogether(line->arguments); !problem.empty()) {
    parsed.exit_code = kUsage;
    parsed.err = "planish: " + problem + "\n";
    return parsed;
  }
  parsed.arguments = line->arguments;
  if (parsed.arguments->quiet && parsed.arguments->progress == ProgressMode::kAuto) {
    parsed.arguments->progress = ProgressMode::kNone;
  }
  return parsed;
}

}  // namespace planish::cli
