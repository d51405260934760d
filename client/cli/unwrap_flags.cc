#include <string>
#include <tuple>
#include <utility>

#include "client/cli/flags.h"

namespace planish::cli {
namespace {

constexpr char kUnwrapExamples[] = R"(Examples:
  planish unwrap face.obj -o face_uv.obj
  planish unwrap scan.stl -o scan.obj --precision=double --json > report.json
  planish unwrap face.obj -o - > face_uv.obj
  planish unwrap prop.obj -o prop_uv.obj --seams=auto,hard:60,materials --padding=4
  planish unwrap hero.obj -o hero_uv.obj --seams=keep,uv     (the borders of its UV islands)
  planish unwrap face.obj -o face_uv.obj --picture=map.png --preview=layout.svg
  planish unwrap face.obj -o uv.obj --solver=uzawa --system=full --preconditioner=none
  planish unwrap level.glb -o lit.glb --preset=lightmap      a second set of UV; the first one stays
  planish unwrap a.obj b.glb props/ -o done/                   a batch: a job and an output per file
  planish unwrap a.obj b.glb -o done/ --one-atlas              one job: both in one atlas

Batches: several files, or a directory, are a batch. A directory is searched for mesh files. Each
file becomes a job of its own and a file in the directory OUT, of the same name and at the same
place below the directory that was named. A file that fails does not affect the others. The same
command, given again, goes on where the last one ended: OUT/.planish-batch.json records input,
options and output of each file. --json prints a line for each file and a last line
{"summary": ...}. --timeout is for each file.

Seams: --seams takes a comma-separated list of at most one policy and any number of sources.
  auto         the given seams, and as many more as keep every chart's stretch below --max-stretch
  needed       the given seams, and more only where a piece is no disc or no map keeps its borders;
               the default where sources are given without a policy
  keep         the given seams and no others: a piece that is no disc is refused
  none         no cut: the mesh must be a disc
  uv           borders of the UV islands that the file has
  materials    between faces of different materials
  groups       between faces of different objects or groups
  hard[:DEG]   edges between faces whose normals differ by more than DEG degrees [66]
  edges:FILE   two vertex numbers per line, as the file counts them (an OBJ from 1, others from 0)
  uncut:FILE   the reverse of a source: edges, listed in the same way, at which no seam is added

The first of several choices is the default. An OBJ comes back byte for byte except for its vt and f lines.)";

void AddBatch(CLI::App& app, Arguments& arguments) {
  app.add_flag("--one-atlas", arguments.one_atlas, "Several files are one job and share one atlas: no batch");
  app.add_option("--format", arguments.format, "Of the outputs of a batch [that of each input; STL becomes OBJ]")
      ->check(CLI::IsMember({"obj", "ply", "off", "gltf", "glb", "drc"}).description(""))
      ->type_name("obj|ply|off|gltf|glb|drc");
  app.add_flag(
      "--again", arguments.again,
      "Of a batch: send files again whose outputs are up to date; the server may answer with a result that it has "
      "kept, unless --fresh is given too");
}

void AddPicture(CLI::App& app, Arguments& arguments) {
  app.add_option("--picture", arguments.picture,
                 "Draw the surface with a checkerboard in its UV, and the layout beside it")
      ->type_name("PNG");
  app.add_option_function<std::pair<double, double>>(
         "--view",
         [&arguments](const std::pair<double, double>& view) {
           std::tie(arguments.view_azimuth, arguments.view_elevation) = view;
         },
         "Where the picture looks from: round y, and up, in degrees [35 17]")
      ->type_name("AZIMUTH ELEVATION");
}

void AddReport(CLI::App& app, Arguments& arguments) {
  app.add_option("--report", arguments.report,
                 "Write a page that shows the map: surface, layout, charts, warnings, how it was solved; of a batch "
                 "a contact sheet; see report")
      ->type_name("HTML|DIR");
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
         "Where to cut: auto, needed, keep or none, and sources of given seams (uv, hard, ...) [auto]")
      ->type_name("LIST");
  app.add_option("--max-stretch", arguments.options.max_stretch,
                 "Root mean square stretch above which auto cuts a chart, 1.001 to 100 [1.05]")
      ->check(CLI::Range(1.001, 100.0).description(""))
      ->type_name("X");
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

}  // namespace

void DefineUnwrap(CLI::App& app, Arguments& arguments) {
  CLI::App& unwrap = *app.add_subcommand("unwrap", "Flatten a mesh and write it with UV");
  unwrap.parse_complete_callback([&arguments] { arguments.command = Command::kUnwrap; });
  unwrap.footer(kUnwrapExamples);
  unwrap
      .add_option("IN", arguments.input,
                  "Mesh file: .obj, .ply, .off, .stl, .gltf, .glb or .drc; - for stdin; or a directory")
      ->required()
      ->type_name("");
  unwrap.add_option("MORE", arguments.more_inputs, "Further files and directories: a batch; OUT is a directory then")
      ->type_name("");
  UnwrapOptions& options = arguments.options;
  AddOutput(unwrap, arguments);
  AddSeams(unwrap, arguments);
  AddAtlasSize(unwrap, arguments);
  AddReport(unwrap, arguments);
  AddServer(unwrap, arguments, "without it a private server is started");
  AddJson(unwrap, arguments);

  unwrap.option_defaults()->group("Files");
  AddTexcoord(unwrap, arguments);
  AddOutputTexcoord(unwrap, arguments);
  AddPreset(unwrap, arguments);
  AddBatch(unwrap, arguments);

  unwrap.option_defaults()->group("Pictures");
  AddPicture(unwrap, arguments);
  AddPreview(unwrap, arguments);

  unwrap.option_defaults()->group("Atlas");
  AddPacking(unwrap, arguments);
  unwrap
      .add_option_function<std::string>(
          "--pack", [&options](const std::string& word) { options.pack = word == "on"; },
          "Move charts into the tiles; off: leave them as solved, at the surface's scale, one over the other [on]")
      ->check(CLI::IsMember({"on", "off"}).description(""))
      ->type_name("on|off");

  unwrap.option_defaults()->group("Jobs");
  unwrap.add_flag(
      "--detach", arguments.detach,
      "Queue the job, print its name and leave; see jobs watch; of a batch the same command fetches what is done");
  AddTimeout(unwrap, arguments, "This command waits no longer than that from its start on, and cancels the job");
  AddScheduling(unwrap, arguments.scheduling);
  AddLabels(unwrap, arguments, "Label of the job, to find it again; may be repeated [file=the file's name]");

  unwrap.option_defaults()->group("Solver");
  Choices<Solver>{{Solver::kAuto, Solver::kUzawa, Solver::kMinres, Solver::kDirect}}.AddTo(
      unwrap, "--solver", options.solver.method, "Linear solver of a Newton step; direct: sparse Cholesky [auto]");
  Choices<System>{{System::kAuto, System::kFull, System::kReduced}}.AddTo(
      unwrap, "--system", options.solver.system,
      "System it works on; full: the paper's M; reduced: its Schur complement [auto]");
  Choices<Preconditioner>{{Preconditioner::kAuto, Preconditioner::kNone, Preconditioner::kJacobi,
                           Preconditioner::kCholesky, Preconditioner::kAmg}}
      .AddTo(unwrap, "--preconditioner", options.solver.preconditioner,
             "Preconditioner of uzawa and minres; auto: multigrid, or Cholesky for small charts [auto]");
  Choices<Hessian>{{Hessian::kAuto, Hessian::kConvex, Hessian::kExact}}.AddTo(
      unwrap, "--hessian", options.solver.hessian,
      "convex: convexified; exact: as it is, solved by MINRES; auto: convex far from the solution, exact near it "
      "[auto]");
  Choices<Boundary>{{Boundary::kFree, Boundary::kConvex}}.AddTo(
      unwrap, "--boundary", options.boundary,
      "Outline of the map; convex: a convex polygon, which never overlaps [free]");
  Choices<Precision>{{Precision::kAuto, Precision::kFloat, Precision::kDouble}}.AddTo(
      unwrap, "--precision", options.precision, "Type of the UV; auto: float where it keeps the map [auto]");
  unwrap
      .add_option("--tolerance", options.solver.tolerance,
                  "Residual per angle at which Newton stops, up to 1e-2 [1e-9]")
      ->check(CLI::Range(1e-300, 1e-2).description(""))
      ->type_name("RAD");
  unwrap
      .add_option("--max-newton-iterations", options.solver.max_newton_iterations,
                  "Newton iterations at most, up to 1000 [100]")
      ->check(CLI::Range(1, 1000).description(""))
      ->type_name("N");
  unwrap
      .add_option("--threads", options.threads,
                  "Threads to use, within the server's limit; never changes a byte [that limit; all cores without "
                  "--server]")
      ->check(CLI::Range(1, 256).description(""))
      ->type_name("N");
  AddTerminal(unwrap, arguments);
  AddProgress(unwrap, arguments);
}

}  // namespace planish::cli
