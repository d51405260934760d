#include <algorithm>
#include <cmath>
#include <cstdint>
#include <functional>
#include <iostream>
#include <map>
#include <memory>
#include <optional>
#include <set>
#include <string>
#include <thread>
#include <vector>

#include "client/cli/commands.h"
#include "client/cli/exit_codes.h"
#include "client/cli/json.h"
#include "client/cli/mesh_input.h"
#include "client/cli/numbers.h"
#include "client/cli/repack.h"
#include "client/cli/summary.h"
#include "client/cli/terminal.h"
#include "client/cli/text_width.h"
#include "core/base/timer.h"

namespace planish::cli {
namespace {

constexpr std::size_t kMaxNamedFaces = 8;

// "faces 3, 4 and 7 more have no UV": throws if any triangle is `at_fault`, with the file's faces, each once.
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
  const std::string more = count > static_cast<std::int64_t>(kMaxNamedFaces) ? ", ..." : "";
  throw Error(ErrorCode::kInvalidArgument, reason,
              input.path() + ": " + Counted(count, "face " + one, "faces " + many) + " (" + ids + more + ")",
              {{count == 1 ? "face" : "faces", ids}});
}

// Throws for what has no islands to pack.
void CheckUv(const MeshInput& input, const Arguments& arguments) {
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

// Per face of the input what its material weighs; empty without weights. Throws for materials that there are not.
std::vector<double> FaceWeights(const MeshInput& input, const std::map<std::string, double>& material_weights) {
  if (material_weights.empty()) return {};
  const std::vector<std::string> names = input.MaterialNames();
  for (const auto& [name, weight] : material_weights) {
    if (std::find(names.begin(), names.end(), name) != names.end()) continue;
    std::string list;
    for (const std::string& known : std::set<std::string>(names.begin(), names.end())) {
      list += (list.empty() ? "" : ", ") + known;
    }
    throw Error(ErrorCode::kInvalidArgument, "MATERIAL_UNKNOWN",
                "--weight=" + name + ": " + input.path() + " has no such material" +
                    (list.empty() ? ", nor any other" : "; it has " + list),
                {{"material", name}});
  }
  std::vector<double> weights;
  for (const std::int32_t material : input.FaceMaterials()) {
    const auto found = material < 0 ? material_weights.end() : material_weights.find(names[material]);
    weights.push_back(found == material_weights.end() ? 1 : found->second);
  }
  return weights;
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

std::string DensityText(const Arguments& arguments, const Repacking& done) {
  const std::string weighted = arguments.material_weights.empty() ? "" : ", times the weights given";
  if (arguments.keep_density) return ", sizes kept relative to each other" + weighted;
  if (done.texels_per_unit == 0) return "";
  return ", " + Significant(done.texels_per_unit, 3) + " texels per unit of length" + weighted;
}

// What was done, for people.
std::string PackSummary(const Arguments& arguments, const PackOptions& atlas, const Repacking& done, double seconds,
                        const std::vector<Warning>& warnings) {
  const std::string size = WithCommas(atlas.texture_size);
  std::string text = "Packed " + Counted(done.islands, "island", "islands") +
                     (done.mirrored > 0 ? " (" + WithCommas(done.mirrored) + " mirrored)" : "") + " in " +
                     Duration(seconds) + (arguments.output == "-" ? "" : " into " + arguments.output) + ": " +
                     Counted(done.packing.tiles, "tile", "tiles") + " of " + size + " x " + size + " texels, " +
                     Fixed(100 * done.covered, 0) + " % covered, " + Significant(done.packing.padding, 3) +
                     (done.packing.padding == 1 ? " texel" : " texels") + " between islands" +
                     DensityText(arguments, done) + ".\n";
  for (const Warning& warning : warnings) text += "warning: " + warning.message + " [" + warning.reason + "]\n";
  return PrintableLines(text, true);
}

Json PackJson(const MeshInput& input, const Arguments& arguments, const PackOptions& atlas, const Repacking& done,
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
  if (arguments.output != "-") json["output"] = arguments.output;
  return json;
}

int Fail(const Arguments& arguments, const MeshInput* input, const Error& error, double seconds) {
  std::cerr << ErrorText(error, input != nullptr ? input->Places(error.metadata()) : "", StderrTerminal());
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

int PackFile(const MeshInput& input, const Arguments& arguments, Interrupts& interrupts, const Timer& timer) {
  CheckUv(input, arguments);
  const std::vector<OutputOptions> outputs = input.Outputs(arguments.output, arguments.OutputTexcoord());
  if (!arguments.preview.empty()) CheckOutput(arguments.preview);

  RepackOptions options;
  options.keep_density = arguments.keep_density;
  options.face_weights = FaceWeights(input, arguments.material_weights);
  if (arguments.options.texture_size != 0) options.atlas.texture_size = arguments.options.texture_size;
  options.atlas.padding = arguments.options.padding.value_or(options.atlas.padding);
  options.atlas.effort = ToPackEffort(arguments.options.effort);
  if (arguments.options.tiles != 0) options.atlas.tiles = arguments.options.tiles;

  const auto interrupter = std::make_shared<Interrupter>();
  ThreadTeam team(std::max(1, static_cast<int>(std::thread::hardware_concurrency())));
  Execution execution;
  execution.team = &team;
  execution.cancel = interrupter.get();
  interrupts.SetCancel([interrupter] { interrupter->Interrupt(); });
  const Timer pack_timer;
  Repacking done = Repack(input.mesh(), input.CornerUv(), input.triangulation().source_polygon, options, execution);
  const double pack_seconds = pack_timer.Seconds();
  interrupts.SetCancel({});
  if (interrupter->IsInterrupted()) {
    std::cerr << "planish: interrupted; nothing was written\n";
    if (arguments.json) {
      Failure failure = FailureOf(Error(ErrorCode::kCancelled, "CANCELLED", "interrupted"));
      failure.total_seconds = timer.Seconds();
      std::cout << ToText(ReportJson(failure)) << std::flush;
    }
    return kInterrupted;
  }

  const Uv uv(std::move(done.uv));
  std::vector<Warning> warnings = WarningsOf(done, options.atlas);
  const WrittenMesh written = input.WithUv(uv, outputs);
  for (const OutputWarning& warning : written.warnings) warnings.push_back({warning.reason, warning.message, {}});
  for (const OutputFile& file : written.files) WriteOutput(file.path, file.bytes);
  if (!arguments.preview.empty()) WriteOutput(arguments.preview, input.Preview(uv, arguments.preview, true));

  const double seconds = timer.Seconds();
  if (!arguments.quiet) std::cerr << PackSummary(arguments, options.atlas, done, seconds, warnings);
  if (arguments.json) {
    std::cout << ToText(PackJson(input, arguments, options.atlas, done, pack_seconds, seconds, warnings)) << std::flush;
  }
  return kOk;
}

}  // namespace

int RunPack(const Arguments& arguments, Interrupts& interrupts) {
  const Timer timer;
  std::optional<MeshInput> input;
  try {
    input.emplace(std::vector<std::string>{arguments.input}, arguments.texcoord);
    return PackFile(*input, arguments, interrupts, timer);
  } catch (const Error& error) {
    return Fail(arguments, input ? &*input : nullptr, error, timer.Seconds());
  }
}

}  // namespace planish::cli
