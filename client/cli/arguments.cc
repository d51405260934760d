#include "client/cli/arguments.h"

#include <sstream>
#include <string_view>
#include <tuple>
#include <utility>
#include <vector>

#include "CLI/CLI.hpp"
#include "client/cli/exit_codes.h"
#include "planish/client.h"

namespace planish::cli {
namespace {

constexpr char kExamples[] = R"(Examples:
  planish unwrap face.obj -o face_uv.obj             flatten a disc; starts a server of its own
  planish unwrap face.ply -o face.obj --json         and print the report as JSON
  planish unwrap face.obj -o uv.obj --server=farm:7741
  planish unwrap big.obj --detach --server=farm:7741
  planish jobs watch jobs/1a2b --mesh big.obj -o big_uv.obj --server=farm:7741

Exit codes: 0 usable result, 1 job failed or result not usable, 2 bad usage or unreadable input,
3 server unreachable, 130 interrupted (the first Ctrl-C cancels the job, a second leaves at once).)";

constexpr char kUnwrapExamples[] = R"(Examples:
  planish unwrap face.obj -o face_uv.obj
  planish unwrap scan.stl -o scan.obj --precision=double --json > report.json
  planish unwrap face.obj -o - > face_uv.obj
  planish unwrap face.obj -o face_uv.obj --picture=map.png
  planish unwrap face.obj -o uv.obj --solver=uzawa --system=full --preconditioner=none   (the paper as written)

The first of several choices is the default. An OBJ comes back byte for byte except for its vt and f lines.)";

const char* ToString(ProgressMode mode) {
  switch (mode) {
    case ProgressMode::kAuto:
      return "auto";
    case ProgressMode::kBar:
      return "bar";
    case ProgressMode::kPlain:
      return "plain";
    case ProgressMode::kJson:
      return "json";
    case ProgressMode::kNone:
      return "none";
  }
  return "";
}

// Values of an enum by their names, for options that choose one.
template <typename Enum>
struct Choices {
  std::vector<Enum> values;

  std::vector<std::string> Names() const {
    std::vector<std::string> names;
    for (const Enum value : values) names.emplace_back(ToString(value));
    return names;
  }

  // Adds an option whose text is checked, and sets `target` when it is given.
  void AddTo(CLI::App& app, const std::string& flag, Enum& target, const std::string& description) const {
    app.add_option_function<std::string>(
           flag,
           [*this, &target](const std::string& name) {
             for (const Enum value : values) {
               if (name == ToString(value)) target = value;
             }
           },
           description)
        ->check(CLI::IsMember(Names()).description(""))
        ->type_name(CLI::detail::join(Names(), "|"));
  }
};

void AddServer(CLI::App& app, Arguments& arguments, const std::string& otherwise) {
  app.add_option("--server", arguments.server, "host:port or unix:/path; " + otherwise)
      ->envname("PLANISH_SERVER")
      ->type_name("ADDR");
}

void AddJson(CLI::App& app, Arguments& arguments) {
  app.add_flag("--json", arguments.json, "Print one JSON object on stdout");
}

void AddProgress(CLI::App& app, Arguments& arguments) {
  Choices<ProgressMode>{
      {ProgressMode::kAuto, ProgressMode::kBar, ProgressMode::kPlain, ProgressMode::kJson, ProgressMode::kNone}}
      .AddTo(app, "--progress", arguments.progress,
             "What stderr shows of a running job; auto: a bar on a terminal, else nothing");
}

void AddOutput(CLI::App& app, Arguments& arguments) {
  app.add_option("-o,--output", arguments.output,
                 "Where the mesh with UV goes, in the format of the name: .obj, .ply, .off, .gltf, .glb or .drc; - is "
                 "stdout; a directory keeps the name, and takes several files")
      ->type_name("OUT");
  app.add_option("--texcoord", arguments.texcoord, "glTF: the UV become TEXCOORD_N [0]")
      ->check(CLI::Range(0, 7).description(""))
      ->type_name("N");
}

void AddPicture(CLI::App& app, Arguments& arguments) {
  app.add_option("--picture", arguments.picture, "Draw the map: the surface with a checkerboard, and the chart")
      ->type_name("PNG");
  app.add_option_function<std::pair<double, double>>(
         "--view",
         [&arguments](const std::pair<double, double>& view) {
           std::tie(arguments.view_azimuth, arguments.view_elevation) = view;
         },
         "Where the picture looks from: round y, and up, in degrees [35 17]")
      ->type_name("AZIMUTH ELEVATION");
}

void AddTimeout(CLI::App& app, Arguments& arguments, const std::string& description) {
  app.add_option("--timeout", arguments.timeout_seconds, description)
      ->check(CLI::Validator(CLI::PositiveNumber).description(""))
      ->type_name("SECONDS");
}

void DefineUnwrap(CLI::App& app, Arguments& arguments) {
  CLI::App& unwrap = *app.add_subcommand("unwrap", "Flatten a mesh and write it with UV");
  unwrap.parse_complete_callback([&arguments] { arguments.command = Command::kUnwrap; });
  unwrap.footer(kUnwrapExamples);
  unwrap.add_option("IN", arguments.input, "Mesh file: .obj, .ply, .off, .stl, .gltf, .glb or .drc")
      ->required()
      ->type_name("");
  unwrap.add_option("MORE", arguments.more_inputs, "Further files, into the same atlas; OUT is a directory then")
      ->type_name("");
  AddOutput(unwrap, arguments);
  AddPicture(unwrap, arguments);
  AddServer(unwrap, arguments, "without it a private server is started");
  AddJson(unwrap, arguments);
  AddProgress(unwrap, arguments);
  AddTimeout(unwrap, arguments, "Give up, and cancel the job, after so long");
  unwrap.add_flag("--detach", arguments.detach, "Queue the job, print its name and leave; see jobs watch");
  unwrap.add_option("--label", arguments.label, "Name for people in jobs list [the file's name]")->type_name("TEXT");

  UnwrapOptions& options = arguments.options;
  Choices<Seams>{{Seams::kNone}}.AddTo(unwrap, "--seams", options.seams, "Where to cut; none: the mesh must be a disc");
  Choices<Solver>{{Solver::kAuto, Solver::kUzawa, Solver::kMinres, Solver::kDirect}}.AddTo(
      unwrap, "--solver", options.solver, "Linear solver of a Newton step");
  Choices<System>{{System::kAuto, System::kFull, System::kReduced}}.AddTo(unwrap, "--system", options.system,
                                                                          "System it works on; full: the paper's M");
  Choices<Preconditioner>{{Preconditioner::kAuto, Preconditioner::kNone, Preconditioner::kJacobi,
                           Preconditioner::kCholesky, Preconditioner::kAmg}}
      .AddTo(unwrap, "--preconditioner", options.preconditioner, "Preconditioner of uzawa and minres");
  Choices<Hessian>{{Hessian::kAuto, Hessian::kConvex, Hessian::kExact}}.AddTo(
      unwrap, "--hessian", options.hessian,
      "Where it is not positive; exact: as it is, by minres; auto: near the solution");
  Choices<Boundary>{{Boundary::kFree, Boundary::kConvex}}.AddTo(
      unwrap, "--boundary", options.boundary, "Outline of the map; convex: a convex polygon, which never overlaps");
  Choices<Precision>{{Precision::kAuto, Precision::kFloat, Precision::kDouble}}.AddTo(
      unwrap, "--precision", options.precision, "Type of the UV; auto: float where it keeps the map");
  unwrap.add_option("--tolerance", options.tolerance, "Residual per angle at which Newton stops, up to 1e-2 [1e-9]")
      ->check(CLI::Range(1e-300, 1e-2).description(""))
      ->type_name("RAD");
  unwrap
      .add_option("--max-newton-iterations", options.max_newton_iterations,
                  "Newton iterations at most, up to 1000 [100]")
      ->check(CLI::Range(1, 1000).description(""))
      ->type_name("N");
  unwrap
      .add_option("--threads", options.threads,
                  "Threads to use, within the server's limit [that limit; all cores without --server]")
      ->check(CLI::Range(1, 256).description(""))
      ->type_name("N");
}

CLI::App& AddJobCommand(CLI::App& jobs, Arguments& arguments, Command command, const std::string& name,
                        const std::string& description) {
  CLI::App& app = *jobs.add_subcommand(name, description);
  app.parse_complete_callback([&arguments, command] { arguments.command = command; });
  if (command != Command::kJobsList) {
    app.add_option("JOB", arguments.job, "Name of the job: jobs/... (jobs/ may be left out)")
        ->required()
        ->type_name("");
  }
  AddServer(app, arguments, "required here");
  if (command != Command::kJobsDelete) AddJson(app, arguments);
  return app;
}

void DefineJobs(CLI::App& app, Arguments& arguments) {
  CLI::App& jobs = *app.add_subcommand("jobs", "Look after the jobs of a server");
  jobs.require_subcommand(1);
  CLI::App& list = AddJobCommand(jobs, arguments, Command::kJobsList, "list", "Jobs, newest first");
  list.add_option("--limit", arguments.limit, "At most so many; 0: all [50]")
      ->check(CLI::Validator(CLI::NonNegativeNumber).description(""))
      ->type_name("N");
  const Choices<JobState> states{{JobState::kQueued, JobState::kRunning, JobState::kStopping, JobState::kSucceeded,
                                  JobState::kFailed, JobState::kCancelled}};
  list.add_option_function<std::string>(
          "--state",
          [&arguments, states](const std::string& name) {
            for (const JobState state : states.values) {
              if (name == ToString(state)) arguments.state = state;
            }
          },
          "QUEUED, RUNNING, STOPPING, SUCCEEDED, FAILED or CANCELLED only")
      ->check(CLI::IsMember(states.Names()).description(""))
      ->type_name("STATE");
  AddJobCommand(jobs, arguments, Command::kJobsShow, "show", "One job with its report");
  CLI::App& watch = AddJobCommand(jobs, arguments, Command::kJobsWatch, "watch",
                                  "Follow a job to its end; with --mesh and -o, write its UV");
  AddProgress(watch, arguments);
  watch.add_option("--mesh", arguments.input, "The file that was sent; the UV go into a copy of it")->type_name("IN");
  AddOutput(watch, arguments);
  AddTimeout(watch, arguments, "Stop watching after so long; the job goes on");
  AddJobCommand(jobs, arguments, Command::kJobsCancel, "cancel", "End a job and discard what it has");
  AddJobCommand(jobs, arguments, Command::kJobsDelete, "delete", "Forget a job that ended");
}

// What CLI11 cannot check by itself; empty if all is well.
std::string CheckTogether(Arguments& arguments) {
  if (!arguments.job.empty() && arguments.job.rfind("jobs/", 0) != 0) arguments.job = "jobs/" + arguments.job;
  const bool to_stdout = arguments.output == "-";
  if (to_stdout && arguments.json) {
    return "-o - and --json both want stdout; write the mesh to a file, or leave --json out";
  }
  switch (arguments.command) {
    case Command::kUnwrap:
      if (arguments.detach && arguments.server.empty()) {
        return "--detach needs --server (or PLANISH_SERVER): a private server ends with this command, and the job "
               "with it";
      }
      if (arguments.detach && !arguments.more_inputs.empty()) {
        return "--detach takes one file: jobs watch could not write the UV of several";
      }
      if (arguments.detach && !arguments.output.empty()) {
        return "--detach does not wait for UV, so there is nothing for -o; fetch them later with: planish jobs watch "
               "JOB --mesh " +
               arguments.input + " -o " + arguments.output;
      }
      if (!arguments.detach && arguments.output.empty()) {
        if (!arguments.more_inputs.empty()) return "where should the results go? Several files need -o DIRECTORY/";
        const std::size_t dot = std::min(arguments.input.rfind('.'), arguments.input.size());
        const std::string extension = arguments.input.substr(dot);
        return "where should the result go? For example: planish unwrap " + arguments.input + " -o " +
               arguments.input.substr(0, dot) + "_uv" + (extension == ".stl" || extension == "" ? ".obj" : extension) +
               " (or -o - for stdout)";
      }
      return "";
    case Command::kVersion:
      return "";
    case Command::kJobsWatch:
      if (arguments.input.empty() != arguments.output.empty()) {
        return "--mesh and -o go together: the UV go into a copy of the file that was sent";
      }
      [[fallthrough]];
    default:
      if (arguments.server.empty()) return "jobs live on a server: give --server=ADDR or set PLANISH_SERVER";
      return "";
  }
}

}  // namespace

ParsedArguments ParseArguments(int argc, const char* const* argv) {
  Arguments arguments;
  CLI::App app("planish flattens triangle meshes by Angle Based Flattening.", "planish");
  app.footer(kExamples);
  app.require_subcommand(1);
  app.get_formatter()->column_width(44);
  DefineUnwrap(app, arguments);
  DefineJobs(app, arguments);
  CLI::App& version = *app.add_subcommand("version", "Versions of this command and of the server");
  version.parse_complete_callback([&arguments] { arguments.command = Command::kVersion; });
  AddServer(version, arguments, "without it the private one");
  AddJson(version, arguments);
  app.set_version_flag("--version", [] { return std::string("planish ") + Version(); });

  ParsedArguments parsed;
  try {
    app.parse(argc, argv);
  } catch (const CLI::ParseError& error) {
    std::ostringstream out, err;
    parsed.exit_code = app.exit(error, out, err) == 0 ? kOk : kUsage;
    parsed.out = out.str();
    parsed.err = parsed.exit_code == kOk ? "" : "planish: " + err.str();
    return parsed;
  }
  if (const std::string problem = CheckTogether(arguments); !problem.empty()) {
    parsed.exit_code = kUsage;
    parsed.err = "planish: " + problem + "\n";
    return parsed;
  }
  parsed.arguments = arguments;
  return parsed;
}

}  // namespace planish::cli
