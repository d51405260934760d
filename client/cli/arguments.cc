#include "client/cli/arguments.h"

#include <algorithm>
#include <charconv>
#include <cstddef>
#include <sstream>
#include <system_error>
#include <tuple>
#include <utility>
#include <vector>

#include "CLI/CLI.hpp"
#include "client/cli/arguments_check.h"
#include "client/cli/exit_codes.h"
#include "client/cli/report_flags.h"
#include "client/cli/scheduling_flags.h"
#include "planish/client.h"

namespace planish::cli {
namespace {

constexpr char kExamples[] = R"(Examples:
  planish unwrap face.obj -o face_uv.obj             unwrap a mesh; starts a server of its own
  planish unwrap face.ply -o face.obj --json         and print the report as JSON
  planish unwrap face.obj -o uv.obj --server=farm:7741
  planish unwrap props/ hero.glb -o done/            every mesh in there, a job and an output each
  planish unwrap big.obj --detach --server=farm:7741
  planish pack hero.obj -o packed.obj --padding=8    its UV islands, moved and scaled to fill the texture
  planish check hero.glb --require=no-overlap        judges its UV, whoever made them
  planish report before.glb after.glb -o compare.html  a page that shows both maps, opened from disk
  planish inspect scan.stl                           what is wrong with it, and what unwrap would do
  planish estimate scan.stl --server=farm:7741       memory, time, and whether it would be accepted
  planish jobs watch jobs/1a2b --mesh big.obj -o big_uv.obj --server=farm:7741

Exit codes: 0 usable result, 1 job failed or result not usable, 2 bad usage or unreadable input,
3 no server or a full queue, 130 interrupted (the first Ctrl-C cancels the job, a second leaves at once).)";

constexpr char kUnwrapExamples[] = R"(Examples:
  planish unwrap face.obj -o face_uv.obj
  planish unwrap scan.stl -o scan.obj --precision=double --json > report.json
  planish unwrap face.obj -o - > face_uv.obj
  planish unwrap prop.obj -o prop_uv.obj --seams=auto,hard:60,materials --texture-size=2048 --padding=4
  planish unwrap hero.obj -o hero_uv.obj --seams=keep,uv       (the borders of its UV islands, and no others)
  planish unwrap face.obj -o face_uv.obj --picture=map.png --preview=layout.svg
  planish unwrap face.obj -o uv.obj --solver=uzawa --system=full --preconditioner=none   (the paper as written)
  planish unwrap level.glb -o lit.glb --preset=lightmap        a second set of UV; the first one and its images stay
  planish unwrap a.obj b.glb props/ -o done/                   a batch: a job and an output per file
  planish unwrap a.obj b.glb -o done/ --one-atlas              one job: both in one atlas

Batches: several files, or a directory, which is searched for mesh files, become one job and one file in the directory
OUT each, of the same name (and the same place below the directory that was named). One that fails hurts no other. The
same command goes on where the last one ended: OUT/.planish-batch.json holds what was made of which bytes with which
options. With --json there is one line per file, and a last one {"summary": ...}. --timeout is for each file.

Seams: --seams takes a comma-separated list of at most one policy and any number of sources.
  auto         the given seams, and as many more as keep every chart's stretch below --max-stretch
  needed       the given seams, and more only where a piece is no disc or no map keeps its borders; what sources
               without a policy mean
  keep         the given seams and no others: a piece that is no disc is refused
  none         no cut: the mesh must be a disc
  uv           borders of the UV islands that the file has
  materials    between faces of different materials
  groups       between faces of different objects or groups
  hard[:DEG]   edges whose faces' normals are further apart than DEG degrees [66]
  edges:FILE   two vertex numbers per line, as the mesh file counts them (an OBJ from 1, others from 0)
  uncut:FILE   no source: edges, listed likewise, at which no seam is added

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

void AddLabels(CLI::App& app, Arguments& arguments, const std::string& description) {
  app.add_option_function<std::vector<std::string>>(
         "--label",
         [&arguments](const std::vector<std::string>& texts) {
           for (const std::string& text : texts) {
             const std::size_t equals = text.find('=');
             if (equals == std::string::npos || equals == 0) {
               throw CLI::ValidationError("--label", text + " is not of the form KEY=VALUE");
             }
             arguments.labels[text.substr(0, equals)] = text.substr(equals + 1);
           }
         },
         description)
      ->type_name("KEY=VALUE")
      ->allow_extra_args(false);
}

void AddServer(CLI::App& app, Arguments& arguments, const std::string& otherwise) {
  app.add_option("--server", arguments.server, "host:port or unix:/path; " + otherwise)
      ->envname("PLANISH_SERVER")
      ->type_name("ADDR");
  AddServerFlags(app, arguments.server_flags);
}

void AddJson(CLI::App& app, Arguments& arguments) {
  app.add_flag("--json", arguments.json, "Print one JSON object on stdout");
}

void AddProgress(CLI::App& app, Arguments& arguments) {
  Choices<ProgressMode>{
      {ProgressMode::kAuto, ProgressMode::kBar, ProgressMode::kPlain, ProgressMode::kJson, ProgressMode::kNone}}
      .AddTo(
          app, "--progress", arguments.progress,
          "What stderr shows of a running job; auto: a bar on a terminal, else nothing (of a batch a line per file)");
}

void AddOutput(CLI::App& app, Arguments& arguments) {
  app.add_option("-o,--output", arguments.output,
                 "Where the mesh with UV goes, in the format of the name: .obj, .ply, .off, .gltf, .glb or .drc; - is "
                 "stdout; a directory keeps the name, and takes a batch")
      ->type_name("OUT");
}

void AddBatch(CLI::App& app, Arguments& arguments) {
  app.add_flag("--one-atlas", arguments.one_atlas, "Several files are one job and share one atlas: no batch");
  app.add_option("--format", arguments.format, "Of the outputs of a batch [that of each input; STL becomes OBJ]")
      ->check(CLI::IsMember({"obj", "ply", "off", "gltf", "glb", "drc"}).description(""))
      ->type_name("obj|ply|off|gltf|glb|drc");
  app.add_flag("--again", arguments.again, "Redo files of a batch that are up to date");
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

void AddPreview(CLI::App& app, Arguments& arguments) {
  app.add_option(
         "--preview", arguments.preview,
         "Draw the UV layout: charts, outlines, and in colours how much triangles grew or shrank; the name ends "
         "in .png or .svg")
      ->type_name("PNG|SVG");
}

void AddReport(CLI::App& app, Arguments& arguments) {
  app.add_option("--report", arguments.report,
                 "Write a page that shows the map: surface, layout, charts, warnings, how it was solved; see report")
      ->type_name("HTML");
}

void AddTimeout(CLI::App& app, Arguments& arguments, const std::string& description) {
  app.add_option("--timeout", arguments.timeout_seconds, description)
      ->check(CLI::Validator(CLI::PositiveNumber).description(""))
      ->type_name("SECONDS");
}

void AddSeams(CLI::App& app, Arguments& arguments) {
  app.add_option_function<std::string>(
         "--seams",
         [&arguments](const std::string& text) {
           if (const std::string problem = ParseSeamList(text, &arguments.seams); !problem.empty()) {
             throw CLI::ValidationError("--seams", problem);
           }
           arguments.options.seams = arguments.seams.policy;
           arguments.options.hard_edge_degrees = arguments.seams.hard_edge_degrees;
         },
         "Where to cut: a policy and sources of given seams, see below [auto]")
      ->type_name("LIST");
  app.add_option("--max-stretch", arguments.options.max_stretch,
                 "Root mean square stretch above which auto cuts a chart, 1.001 to 100 [1.05]")
      ->check(CLI::Range(1.001, 100.0).description(""))
      ->type_name("X");
}

void AddTexcoord(CLI::App& app, Arguments& arguments) {
  app.add_option("--texcoord", arguments.texcoord, "Which set of UV of a glTF is read, TEXCOORD_N, up to 7 [0]")
      ->check(CLI::Range(0, 7).description(""))
      ->type_name("N");
}

void AddOutputTexcoord(CLI::App& app, Arguments& arguments) {
  app.add_option_function<int>(
         "--output-texcoord", [&arguments](const int& n) { arguments.output_texcoord = n; },
         "Which set the new UV become; others stay as they are [that of --texcoord]")
      ->check(CLI::Range(0, 7).description(""))
      ->type_name("N");
}

// Flags that are given count more than those of a preset.
void AddPreset(CLI::App& app, Arguments& arguments) {
  CLI::Option* const preset = app.add_option("--preset", "lightmap: --output-texcoord=1 --seams=auto,uv --padding=4")
                                  ->check(CLI::IsMember({"lightmap"}).description(""))
                                  ->type_name("lightmap");
  app.final_callback([&app, &arguments, preset] {
    if (preset->count() == 0) return;
    if (!arguments.output_texcoord) arguments.output_texcoord = 1;
    if (!arguments.options.padding) arguments.options.padding = 4;
    if (app.get_option("--seams")->count() == 0) {
      ParseSeamList("auto,uv", &arguments.seams);
      arguments.options.seams = arguments.seams.policy;
    }
  });
}

void AddAtlas(CLI::App& app, Arguments& arguments) {
  UnwrapOptions& options = arguments.options;
  app.add_option("--texture-size", options.texture_size, "Texels per side of a tile, 16 to 65536 [1024]")
      ->check(CLI::Range(16, 65536).description(""))
      ->type_name("N");
  app.add_option_function<int>(
         "--padding", [&options](const int& texels) { options.padding = texels; },
         "Texels that stay free between charts, half as many at the rim, up to 64 [2]")
      ->check(CLI::Range(0, 64).description(""))
      ->type_name("N");
  Choices<Effort>{{Effort::kNormal, Effort::kFast, Effort::kBest}}.AddTo(
      app, "--effort", options.effort,
      "What packing may cost: fast, a quarter of the rest; normal, half of it; best, fifty times the rest");
  app.add_option("--tiles", options.tiles, "Tiles (UDIM 1001, 1002, ...) that may be used, up to 100 [1]")
      ->check(CLI::Range(1, 100).description(""))
      ->type_name("N");
}

void AddPack(CLI::App& app, Arguments& arguments) {
  UnwrapOptions& options = arguments.options;
  app.add_option_function<std::string>(
         "--pack", [&options](const std::string& word) { options.pack = word == "on"; },
         "Move charts into the tiles; off: leave them as solved, at the surface's scale, one over the other")
      ->check(CLI::IsMember({"on", "off"}).description(""))
      ->type_name("on|off");
}

void DefineUnwrap(CLI::App& app, Arguments& arguments) {
  CLI::App& unwrap = *app.add_subcommand("unwrap", "Flatten a mesh and write it with UV");
  unwrap.parse_complete_callback([&arguments] { arguments.command = Command::kUnwrap; });
  unwrap.footer(kUnwrapExamples);
  unwrap.add_option("IN", arguments.input, "Mesh file: .obj, .ply, .off, .stl, .gltf, .glb or .drc; or a directory")
      ->required()
      ->type_name("");
  unwrap.add_option("MORE", arguments.more_inputs, "Further files and directories: a batch; OUT is a directory then")
      ->type_name("");
  AddOutput(unwrap, arguments);
  AddBatch(unwrap, arguments);
  AddPicture(unwrap, arguments);
  AddPreview(unwrap, arguments);
  AddReport(unwrap, arguments);
  AddServer(unwrap, arguments, "without it a private server is started");
  AddJson(unwrap, arguments);
  AddProgress(unwrap, arguments);
  AddTimeout(unwrap, arguments, "Give up, and cancel the job, after so long");
  unwrap.add_flag(
      "--detach", arguments.detach,
      "Queue the job, print its name and leave; see jobs watch; of a batch the same command fetches what is done");
  AddLabels(unwrap, arguments, "Label of the job, to find it again; may be repeated [file=the file's name]");
  AddScheduling(unwrap, arguments.scheduling);

  UnwrapOptions& options = arguments.options;
  AddSeams(unwrap, arguments);
  AddTexcoord(unwrap, arguments);
  AddOutputTexcoord(unwrap, arguments);
  AddPreset(unwrap, arguments);
  AddAtlas(unwrap, arguments);
  AddPack(unwrap, arguments);
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

// "skin=2"; the name may have equals signs.
void AddMaterialWeight(const std::string& text, Arguments* arguments) {
  const std::size_t equals = text.rfind('=');
  double weight = 0;
  if (equals != std::string::npos) {
    const char* const end = text.data() + text.size();
    const auto [rest, error] = std::from_chars(text.data() + equals + 1, end, weight);
    if (error != std::errc() || rest != end) weight = 0;
  }
  if (!(weight >= 0.01 && weight <= 100)) {
    throw CLI::ValidationError("--weight", text + " is not MATERIAL=X with X from 0.01 to 100");
  }
  arguments->material_weights[text.substr(0, equals)] = weight;
}

void DefinePack(CLI::App& app, Arguments& arguments) {
  CLI::App& pack = *app.add_subcommand("pack", "Pack the UV islands that a mesh has anew, without solving");
  pack.parse_complete_callback([&arguments] { arguments.command = Command::kPack; });
  pack.footer(
      "Needs no server. Islands are moved, turned and scaled as they are: mirrored ones stay mirrored, and what "
      "overlaps "
      "inside one\nstays so. Exit codes: 0 packed, 1 the file lacks UV or they cannot be packed, 2 bad usage or "
      "unreadable "
      "file.");
  pack.add_option("IN", arguments.input, "Mesh file with UV, as for unwrap")->required()->type_name("");
  AddOutput(pack, arguments);
  AddAtlas(pack, arguments);
  pack.add_option_function<std::string>(
          "--density", [&arguments](const std::string& word) { arguments.keep_density = word == "keep"; },
          "equal: as many texels per area of the surface in every island; keep: their sizes relative to each other")
      ->check(CLI::IsMember({"equal", "keep"}).description(""))
      ->type_name("equal|keep");
  pack.add_option_function<std::vector<std::string>>(
          "--weight",
          [&arguments](const std::vector<std::string>& texts) {
            for (const std::string& text : texts) AddMaterialWeight(text, &arguments);
          },
          "So many times the texels per length for the islands of a material, 0.01 to 100; several times for several")
      ->type_name("MATERIAL=X");
  AddTexcoord(pack, arguments);
  AddOutputTexcoord(pack, arguments);
  AddPreview(pack, arguments);
  AddJson(pack, arguments);
}

void DefineInspect(CLI::App& app, Arguments& arguments) {
  CLI::App& inspect = *app.add_subcommand("inspect", "Say what a mesh is like and what unwrap would do with it");
  inspect.parse_complete_callback([&arguments] { arguments.command = Command::kInspect; });
  inspect.footer(
      "Needs no server. Exit codes: 0 unwrap would take the mesh, 1 it would refuse it, 2 bad usage or unreadable "
      "file.");
  inspect.add_option("IN", arguments.input, "Mesh file, as for unwrap")->required()->type_name("");
  AddTexcoord(inspect, arguments);
  AddJson(inspect, arguments);
}

void DefineEstimate(CLI::App& app, Arguments& arguments) {
  CLI::App& estimate = *app.add_subcommand("estimate", "Say what unwrap would need on a server, without doing it");
  estimate.parse_complete_callback([&arguments] { arguments.command = Command::kEstimate; });
  estimate.footer(
      "Memory while the job runs, run time on one core, time in the queue; rough, from the mesh's counts. Exit codes: "
      "0 the server\nwould accept the job now, 1 it would not, 2 bad usage or unreadable file, 3 server unreachable.");
  estimate.add_option("IN", arguments.input, "Mesh file, as for unwrap")->type_name("");
  estimate.add_option("--triangles", arguments.triangles, "In place of a file: that many triangles")
      ->check(CLI::Range(std::int64_t{1}, std::int64_t{1} << 40).description(""))
      ->type_name("N");
  AddServer(estimate, arguments, "without it a private server is started");
  AddJson(estimate, arguments);
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
  AddLabels(list, arguments, "Only jobs with this label; VALUE may end in *; may be repeated");
  list.add_option("--filter", arguments.filter,
                  "Only jobs that this is true of, e.g. 'create_time >= \"2026-01-31T08:00:00Z\"'; see ListJobs in "
                  "API.md")
      ->type_name("TEXT");
  const Choices<JobState> states{{JobState::kQueued, JobState::kRunning, JobState::kStopping, JobState::kSucceeded,
                                  JobState::kFailed, JobState::kCancelled, JobState::kExpired}};
  list.add_option_function<std::string>(
          "--state",
          [&arguments, states](const std::string& name) {
            for (const JobState state : states.values) {
              if (name == ToString(state)) arguments.state = state;
            }
          },
          "QUEUED, RUNNING, STOPPING, SUCCEEDED, FAILED, CANCELLED or EXPIRED only")
      ->check(CLI::IsMember(states.Names()).description(""))
      ->type_name("STATE");
  AddJobCommand(jobs, arguments, Command::kJobsShow, "show", "One job with its report");
  CLI::App& watch = AddJobCommand(jobs, arguments, Command::kJobsWatch, "watch",
                                  "Follow a job to its end; with --mesh and -o, write its UV");
  AddProgress(watch, arguments);
  watch.add_option("--mesh", arguments.input, "The file that was sent; the UV go into a copy of it")->type_name("IN");
  AddOutput(watch, arguments);
  AddPreview(watch, arguments);
  AddTexcoord(watch, arguments);
  AddOutputTexcoord(watch, arguments);
  AddTimeout(watch, arguments, "Stop watching after so long; the job goes on");
  AddJobCommand(jobs, arguments, Command::kJobsStop, "stop", "End a job soon, with the best map that it has then");
  AddJobCommand(jobs, arguments, Command::kJobsCancel, "cancel", "End a job and discard what it has");
  AddJobCommand(jobs, arguments, Command::kJobsDelete, "delete", "Forget a job that ended");
}

void DefineHealth(CLI::App& app, Arguments& arguments) {
  CLI::App& health = *app.add_subcommand("health", "Ask a server by HTTP whether it is ready for jobs");
  health.parse_complete_callback([&arguments] { arguments.command = Command::kHealth; });
  health.footer(
      "For probes, beside planishd --metrics-listen; needs no credentials. /livez in place of /readyz asks whether it "
      "serves at all.\nExit codes: 0 yes, 1 no, 3 nobody answers.");
  health.add_option("URL", arguments.health_url, "What to ask [http://127.0.0.1:9741/readyz]")->type_name("");
}

CLI::App& AddAdminCommand(CLI::App& admin, Arguments& arguments, Command command, const std::string& name,
                          const std::string& description) {
  CLI::App& app = *admin.add_subcommand(name, description);
  app.parse_complete_callback([&arguments, command] { arguments.command = command; });
  AddServer(app, arguments, "required here");
  return app;
}

void DefineAdmin(CLI::App& app, Arguments& arguments) {
  CLI::App& admin = *app.add_subcommand("admin", "Run a server: for callers with the right \"admin\"");
  admin.require_subcommand(1);
  AddAdminCommand(admin, arguments, Command::kAdminDrain, "drain",
                  "Take no new jobs and say so to load balancers; those that were accepted go on")
      .add_flag("--wait", arguments.wait, "Return when no job is left");
  AddAdminCommand(admin, arguments, Command::kAdminUndrain, "undrain", "Take new jobs again");
  AddJson(AddAdminCommand(admin, arguments, Command::kAdminStats, "stats", "What the server is doing"), arguments);
  AddAdminCommand(admin, arguments, Command::kAdminConfig, "config",
                  "The settings it runs with, and where they come from, as its configuration file");
}

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

}  // namespace

ParsedArguments ParseArguments(int argc, const char* const* argv) {
  Arguments arguments;
  CLI::App app("planish unwraps triangle meshes by Angle Based Flattening.", "planish");
  app.footer(kExamples);
  app.require_subcommand(1);
  app.get_formatter()->column_width(44);
  DefineUnwrap(app, arguments);
  DefinePack(app, arguments);
  DefineCheck(app, arguments);
  DefineReport(app, arguments);
  DefineInspect(app, arguments);
  DefineEstimate(app, arguments);
  DefineJobs(app, arguments);
  DefineHealth(app, arguments);
  DefineAdmin(app, arguments);
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
    parsed.err = parsed.exit_code == kOk ? "" : "planish: " + err.str() + Suggestion(app, argc, argv);
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
