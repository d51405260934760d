#include "client/cli/pack_command.h"

#include <algorithm>
#include <cmath>
#include <cstddef>
#include <cstdint>
#include <functional>
#include <iostream>
#include <optional>
#include <utility>
#include <vector>

#include "client/cli/exit_codes.h"
#include "client/cli/flags.h"
#include "client/cli/image_work.h"
#include "client/cli/mesh_input.h"
#include "client/cli/option_flags.h"
#include "client/cli/repack.h"
#include "client/cli/results.h"
#include "client/cli/session.h"
#include "client/cli/text.h"
#include "core/base/timer.h"

namespace planish::cli {

void AddFlags(CLI::App& app, PackArguments& arguments) {
  app.footer(
      "Needs no server. Islands are only moved, rotated and scaled: mirrored islands stay mirrored, and overlaps "
      "within an island\nremain. Exit codes: 0 packed, 1 the file has no UV, or its islands cannot be packed, 2 bad "
      "usage or unreadable file.");
  app.add_option("IN", arguments.input, "Mesh file with UV, as for unwrap")->required()->type_name("");
  AddOutput(app, arguments.output.path, /*takes_batch=*/false);
  AddOptions(app, arguments.options, {"texture_size", "texels_per_unit", "padding", "effort", "tiles"});
  app.add_option_function<std::string>(
         "--density", [&arguments](const std::string& word) { arguments.keep_density = word == "keep"; },
         "equal: the same texel density on the surface for every island; keep: islands keep their sizes relative to "
         "each other")
      ->check(CLI::IsMember({"equal", "keep"}).description(""))
      ->type_name("equal|keep");
  AddWeights(app, arguments.material_weights, "islands");
  AddTexcoord(app, arguments.texcoord);
  AddOutputTexcoord(app, arguments.output.texcoord);
  AddTextures(app, arguments.output.textures);
  AddPreview(app, arguments.output.preview);
  AddJson(app, arguments.json);
  AddTerminal(app, arguments.terminal);
  AddProgress(app, arguments.terminal);
}

namespace {

std::string CheckPadding(const UnwrapOptions& options) {
  const int size = options.texture_size != 0 ? options.texture_size : 1024;
  const int padding = options.padding.value_or(2);
  if (2 * ((padding + 1) / 2) < size) return "";
  return "--padding=" + std::to_string(padding) + " leaves no room in a tile of " + std::to_string(size) + " texels";
}

std::string CheckDensity(const PackArguments& arguments) {
  if (!arguments.keep_density || arguments.options.texels_per_unit == 0) return "";
  return "--texels-per-unit gives all islands one density, and --density=keep keeps theirs; leave one of them out";
}

}  // namespace

std::string Check(PackArguments& arguments) {
  return FirstProblem({CheckTexcoord(arguments.texcoord, arguments.input), CheckPreview(arguments.output.preview),
                       CheckStdout(arguments.output.path, arguments.json), CheckPainting(arguments.output.textures),
                       CheckDestination(arguments.output.path, "pack", arguments.input),
                       CheckPadding(arguments.options), CheckDensity(arguments)});
}

namespace {

constexpr std::size_t kMaxNamedFaces = 8;

// Throws an error such as "9 faces have no UV" if at_fault(t) is true for any triangle t. The error counts and names
// the file's faces, each once. `one` and `many`: the words after "1 face" and "9 faces".
void RefuseFaces(const MeshInput& input, const std::string& reason, const std::string& one, const std::string& many,
                 const std::function<bool(std::size_t)>& at_fault) {
  std::int64_t count = 0, last = -1;
  std::string ids;
  for (std::size_t t = 0; t < input.mesh().faces.size(); ++t) {
    const std::int64_t face = input.triangulation().source_polygon[t];
    if (face == last || !at_fault(t)) continue;
    last = face;
    if (++count <= static_cast<std::int64_t>(kMaxNamedFaces)) ids += (ids.empty() ? "" : ",") + std::to_string(face);
  }
  if (count == 0) return;
  throw Error(ErrorCode::kInvalidArgument, reason, input.path() + ": " + Counted(count, "face " + one, "faces " + many),
              {{count == 1 ? "face" : "faces", ids}});
}

// Throws if some faces have no finite UV and positions, or if there are no faces.
void CheckUv(const MeshInput& input, const PackArguments& arguments) {
  const Mesh& mesh = input.mesh();
  if (mesh.faces.empty()) {
    throw Error(ErrorCode::kInvalidArgument, "MESH_EMPTY", input.path() + ": no faces; there is nothing to pack");
  }
  const std::vector<std::int32_t> ids = input.CornerTexcoords();
  if (std::all_of(ids.begin(), ids.end(), [](std::int32_t id) { return id < 0; })) {
    throw Error(ErrorCode::kInvalidArgument, "UV_MISSING",
                input.path() + " has no UV" +
                    (arguments.texcoord > 0 ? " number " + std::to_string(arguments.texcoord) : "") +
                    "; pack moves those that there are, planish unwrap makes them");
  }
  RefuseFaces(input, "UV_MISSING", "has no UV", "have no UV", [&](std::size_t t) {
    return std::min({ids[3 * t], ids[3 * t + 1], ids[3 * t + 2]}) < 0;
  });
  const std::vector<double> uv = input.CornerUv();
  RefuseFaces(input, "UV_NOT_FINITE", "has UV at NaN or infinity", "have UV at NaN or infinity", [&](std::size_t t) {
    return !std::all_of(uv.begin() + 6 * static_cast<std::ptrdiff_t>(t),
                        uv.begin() + 6 * static_cast<std::ptrdiff_t>(t + 1), [](double x) { return std::isfinite(x); });
  });
  RefuseFaces(input, "MESH_POSITION_NOT_FINITE", "has a vertex at NaN or infinity", "have vertices at NaN or infinity",
              [&](std::size_t t) {
                return !std::all_of(mesh.faces[t].begin(), mesh.faces[t].end(),
                                    [&](std::int32_t v) { return mesh.positions[v].allFinite(); });
              });
}

std::vector<Warning> WarningsOf(const Repacking& done, const PackOptions& atlas) {
  std::vector<Warning> warnings;
  if (done.packing.padding < atlas.padding) {
    warnings.push_back({"PADDING_REDUCED",
                        Counted(atlas.padding, "texel", "texels") + " between so many islands leave no room: " +
                            Significant(done.packing.padding, 3) + " are kept; give more texels or tiles",
                        {}});
  }
  if (done.without_area > 0) {
    warnings.push_back({"UV_WITHOUT_AREA",
                        Counted(done.without_area, "island has", "islands have") + " no area in the map: " +
                            (done.without_area == 1 ? "its" : "their") + " UV lie on a line or a point",
                        {}});
  }
  if (done.lost_to_rounding > 0) {
    warnings.push_back({"UV_PRECISION",
                        "rounding to float turned or flattened " +
                            Counted(done.lost_to_rounding, "triangle", "triangles") + " that had some area",
                        {}});
  }
  return warnings;
}

std::string DensityText(const PackArguments& arguments, const Repacking& done) {
  const std::string weighted = arguments.material_weights.empty() ? "" : ", times the weights given";
  if (arguments.keep_density) return ", sizes kept relative to each other" + weighted;
  if (done.texels_per_unit == 0) return "";
  return ", " + Significant(done.texels_per_unit, 3) + " texels per unit of length" + weighted;
}

// The summary for people.
std::string PackSummary(const PackArguments& arguments, const PackOptions& atlas, const Repacking& done, double seconds,
                        const std::vector<Warning>& warnings) {
  const std::string size = WithCommas(atlas.texture_size);
  std::string text = "Packed " + Counted(done.islands, "island", "islands") +
                     (done.mirrored > 0 ? " (" + WithCommas(done.mirrored) + " mirrored)" : "") + " in " +
                     Duration(seconds) + (arguments.output.path == "-" ? "" : " into " + arguments.output.path) + ": " +
                     Counted(done.packing.tiles, "tile", "tiles") + " of " + size + " x " + size + " texels, " +
                     Fixed(100 * done.covered, 0) + " % of them used, " + Significant(done.packing.padding, 3) +
                     (done.packing.padding == 1 ? " texel" : " texels") + " between islands" +
                     DensityText(arguments, done) + ".\n";
  for (const Warning& warning : warnings) text += "warning: " + warning.message + " [" + warning.reason + "]\n";
  return ForTerminal(PrintableLines(text, true), StderrTerminal());
}

Json PackJson(const MeshInput& input, const PackArguments& arguments, const PackOptions& atlas, const Repacking& done,
              double pack_seconds, double seconds, const std::vector<Warning>& warnings) {
  Json json = {{"file", input.path()},
               {"input", {{"triangles", input.view().triangle_count()}, {"vertices", input.view().vertex_count()}}},
               {"islands", done.islands},
               {"mirrored", done.mirrored},
               {"density", arguments.keep_density ? "keep" : "equal"},
               {"weights", arguments.material_weights},
               {"atlas",
                {{"texture_size", atlas.texture_size},
                 {"padding", atlas.padding},
                 {"padding_kept", done.packing.padding},
                 {"tiles", done.packing.tiles},
                 {"effort", ToString(arguments.options.effort)},
                 {"texels_per_unit", done.texels_per_unit}}},
               {"packing_efficiency", done.covered},
               {"seconds", {{"pack", pack_seconds}, {"total", seconds}}},
               {"warnings", Json::array()}};
  for (const Warning& warning : warnings) {
    json["warnings"].push_back({{"reason", warning.reason}, {"message", warning.message}});
  }
  if (arguments.output.path != "-") json["output"] = arguments.output.path;
  return json;
}

int Fail(const PackArguments& arguments, const MeshInput* input, const Error& error, double seconds) {
  std::cerr << ErrorText(error, Places(error.metadata(), input), StderrTerminal());
  if (arguments.json) {
    Failure failure = FailureOf(error);
    if (input != nullptr) {
      failure.triangles = input->view().triangle_count();
      failure.vertices = input->view().vertex_count();
    }
    failure.total_seconds = seconds;
    std::cout << ToText(ReportJson(failure)) << std::flush;
  }
  return ExitCodeOf(error);
}

PackEffort ToPackEffort(Effort effort) {
  switch (effort) {
    case Effort::kFast:
      return PackEffort::kFast;
    case Effort::kNormal:
      return PackEffort::kNormal;
    case Effort::kBest:
      return PackEffort::kBest;
  }
  return PackEffort::kNormal;
}

int PackFile(const MeshInput& input, const PackArguments& arguments, Interrupts& interrupts, const Timer& timer) {
  CheckUv(input, arguments);
  const std::vector<OutputOptions> outputs =
      input.Outputs(arguments.output.path, arguments.texcoord, arguments.output.texcoord, arguments.output.textures);
  if (!arguments.output.preview.empty()) CheckOutput(arguments.output.preview);

  RepackOptions options;
  options.keep_density = arguments.keep_density;
  options.texels_per_unit = arguments.options.texels_per_unit;
  options.finds_texture_size = arguments.options.texture_size == 0;
  options.face_weights = input.FaceWeights(arguments.material_weights);
  const int texture_side = input.TextureSideEstimate(outputs);
  if (texture_side > 0 && arguments.options.tiles > 1) {
    throw Error(ErrorCode::kInvalidArgument, "OPTIONS_INVALID",
                input.path() +
                    ": its images move into the new map, which must be one tile: leave --tiles out, or give "
                    "--textures=keep or --textures=drop",
                {{"field", "textures"}});
  }
  if (texture_side > 0) options.atlas.texture_size = texture_side;
  if (arguments.options.texture_size != 0) options.atlas.texture_size = arguments.options.texture_size;
  options.atlas.padding = arguments.options.padding.value_or(options.atlas.padding);
  options.atlas.effort = ToPackEffort(arguments.options.effort);
  if (arguments.options.tiles != 0) options.atlas.tiles = arguments.options.tiles;

  const Timer pack_timer;
  Repacking done;
  const bool is_interrupted = IsInterruptedIn(interrupts, [&](const Execution& execution) {
    done = Repack(input.mesh(), input.CornerUv(), input.triangulation().source_polygon, options, execution);
  });
  options.atlas.texture_size = done.texture_size;
  const double pack_seconds = pack_timer.Seconds();
  if (is_interrupted) throw Error(ErrorCode::kCancelled, "CANCELLED", "interrupted");

  const Uv uv(std::move(done.uv));
  std::vector<Warning> warnings = WarningsOf(done, options.atlas);
  WrittenMesh written;
  DrawImages(arguments.terminal, input.path(), interrupts,
             input.WithTextureSize(outputs, arguments.options.texture_size, options.atlas.texture_size,
                                   static_cast<int>(options.atlas.padding), {}),
             [&](const std::vector<OutputOptions>& watched) { written = input.WithUv(uv, watched); });
  for (const OutputWarning& warning : written.warnings) warnings.push_back({warning.reason, warning.message, {}});
  WriteAll(written.files, interrupts);
  if (!arguments.output.preview.empty())
    WriteOutput(arguments.output.preview, input.Preview(uv, arguments.output.preview, true));

  const double seconds = timer.Seconds();
  if (!arguments.terminal.quiet) std::cerr << PackSummary(arguments, options.atlas, done, seconds, warnings);
  if (arguments.json) {
    std::cout << ToText(PackJson(input, arguments, options.atlas, done, pack_seconds, seconds, warnings)) << std::flush;
  }
  return kOk;
}

}  // namespace

int Run(const PackArguments& arguments, Interrupts& interrupts) {
  const Timer timer;
  std::optional<MeshInput> input;
  try {
    input.emplace(std::vector<std::string>{arguments.input}, arguments.texcoord);
    return PackFile(*input, arguments, interrupts, timer);
  } catch (const Error& error) {
    if (interrupts.interrupted()) return Interrupted(arguments.json, error, timer.Seconds());
    return Fail(arguments, input ? &*input : nullptr, error, timer.Seconds());
  }
}

}  // namespace planish::cli
