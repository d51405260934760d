#include "client/cli/unwrap_arguments.h"

#include <algorithm>
#include <cstddef>
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
  planish unwrap hero.obj -o hero_uv.obj --seams=keep,uv       cut at the borders of its islands
  planish unwrap face.obj -o face_uv.obj --picture=map.png --preview=layout.svg
  planish unwrap face.obj -o uv.obj --solver=uzawa --system=full --preconditioner=none
  planish unwrap level.glb -o lit.glb --preset=lightmap        a second UV set; the first one stays
  planish unwrap a.obj b.glb props/ -o done/                   a batch: a job and an output per file
  planish unwrap a.obj b.glb -o done/ --one-atlas              one job: both in one atlas
  planish unwrap a.obj b.glb -o done/ --atlas-per=file         one job: a UDIM tile for each
  planish unwrap hero.glb -o uv.glb --atlas-per=material       a UDIM tile for each material
  planish unwrap hero.glb -o uv.glb --weight=face=2            twice the density for material face
  planish unwrap hero.glb -o game.glb --merge-materials        one material and one set of images
  planish unwrap scan.ply -o scan.glb --bake=colors            vertex colours become a texture

Batches: several files, or a directory, are a batch. A directory is searched for mesh files. Each
file becomes a job of its own. Its output has the same name, in the directory OUT; files from a
searched directory keep their place in its subdirectories. A file that fails does not affect the
others. If the command is repeated, it continues where the last one ended: OUT/.planish-batch.json
records input, options and output of each file. --json prints a line for each file and a last line
{"summary": ...}. --timeout is for each file.

Seams: --seams takes a comma-separated list of at most one policy and any number of sources.
  auto         the given seams, and as many more as keep every chart's stretch below --max-stretch
  needed       the given seams, and more only where a piece is not a disc, or cannot be mapped
               without a further cut; the default if only sources are given
  keep         only the given seams; a piece with holes is slit if it cannot be mapped otherwise
               (with a warning); a closed piece, or one with handles, is refused
  none         no cut: the mesh must be a disc
  uv           borders of the file's UV islands
  materials    between faces of different materials
  groups       between faces of different objects or groups
  hard[:DEG]   edges between faces whose normals differ by more than DEG degrees [66]
  edges:FILE   two vertex numbers per line, as the file counts them (an OBJ from 1, others from 0)
  uncut:FILE   edges, listed in the same way, at which no seam may be added

Atlases: by default a job has one atlas. With --atlas-per, each of these has its own, and no chart
crosses from one to another:
  file         each input file; the files are one job then, not a batch
  mesh         each object (o) of an OBJ, each mesh of a glTF
  material     each material; faces without a material share the last atlas
  group        each object and group (o, g) of an OBJ, each mesh of a glTF
Atlases are numbered in the order of these parts in the file. --atlas-layout says where they go:
  udim         each in tiles of its own, from 1001 on, at most 100. They are one set of textures
               with one texel density, which the fullest atlas limits
  stacked      all in the same tiles, each for textures of its own, which may differ in size; so
               each atlas is scaled to fill its tiles

The first of several choices is the default. An OBJ comes back byte for byte except for its vt and f lines.)";

void AddBatch(CLI::App& app, UnwrapArguments& arguments) {
  app.add_flag("--one-atlas", arguments.one_atlas,
               "Unwrap several files as one job with a common atlas, not as a batch");
  app.add_option("--format", arguments.format,
                 "File format of a batch's outputs [the format of each input; OBJ for STL]")
      ->check(CLI::IsMember({"obj", "ply", "off", "gltf", "glb", "drc"}).description(""))
      ->type_name("obj|ply|off|gltf|glb|drc");
  app.add_flag(
      "--again", arguments.again,
      "Batch: also process files whose outputs are up to date; add --fresh to make the server compute them again");
}

void AddAtlases(CLI::App& app, UnwrapArguments& arguments) {
  Choices<AtlasPer>{{AtlasPer::kFile, AtlasPer::kMesh, AtlasPer::kMaterial, AtlasPer::kGroup}}
      .AddTo(app, "--atlas-per", arguments.map.atlas_per,
             "What gets an atlas of its own, see Atlases below [one atlas for the whole job]")
      ->excludes("--one-atlas");
}

void AddPicture(CLI::App& app, UnwrapArguments& arguments) {
  app.add_option("--picture", arguments.picture,
                 "Draw the surface with a checkerboard in its UV, and the layout beside it")
      ->type_name("PNG");
  app.add_option_function<std::pair<double, double>>(
         "--view",
         [&arguments](const std::pair<double, double>& view) {
           std::tie(arguments.view_azimuth, arguments.view_elevation) = view;
         },
         "Position of the viewer, in degrees: rotation about the y axis from +z towards +x, and elevation [35 17]")
      ->type_name("AZIMUTH ELEVATION");
}

void AddReport(CLI::App& app, UnwrapArguments& arguments) {
  app.add_option("--report", arguments.report,
                 "Write a page that shows the map: surface, layout, charts, warnings, how it was solved; for a batch "
                 "a contact sheet; see planish report")
      ->type_name("HTML|DIR");
}

void AddSeams(CLI::App& app, UnwrapArguments& arguments) {
  app.add_option_function<std::string>(
         "--seams",
         [&arguments](const std::string& text) {
           if (const std::string problem = ParseSeamList(text, &arguments.map.seams); !problem.empty()) {
             throw CLI::ValidationError("--seams", problem);
           }
           arguments.map.options.seams = arguments.map.seams.policy;
           arguments.map.options.hard_edge_degrees = arguments.map.seams.hard_edge_degrees;
         },
         "Where to cut: a policy (auto, needed, keep, none) and sources of seams (uv, hard, ...), see Seams below "
         "[auto]")
      ->type_name("LIST");
}

// Adds --preset. Flags on the command line override those of the preset.
void AddPreset(CLI::App& app, UnwrapArguments& arguments) {
  CLI::Option* const preset =
      app.add_option(
             "--preset",
             "lightmap: --output-texcoord=1 --padding=4 --prefer=texture and --seams=auto, or --seams=auto,uv if the "
             "file has UV")
          ->check(CLI::IsMember({"lightmap"}).description(""))
          ->type_name("lightmap");
  app.final_callback([&app, &arguments, preset] {
    if (preset->count() == 0) return;
    if (!arguments.output.texcoord) arguments.output.texcoord = 1;
    if (!arguments.map.options.padding) arguments.map.options.padding = 4;
    if (app.get_option("--seams")->count() > 0) {
      if (app.get_option("--prefer")->count() == 0 && arguments.map.options.seams == Seams::kAuto) {
        arguments.map.options.prefer = Prefer::kTexture;
      }
    } else {
      if (app.get_option("--prefer")->count() == 0) arguments.map.options.prefer = Prefer::kTexture;
      ParseSeamList("auto,uv", &arguments.map.seams);
      arguments.map.seams.uv_is_optional = true;
      arguments.map.options.seams = arguments.map.seams.policy;
    }
  });
}

}  // namespace

void AddFlags(CLI::App& app, UnwrapArguments& arguments) {
  app.footer(kUnwrapExamples);
  app.add_option("IN", arguments.inputs.first,
                 "Mesh file: .obj, .ply, .off, .stl, .gltf, .glb or .drc; - for stdin; or a directory")
      ->required()
      ->type_name("");
  app.add_option("MORE", arguments.inputs.more, "Further files and directories, for a batch; OUT must be a directory")
      ->type_name("");
  UnwrapOptions& options = arguments.map.options;
  AddOutput(app, arguments.output.path, /*takes_batch=*/true);
  AddSeams(app, arguments);
  AddOptionsOfGroup(app, options, "");
  AddReport(app, arguments);
  AddServer(app, arguments.server, "without it a private server is started");
  AddJson(app, arguments.json);

  app.option_defaults()->group("Files");
  AddTexcoord(app, arguments.texcoord);
  AddOutputTexcoord(app, arguments.output.texcoord);
  AddTextures(app, arguments.output.textures);
  AddPreset(app, arguments);
  AddBatch(app, arguments);

  app.option_defaults()->group("Pictures");
  AddPicture(app, arguments);
  AddPreview(app, arguments.output.preview);

  app.option_defaults()->group("Atlas");
  AddOptionsOfGroup(app, options, "Atlas");
  AddAtlases(app, arguments);
  AddWeights(app, arguments.map.material_weights, "charts");

  app.option_defaults()->group("Jobs");
  app.add_flag(
      "--detach", arguments.detach,
      "Queue the job, print its name and exit; fetch the result with jobs watch, or for a batch with the same command");
  AddTimeout(app, arguments.timeout_seconds,
             "Cancel the job and exit if the result has not arrived SECONDS after the command started");
  AddScheduling(app, arguments.scheduling);
  AddLabels(app, arguments.labels, "Label of the job, to find it later; may be repeated [file=the file's name]");

  app.option_defaults()->group("Solver");
  AddOptionsOfGroup(app, options, "Solver");
  AddTerminal(app, arguments.terminal);
  AddProgress(app, arguments.terminal);
}

namespace {

// Checks for options that have no effect in combination with others.
std::string CheckAtlas(const MapArguments& map) {
  const UnwrapOptions& options = map.options;
  if (options.max_stretch != 0 && options.seams != Seams::kAuto) {
    return std::string("--max-stretch is what --seams=auto cuts by; with the policy ") + ToString(options.seams) +
           " no seam is added for stretch (name auto beside the sources, as in --seams=auto,uv)";
  }
  if (options.prefer != UnwrapOptions().prefer && options.seams != Seams::kAuto) {
    return std::string("--prefer is what --seams=auto cuts for; with the policy ") + ToString(options.seams) +
           " it has no effect (name auto beside the sources, as in --seams=auto,uv)";
  }
  if (!options.pack &&
      (options.texture_size != 0 || options.padding || options.tiles != 0 || options.effort != Effort::kNormal)) {
    return "--pack=off leaves charts as they are, so --texture-size, --padding, --tiles and --effort have no effect";
  }
  return "";
}

// Checks for options that cannot be combined with several atlases or with weights.
std::string CheckParts(const UnwrapArguments& arguments) {
  const UnwrapOptions& options = arguments.map.options;
  const bool is_stacked = options.atlas_layout == AtlasLayout::kStacked;
  if (is_stacked && !arguments.map.atlas_per)
    return "--atlas-layout says where the atlases of --atlas-per go; give both";
  if (is_stacked && !arguments.report.empty()) {
    return "--report shows one texture, and --atlas-layout=stacked makes several, on top of each other; leave "
           "one of them out";
  }
  if (!arguments.map.atlas_per && arguments.map.material_weights.empty()) return "";
  const std::string flag = arguments.map.atlas_per ? "--atlas-per" : "--weight";
  if (!options.pack) return flag + " is about charts in an atlas; with --pack=off there is none";
  if (options.seams == Seams::kNone)
    return flag + " needs charts; with --seams=none the mesh is one that fills its tile";
  return "";
}

// Checks for options that a batch does not support.
std::string CheckBatch(const UnwrapArguments& arguments) {
  if (arguments.output.path.empty()) return "where should the results go? A batch needs -o DIRECTORY/";
  if (arguments.output.path == "-") return "-o - takes one mesh; a batch needs -o DIRECTORY/";
  for (const std::string& input : arguments.inputs.All()) {
    if (input == "-") return "- (standard input) is one mesh, and cannot be one of a batch";
  }
  if (!arguments.picture.empty() || !arguments.output.preview.empty()) {
    return "--picture and --preview draw one mesh; of a batch --report=DIR shows all";
  }
  if (!arguments.report.empty() && arguments.detach) {
    return "--detach does not wait for UV, so there is nothing to draw; --report goes with the run that fetches them";
  }
  if (!arguments.map.seams.edge_files.empty() || !arguments.map.seams.uncut_files.empty()) {
    return "--seams=edges:FILE and uncut:FILE list the vertices of one mesh; a batch cannot use them";
  }
  return "";
}

// Checks the input files and sets `arguments.batch`.
std::string CheckInputs(UnwrapArguments& arguments) {
  const std::vector<std::string> inputs = arguments.inputs.All();
  const auto directory = std::find_if(inputs.begin(), inputs.end(), IsDirectory);
  const bool per_file = arguments.map.atlas_per == AtlasPer::kFile;
  if (arguments.one_atlas || per_file) {
    const std::string flag = per_file ? "--atlas-per=file" : "--one-atlas";
    if (directory != inputs.end()) return flag + " takes files; " + *directory + " is a directory";
    if (inputs.size() > 1 && arguments.output.path.empty() && !arguments.detach) {
      return "where should the results go? Several files need -o DIRECTORY/";
    }
  }
  arguments.batch = !arguments.one_atlas && !per_file && (inputs.size() > 1 || directory != inputs.end());
  if (arguments.batch) return CheckBatch(arguments);
  if (!arguments.format.empty()) return "--format is for batches; the name after -o says the format of one file";
  if (arguments.again) return "--again is for batches; one file is always done again";
  return "";
}

std::string CheckDetach(const UnwrapArguments& arguments) {
  if (arguments.detach && arguments.server.address.empty()) {
    return "--detach needs --server (or PLANISH_SERVER): a private server ends with this command, and the job with it";
  }
  if (arguments.batch) return "";
  if (!arguments.detach) return CheckDestination(arguments.output.path, "unwrap", arguments.inputs.first);
  if (!arguments.inputs.more.empty()) {
    return "--detach takes one file where several are one job (--one-atlas, --atlas-per=file): jobs watch could not "
           "write the UV of several";
  }
  if (!(arguments.output.preview.empty() && arguments.picture.empty() && arguments.report.empty())) {
    return "--detach does not wait for UV, so there is nothing to draw; jobs watch JOB --mesh IN -o OUT takes "
           "--preview too";
  }
  if (arguments.output.path.empty()) return "";
  return "--detach does not wait for UV, so there is nothing for -o; fetch them later with: planish jobs watch JOB "
         "--mesh " +
         arguments.inputs.first + " -o " + arguments.output.path;
}

}  // namespace

std::string Check(UnwrapArguments& arguments) {
  // CheckInputs() comes first: it sets `batch`, which later checks use.
  return FirstProblem({CheckInputs(arguments), CheckStreams(arguments.inputs.All()),
                       arguments.batch ? "" : CheckTexcoord(arguments.texcoord, arguments.inputs.first),
                       CheckPreview(arguments.output.preview), CheckStdout(arguments.output.path, arguments.json),
                       CheckPainting(arguments.output.textures), CheckAtlas(arguments.map), CheckParts(arguments),
                       CheckDetach(arguments)});
}

}  // namespace planish::cli
