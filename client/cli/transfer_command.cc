#include "client/cli/transfer_command.h"

#include <algorithm>
#include <array>
#include <bit>
#include <cstdint>
#include <iostream>
#include <optional>
#include <sstream>
#include <string>
#include <unordered_map>
#include <utility>
#include <vector>

#include "client/cli/exit_codes.h"
#include "client/cli/flags.h"
#include "client/cli/image_work.h"
#include "client/cli/mesh_input.h"
#include "client/cli/results.h"
#include "client/cli/session.h"
#include "client/cli/text.h"
#include "client/files/surface_projection.h"
#include "client/src/errors.h"
#include "core/base/timer.h"
#include "core/pack/pack.h"

namespace planish::cli {

void AddFlags(CLI::App& app, TransferArguments& arguments) {
  app.footer(
      "Needs no server. OUT is the model FROM with the UV of TO, and with FROM's images redrawn for these UV. Both "
      "files must have\nthe same triangles, in any order; TO may be FROM unwrapped by another program, for example. "
      "With --project the triangles may\ndiffer. Exit codes: 0 written, 1 the surfaces differ or TO has no UV, 2 bad "
      "usage or an unreadable file or image.");
  app.add_option("FROM", arguments.from, "Model with images: .gltf, .glb, or .obj with its material files")
      ->required()
      ->type_name("");
  app.add_option("TO", arguments.to, "Mesh file with the new UV")->required()->expected(1)->type_name("");
  AddOutput(app, arguments.output, /*takes_batch=*/false);
  app.add_option("--texture-size", arguments.texture_size,
                 "Texels per side of the new images, 16 to 65536 [as many as keep the texel density of FROM's images]")
      ->check(CLI::Range(16, 65536).description(""))
      ->type_name("N");
  app.add_option("--texcoord", arguments.texcoord, "UV set of TO to use: TEXCOORD_N of a glTF, N up to 63 [0]")
      ->check(CLI::Range(0, kLargestTexcoord).description(""))
      ->type_name("N");
  app.add_option_function<int>(
         "--output-texcoord", [&arguments](const int& n) { arguments.output_texcoord = n; },
         "UV set of FROM that the new UV replace, TEXCOORD_N [0]")
      ->check(CLI::Range(0, kLargestTexcoord).description(""))
      ->type_name("N");
  app.add_flag("--project", arguments.project,
               "For two surfaces that differ but lie close together, such as a scan and its decimated copy: write TO "
               "(as .glb or .gltf) with images baked from FROM");
  app.add_option("--bake", arguments.bake_list,
                 "Images to bake, separated by commas. With --project: colors, normals, height (a file beside OUT), "
                 "occlusion [colors,normals]. Without it: colors, the vertex colours [nothing]")
      ->type_name("LIST");
  app.add_option("--cage", arguments.cage_percent,
                 "With --project: the largest distance between the surfaces, in percent of the diagonal of TO's "
                 "bounding box [1]")
      ->check(CLI::Range(0.001, 100.0).description(""))
      ->type_name("PERCENT");
  app.add_option("--occlusion-distance", arguments.occlusion_percent,
                 "With --bake=occlusion: the distance up to which FROM hides the sky from itself, in percent of the "
                 "diagonal of FROM's bounding box [100: any distance]")
      ->check(CLI::Range(0.001, 100.0).description(""))
      ->type_name("PERCENT");
  AddImageFlags(app, arguments.textures);
  AddJson(app, arguments.json);
  AddTerminal(app, arguments.terminal);
  AddProgress(app, arguments.terminal);
}

std::string Check(TransferArguments& arguments) {
  if (arguments.project && arguments.textures.merge_materials) {
    return "--project makes one material of its own; leave --merge-materials out";
  }
  std::istringstream list(arguments.bake_list);
  for (std::string what; std::getline(list, what, ',');) {
    if (what != "colors" && what != "normals" && what != "height" && what != "occlusion") {
      return "--bake: " + Printable(what, true) + " is none of colors, normals, height, occlusion";
    }
    arguments.bake.push_back(what);
  }
  if (!arguments.project) {
    for (const std::string& what : arguments.bake) {
      if (what != "colors") return "--bake=" + what + " is for --project: the images of FROM move anyway";
    }
    arguments.textures.bake_colors = !arguments.bake.empty();
  }
  return FirstProblem({CheckStreams({arguments.from, arguments.to}), CheckStdout(arguments.output, arguments.json),
                       CheckDestination(arguments.output, "transfer", arguments.from)});
}

namespace {

// Positions of corners, rounded to float, so that an OBJ and a glTF have equal numbers.
using Place = std::array<std::uint32_t, 3>;
using PlacesOfFace = std::array<Place, 3>;

struct HashOfPlaces {
  std::size_t operator()(const PlacesOfFace& places) const {
    std::uint64_t hash = 0;
    for (const Place& place : places) {
      for (const std::uint32_t x : place) hash = (std::rotl(hash, 23) ^ x) * 0x9E3779B97F4A7C15;
    }
    return static_cast<std::size_t>(hash ^ hash >> 32);
  }
};

// The positions of the corners of a face, rotated so that the least comes first, and the corner that it belongs to.
std::pair<PlacesOfFace, int> FromLeastPlace(const Mesh& mesh, const Face& face) {
  PlacesOfFace places;
  for (std::size_t k = 0; k < 3; ++k) {
    const Vec3& p = mesh.positions[static_cast<std::size_t>(face[k])];
    // Adding zero turns -0 into 0.
    for (int axis = 0; axis < 3; ++axis) {
      places[k][static_cast<std::size_t>(axis)] = std::bit_cast<std::uint32_t>(static_cast<float>(p[axis]) + 0.0F);
    }
  }
  const auto least = std::min_element(places.begin(), places.end());
  const int first = static_cast<int>(least - places.begin());
  std::rotate(places.begin(), least, places.end());
  return {places, first};
}

// For each corner of the faces of `to`: the UV of `from` at that corner, 6 numbers a face. Duplicate faces are paired
// in order. Throws SURFACES_DIFFER.
std::vector<double> UvOfTheSameFaces(const MeshInput& to, const MeshInput& from) {
  struct Faces {
    std::vector<std::size_t> list;
    std::size_t next = 0;
  };
  std::unordered_map<PlacesOfFace, Faces, HashOfPlaces> faces;
  const Mesh& source = from.mesh();
  for (std::size_t f = 0; f < source.faces.size(); ++f)
    faces[FromLeastPlace(source, source.faces[f]).first].list.push_back(f);
  const std::vector<double> uv = from.CornerUv();
  const Mesh& mesh = to.mesh();
  std::vector<double> result(6 * mesh.faces.size());
  std::int64_t missing = 0;
  std::int64_t first_missing = -1;
  for (std::size_t f = 0; f < mesh.faces.size(); ++f) {
    const auto [places, first] = FromLeastPlace(mesh, mesh.faces[f]);
    const auto found = faces.find(places);
    if (found == faces.end() || found->second.list.empty()) {
      if (missing++ == 0) first_missing = static_cast<std::int64_t>(f);
      continue;
    }
    Faces& alike = found->second;
    const std::size_t other = alike.list[std::min(alike.next++, alike.list.size() - 1)];
    const int first_there = FromLeastPlace(source, source.faces[other]).second;
    for (int k = 0; k < 3; ++k) {
      const auto here = 6 * f + 2 * static_cast<std::size_t>((first + k) % 3);
      const auto there = 6 * other + 2 * static_cast<std::size_t>((first_there + k) % 3);
      result[here] = uv[there];
      result[here + 1] = uv[there + 1];
    }
  }
  if (missing > 0) {
    throw Error(ErrorCode::kInvalidArgument, "SURFACES_DIFFER",
                Counted(missing, "triangle", "triangles") + " of " + to.path() + " " + (missing == 1 ? "is" : "are") +
                    " not in " + from.path() + ", the first of " + to.Place("face", to.PolygonOf(first_missing)) +
                    ": both files must have the same triangles, in any order; --project moves images between surfaces "
                    "that only lie close",
                {{"count", std::to_string(missing)}});
  }
  return result;
}

// Reads TO, which must have UV; `use` explains in the error why.
MeshInput ReadTarget(const TransferArguments& arguments, const std::string& use) {
  MeshInput to({arguments.to}, arguments.texcoord);
  if (to.CornerTexcoords().empty()) {
    throw Error(ErrorCode::kInvalidArgument, "UV_MISSING", to.path() + ": has no UV, and they are " + use);
  }
  return to;
}

// Prints the warnings and `summary` for people, and `json` with the files and warnings.
void Say(const TransferArguments& arguments, const WrittenMesh& written, const std::string& summary, Json json) {
  if (!arguments.terminal.quiet) {
    for (const OutputWarning& warning : written.warnings) {
      std::cerr << "planish: " + Printable(warning.message, true) + " [" + warning.reason + "]\n";
    }
    std::cerr << summary + "\n";
  }
  if (!arguments.json) return;
  json["files"] = Json::array();
  for (const OutputFile& file : written.files) json["files"].push_back(file.path);
  json["warnings"] = Json::array();
  for (const OutputWarning& warning : written.warnings) {
    json["warnings"].push_back({{"reason", warning.reason}, {"message", warning.message}});
  }
  std::cout << ToText(json) << std::flush;
}

// Fraction of missed texels above which there is a warning.
constexpr double kManyMissed = 0.005;

int ProjectFile(const TransferArguments& arguments, Interrupts& interrupts, const Timer& timer) {
  const MeshInput from({arguments.from}, 0);
  const MeshInput to = ReadTarget(arguments, "where the images go");
  TextureArguments limits = arguments.textures;
  limits.textures = Textures::kDrop;  // images of TO are replaced
  OutputOptions output = to.Outputs(arguments.output, arguments.texcoord, 0, limits).front();
  SurfaceProjectionOptions options;
  options.cage = arguments.cage_percent / 100;
  options.occlusion_reach = arguments.occlusion_percent / 100;
  if (arguments.texture_size != 0) options.size = arguments.texture_size;
  const auto bakes = [&arguments](const char* what) {
    return std::find(arguments.bake.begin(), arguments.bake.end(), what) != arguments.bake.end();
  };
  if (!arguments.bake.empty()) {
    options.colors = bakes("colors");
    options.normals = bakes("normals");
    options.height = bakes("height");
    options.occlusion = bakes("occlusion");
  }
  std::optional<ProjectedMesh> projected;
  DrawImages(arguments.terminal, to.path(), interrupts, {output}, [&](const std::vector<OutputOptions>& watched) {
    absl::StatusOr<ProjectedMesh> done = ProjectSurface(from.file(), to.file(), watched.front(), options);
    if (!done.ok()) throw ErrorFrom(done.status());
    projected = *std::move(done);
  });
  WriteAll(projected->written.files, interrupts);
  const double missed =
      static_cast<double>(projected->missed) / static_cast<double>(std::max<std::int64_t>(1, projected->texels));
  WrittenMesh written = std::move(projected->written);
  if (missed > kManyMissed) {
    written.warnings.push_back(
        {"PROJECTION_MISSED", Significant(100 * missed, 2) + " % of the texels found nothing of " + from.path() +
                                  " within the cage, and have the colours of their neighbours; --cage "
                                  "makes it wider"});
  }
  if (bakes("colors") && !projected->Has("colors")) {
    written.warnings.push_back({"COLORS_MISSING", from.path() + " has no colours to bake"});
  }
  std::string shown;
  for (const std::string& what : projected->baked) shown += (shown.empty() ? "" : ", ") + what;
  std::string summary = Printable(to.path(), true) + " shows " + (shown.empty() ? "nothing" : shown) + " of " +
                        Printable(from.path(), true) + " in " + Printable(arguments.output, true) + ".";
  Json json = {{"triangles", to.mesh().faces.size()},
               {"texels", projected->texels},
               {"missed", projected->missed},
               {"baked", projected->baked},
               {"seconds", {{"total", timer.Seconds()}}}};
  if (projected->height) {
    const HeightImage& height = *projected->height;
    json["height"] = {{"file", height.path}, {"low", height.low}, {"high", height.high}};
    summary += " " + Printable(height.path, true) + ": black is " + Significant(height.low, 4) + " above it, white " +
               Significant(height.high, 4) + ".";
  }
  Say(arguments, written, summary, std::move(json));
  return kOk;
}

int TransferFile(const TransferArguments& arguments, Interrupts& interrupts, const Timer& timer) {
  const MeshInput from({arguments.from}, 0);
  const MeshInput to = ReadTarget(arguments, "what it is read for");
  const std::vector<OutputOptions> outputs =
      from.Outputs(arguments.output, 0, arguments.output_texcoord, arguments.textures);
  const std::vector<double> numbers = UvOfTheSameFaces(from, to);
  const bool is_float = IsFloatByNature(outputs.front().format);
  const Uv uv = is_float ? Uv(std::vector<float>(numbers.begin(), numbers.end())) : Uv(numbers);
  WrittenMesh written;
  // Nothing says for which size the charts of TO were packed: as large as by default, so that they stay apart.
  const PackOptions packed;
  DrawImages(arguments.terminal, from.path(), interrupts,
             from.WithTextureSize(outputs, arguments.texture_size, packed.texture_size, packed.padding, {}),
             [&](const std::vector<OutputOptions>& watched) { written = from.WithUv(uv, watched); });
  WriteAll(written.files, interrupts);
  Say(arguments, written,
      Counted(static_cast<std::int64_t>(from.mesh().faces.size()), "triangle", "triangles") + " of " +
          Printable(from.path(), true) + " have the UV of " + Printable(to.path(), true) + " in " +
          Printable(arguments.output, true) + ", " +
          Counted(static_cast<std::int64_t>(written.files.size()), "file", "files") + " written.",
      {{"triangles", from.mesh().faces.size()}, {"seconds", {{"total", timer.Seconds()}}}});
  return kOk;
}

}  // namespace

int Run(const TransferArguments& arguments, Interrupts& interrupts) {
  const Timer timer;
  try {
    return arguments.project ? ProjectFile(arguments, interrupts, timer) : TransferFile(arguments, interrupts, timer);
  } catch (const Error& error) {
    if (!interrupts.interrupted()) throw;
    return Interrupted(arguments.json, error, timer.Seconds());
  }
}

}  // namespace planish::cli
