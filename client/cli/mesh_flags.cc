// Flags of the commands that take mesh files: unwrap; pack, check, report and inspect, which ask no server.
#include <algorithm>
#include <array>
#include <charconv>
#include <cstddef>
#include <sstream>
#include <string>
#include <system_error>
#include <tuple>
#include <utility>
#include <vector>

#include "client/cli/flags.h"
#include "client/cli/option_flags.h"

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
  planish unwrap a.obj b.glb -o done/ --atlas-per=file         one job: a UDIM tile for each
  planish unwrap hero.glb -o uv.glb --atlas-per=material       a UDIM tile for each material
  planish unwrap hero.glb -o uv.glb --weight=face=2            twice the texels per length for one
  planish unwrap hero.glb -o game.glb --merge-materials        one material and one set of images
  planish unwrap scan.ply -o scan.glb --bake=colors            vertex colours become a texture

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
  keep         the given seams; a piece with holes is slit only where it has no other map (a warning
               says so), a closed piece is refused
  none         no cut: the mesh must be a disc
  uv           borders of the UV islands that the file has
  materials    between faces of different materials
  groups       between faces of different objects or groups
  hard[:DEG]   edges between faces whose normals differ by more than DEG degrees [66]
  edges:FILE   two vertex numbers per line, as the file counts them (an OBJ from 1, others from 0)
  uncut:FILE   the reverse of a source: edges, listed in the same way, at which no seam is added

Atlases: a job has one atlas for all of its charts. --atlas-per gives one to each
  file         of several files, which are one job then, not a batch of jobs
  mesh         object (o) of an OBJ, mesh of a glTF
  material     faces without one have an atlas too, the last
  group        object and group (o, g) of an OBJ, mesh of a glTF
in their order, and charts end between them. --atlas-layout says where the atlases go.
  udim         each into tiles of its own from 1001 on, at most 100: one set of textures, so the
               texel density is the same everywhere, and the fullest tile decides it
  stacked      all into the same tiles, one over the other: textures of their own, which may
               differ in size, so each is filled as far as it goes

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

void AddAtlases(CLI::App& app, Arguments& arguments) {
  Choices<AtlasPer>{{AtlasPer::kFile, AtlasPer::kMesh, AtlasPer::kMaterial, AtlasPer::kGroup}}
      .AddTo(app, "--atlas-per", arguments.atlas_per, "What gets an atlas of its own, see below [one for all of a job]")
      ->excludes("--one-atlas");
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

// `pieces`: what the command packs.
void AddWeights(CLI::App& app, Arguments& arguments, const std::string& pieces) {
  app.add_option_function<std::vector<std::string>>(
         "--weight",
         [&arguments](const std::vector<std::string>& texts) {
           for (const std::string& text : texts) AddMaterialWeight(text, &arguments);
         },
         "So many times the texels per length for the " + pieces +
             " of a material, 0.01 to 100; several times for several")
      ->type_name("MATERIAL=X");
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
}

// Flags that are given count more than those of a preset.
void AddPreset(CLI::App& app, Arguments& arguments) {
  CLI::Option* const preset =
      app.add_option(
             "--preset",
             "lightmap: --output-texcoord=1 --padding=4 --prefer=texture --seams=auto, with uv if there are any")
          ->check(CLI::IsMember({"lightmap"}).description(""))
          ->type_name("lightmap");
  app.final_callback([&app, &arguments, preset] {
    if (preset->count() == 0) return;
    if (!arguments.output_texcoord) arguments.output_texcoord = 1;
    if (!arguments.options.padding) arguments.options.padding = 4;
    if (app.get_option("--seams")->count() > 0) {
      if (app.get_option("--prefer")->count() == 0 && arguments.options.seams == Seams::kAuto) {
        arguments.options.prefer = Prefer::kTexture;
      }
    } else {
      if (app.get_option("--prefer")->count() == 0) arguments.options.prefer = Prefer::kTexture;
      ParseSeamList("auto,uv", &arguments.seams);
      arguments.seams.uv_is_optional = true;
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
  AddOutput(unwrap, arguments, /*takes_batch=*/true);
  AddSeams(unwrap, arguments);
  AddOptionsOfGroup(unwrap, options, "");
  AddReport(unwrap, arguments);
  AddServer(unwrap, arguments, "without it a private server is started");
  AddJson(unwrap, arguments);

  unwrap.option_defaults()->group("Files");
  AddTexcoord(unwrap, arguments);
  AddOutputTexcoord(unwrap, arguments);
  AddTextures(unwrap, arguments);
  AddPreset(unwrap, arguments);
  AddBatch(unwrap, arguments);

  unwrap.option_defaults()->group("Pictures");
  AddPicture(unwrap, arguments);
  AddPreview(unwrap, arguments);

  unwrap.option_defaults()->group("Atlas");
  AddOptionsOfGroup(unwrap, options, "Atlas");
  AddAtlases(unwrap, arguments);
  AddWeights(unwrap, arguments, "charts");

  unwrap.option_defaults()->group("Jobs");
  unwrap.add_flag(
      "--detach", arguments.detach,
      "Queue the job, print its name and leave; see jobs watch; of a batch the same command fetches what is done");
  AddTimeout(unwrap, arguments, "This command waits no longer than that from its start on, and cancels the job");
  AddScheduling(unwrap, arguments.scheduling);
  AddLabels(unwrap, arguments, "Label of the job, to find it again; may be repeated [file=the file's name]");

  unwrap.option_defaults()->group("Solver");
  AddOptionsOfGroup(unwrap, options, "Solver");
  AddTerminal(unwrap, arguments);
  AddProgress(unwrap, arguments);
}

namespace {

constexpr std::array<Requirement, 6> kRequirements = {Requirement::kUv,           Requirement::kNoOverlap,
                                                      Requirement::kNoFlip,       Requirement::kNoMirror,
                                                      Requirement::kNoDegenerate, Requirement::kInTile};

constexpr char kCheckHelp[] = R"(Examples:
  planish check hero.glb
  planish check *.obj --require=no-overlap,no-flip --max-stretch=1.5
  planish check level.glb --texcoord=1 --texture-size=512 --min-padding=4 --require=all --json

Requirements: --require takes a comma-separated list of
  uv             every triangle has UV
  no-overlap     no two triangles share a part of the map
  no-flip        no triangle is turned against the rest of its chart
  no-mirror      no chart is mirrored as a whole
  no-degenerate  no triangle is a line or a point in the map
  in-tile        every triangle lies in one of the tiles
  all            all of these

Needs no server; the UV may come from any tool. Several files are judged one by one; with --json there is a line for
each then, and a last one {"summary": ...}. Exit codes: 0 every requirement is met, 1 some are not, or a file has no UV,
2 bad usage or an unreadable file.)";

// Throws CLI::ValidationError for what is none.
void AddRequirements(const std::string& text, std::set<Requirement>* required) {
  std::istringstream list(text);
  for (std::string word; std::getline(list, word, ',');) {
    if (word == "all") {
      required->insert(kRequirements.begin(), kRequirements.end());
      continue;
    }
    const auto found = std::find_if(kRequirements.begin(), kRequirements.end(),
                                    [&](Requirement requirement) { return word == ToString(requirement); });
    if (found == kRequirements.end()) {
      std::string known;
      for (const Requirement requirement : kRequirements) known += std::string(ToString(requirement)) + ", ";
      throw CLI::ValidationError("--require", "there is no requirement \"" + word + "\"; there are " + known + "all");
    }
    required->insert(*found);
  }
}

void SetTexcoord(const std::string& text, Arguments* arguments) {
  arguments->check.all_texcoords = text == "all";
  if (arguments->check.all_texcoords) return;
  const char* const end = text.data() + text.size();
  const auto [rest, error] = std::from_chars(text.data(), end, arguments->texcoord);
  if (error != std::errc() || rest != end || arguments->texcoord < 0 || arguments->texcoord > 7) {
    throw CLI::ValidationError("--texcoord", text + " is neither a number from 0 to 7 nor all");
  }
}

constexpr char kReportHelp[] = R"(Examples:
  planish report hero.glb -o hero.html
  planish report hero_blender.obj hero_planish.obj -o compare.html   with the same camera
  planish unwrap hero.glb -o flat.glb --report=hero.html   before, after, and the solve
  planish report props/ hero.glb -o sheet/                 a contact sheet, and a page per file
  planish unwrap props/ -o done/ --report=sheet.html       the same of a batch

The page is one file, opened from disk; it asks the network for nothing. It shows the surface and the layout, linked by
hovering and clicking, with checker, charts, stretch, angle error, seams or colours; a table of charts; and warnings, which
lead to the triangles that they are about. It needs a browser with WebGL 2.

More than two files, a directory, or a directory after -o make a contact sheet: an index with a small picture and the key
figures of each file, sorted as you like, and a page for each. DIR has the index as DIR/index.html and the pages beside it
(DIR/props/a.obj.html); FILE.html is the index itself, and FILE_files has the pages. unwrap --report does the same for a
batch, with what failed. Exit codes: 0 written, 1 a file has no UV, 2 bad usage or an unreadable file.)";

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
  AddOutput(pack, arguments, /*takes_batch=*/false);
  AddOptions(pack, arguments.options, {"texture_size", "padding", "effort", "tiles"});
  pack.add_option_function<std::string>(
          "--density", [&arguments](const std::string& word) { arguments.keep_density = word == "keep"; },
          "equal: as many texels per area of the surface in every island; keep: their sizes relative to each other")
      ->check(CLI::IsMember({"equal", "keep"}).description(""))
      ->type_name("equal|keep");
  AddWeights(pack, arguments, "islands");
  AddTexcoord(pack, arguments);
  AddOutputTexcoord(pack, arguments);
  AddTextures(pack, arguments);
  AddPreview(pack, arguments);
  AddJson(pack, arguments);
  AddTerminal(pack, arguments);
  AddProgress(pack, arguments);
}

void DefineTransfer(CLI::App& app, Arguments& arguments) {
  CLI::App& transfer = *app.add_subcommand("transfer", "Draw the images of a model into the map of another file");
  transfer.parse_complete_callback([&arguments] { arguments.command = Command::kTransfer; });
  transfer.footer(
      "Needs no server. OUT is FROM with the UV of TO, and with its images drawn anew for them. Both files have the "
      "same triangles,\nin any order, as where TO was unwrapped elsewhere. With --project they need not. Exit codes: 0 "
      "written, 1 the surfaces differ or\nTO has no UV, 2 bad usage or an unreadable file or image.");
  transfer.add_option("FROM", arguments.input, "Model with images: .gltf, .glb, or .obj with its material files")
      ->required()
      ->type_name("");
  transfer.add_option("TO", arguments.more_inputs, "Mesh file with the UV that it is to have")
      ->required()
      ->expected(1)
      ->type_name("");
  AddOutput(transfer, arguments, /*takes_batch=*/false);
  transfer
      .add_option("--texture-size", arguments.options.texture_size,
                  "Texels per side of the new images, 16 to 65536 [as many as keep the texel density]")
      ->check(CLI::Range(16, 65536).description(""))
      ->type_name("N");
  transfer.add_option("--texcoord", arguments.texcoord, "Which set of UV of TO, TEXCOORD_N of a glTF, up to 7 [0]")
      ->check(CLI::Range(0, 7).description(""))
      ->type_name("N");
  transfer
      .add_option_function<int>(
          "--output-texcoord", [&arguments](const int& n) { arguments.output_texcoord = n; },
          "Which set of FROM they replace [0]")
      ->check(CLI::Range(0, 7).description(""))
      ->type_name("N");
  transfer.add_flag("--project", arguments.project,
                    "The surfaces only lie close, like a scan and its decimated copy: OUT, a .glb or .gltf, is TO with "
                    "FROM's colours and normals as images");
  transfer
      .add_option("--cage", arguments.cage_percent,
                  "With --project: how far from TO it looks for FROM, in percent of TO's diagonal [1]")
      ->check(CLI::Range(0.001, 100.0).description(""))
      ->type_name("PERCENT");
  AddImageFlags(transfer, arguments);
  AddJson(transfer, arguments);
  AddTerminal(transfer, arguments);
  AddProgress(transfer, arguments);
}

void DefineCheck(CLI::App& app, Arguments& arguments) {
  CLI::App& check = *app.add_subcommand("check", "Judge the UV that a mesh has, from any tool");
  check.parse_complete_callback([&arguments] { arguments.command = Command::kCheck; });
  check.footer(kCheckHelp);
  check.add_option("IN", arguments.input, "Mesh file, as for unwrap")->required()->type_name("");
  check.add_option("MORE", arguments.more_inputs, "Further files, judged one by one")->type_name("");
  check
      .add_option_function<std::string>(
          "--require", [&arguments](const std::string& text) { AddRequirements(text, &arguments.check.required); },
          "What must hold, see below [nothing but that there are UV]")
      ->type_name("LIST");
  check
      .add_option("--max-stretch", arguments.check.max_stretch,
                  "No chart may have a larger root mean square stretch (1: none), 1.001 to 100")
      ->check(CLI::Range(1.001, 100.0).description(""))
      ->type_name("X");
  check
      .add_option("--min-padding", arguments.check.min_padding,
                  "No two charts may be nearer, in texels; a hundredth less is taken for rounding; up to 64")
      ->check(CLI::Range(0.0, 64.0).description(""))
      ->type_name("TEXELS");
  check.add_option("--texture-size", arguments.options.texture_size, "Texels per side of a tile, 16 to 65536 [1024]")
      ->check(CLI::Range(16, 65536).description(""))
      ->type_name("N");
  check
      .add_option("--tiles", arguments.options.tiles, "Tiles (UDIM 1001, 1002, ...) that charts may lie in, to 100 [1]")
      ->check(CLI::Range(1, 100).description(""))
      ->type_name("N");
  check
      .add_option_function<std::string>(
          "--texcoord", [&arguments](const std::string& text) { SetTexcoord(text, &arguments); },
          "Which of the sets of UV, TEXCOORD_N of a glTF, up to 7; all: each that the file has [0]")
      ->type_name("N|all");
  check.add_flag("--json", arguments.json, "Print one JSON object on stdout");
}

void DefineReport(CLI::App& app, Arguments& arguments) {
  CLI::App& report =
      *app.add_subcommand("report", "Write a page that shows the UV of a mesh, of two side by side, or of many");
  report.parse_complete_callback([&arguments] { arguments.command = Command::kReport; });
  report.footer(kReportHelp);
  report.add_option("A", arguments.input, "Mesh file with UV, as for unwrap")->required()->type_name("");
  report.add_option("B", arguments.more_inputs, "A second one to compare with it; or more, and directories: a sheet")
      ->type_name("");
  report.add_option("-o,--output", arguments.output, "Where the page goes; - is stdout; a directory takes a sheet")
      ->type_name("HTML|DIR");
  report
      .add_option("--job-report", arguments.job_report,
                  "What unwrap --json printed about the last file: methods of charts, times, warnings")
      ->type_name("JSON");
  report.add_option("--texture-size", arguments.options.texture_size, "Texels per side of a tile, 16 to 65536 [1024]")
      ->check(CLI::Range(16, 65536).description(""))
      ->type_name("N");
  report
      .add_option_function<int>(
          "--padding", [&arguments](const int& texels) { arguments.options.padding = texels; },
          "Texels between charts: drawn round each, and nearer charts are warned of, up to 64 [2]")
      ->check(CLI::Range(0, 64).description(""))
      ->type_name("N");
  report
      .add_option("--tiles", arguments.options.tiles, "Tiles (UDIM 1001, 1002, ...) that charts may lie in, to 100 [1]")
      ->check(CLI::Range(1, 100).description(""))
      ->type_name("N");
  report.add_option("--texcoord", arguments.texcoord, "Which of the sets of UV, TEXCOORD_N of a glTF, up to 7 [0]")
      ->check(CLI::Range(0, 7).description(""))
      ->type_name("N");
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
  AddTerminal(inspect, arguments);
}

}  // namespace

const char* ToString(AtlasPer per) {
  switch (per) {
    case AtlasPer::kFile:
      return "file";
    case AtlasPer::kMesh:
      return "mesh";
    case AtlasPer::kMaterial:
      return "material";
    case AtlasPer::kGroup:
      return "group";
  }
  return "";
}

const char* ToString(Textures textures) {
  switch (textures) {
    case Textures::kTransfer:
      return "transfer";
    case Textures::kKeep:
      return "keep";
    case Textures::kDrop:
      return "drop";
  }
  return "";
}

const char* ToString(Requirement requirement) {
  switch (requirement) {
    case Requirement::kUv:
      return "uv";
    case Requirement::kNoOverlap:
      return "no-overlap";
    case Requirement::kNoFlip:
      return "no-flip";
    case Requirement::kNoMirror:
      return "no-mirror";
    case Requirement::kNoDegenerate:
      return "no-degenerate";
    case Requirement::kInTile:
      return "in-tile";
  }
  return "";
}

void DefineMapCommands(CLI::App& app, Arguments& arguments) {
  DefinePack(app, arguments);
  DefineTransfer(app, arguments);
  DefineCheck(app, arguments);
  DefineReport(app, arguments);
  DefineInspect(app, arguments);
}

}  // namespace planish::cli
