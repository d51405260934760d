// Checks the UV of a mesh file, and presents the result for `planish check`.
#pragma once

#include <cstdint>
#include <set>
#include <string>
#include <utility>
#include <vector>

#include "client/cli/mesh_input.h"
#include "client/cli/results.h"
#include "core/unwrap/map_check.h"

namespace planish::cli {

// A map with the result of its check. Faces and corners are numbered as in `mesh`, which has only those triangles of
// the file that have finite UV and positions.
struct CheckedMap {
  std::int64_t triangles = 0;                  // of the file
  std::vector<std::int32_t> without_uv;        // triangles of the file with a corner without UV
  std::vector<std::int32_t> not_finite;        // triangles of the file with a position or UV that is NaN or infinite
  Mesh mesh;                                   // vertices as in the file
  std::vector<std::int32_t> triangle_of_face;  // per face of `mesh`: its triangle of the file
  CornerUv uv;
  MapTopology topology;
  std::vector<std::int32_t> first_face_of_chart;
  std::vector<std::int32_t> material_of_face;  // for MapCheckOptions::material_of_face
  MapCheck check;

  bool has_uv() const { return !mesh.faces.empty(); }
};

// Checks the UV of `input`, one file. Materials are taken from the file, not from `options`.
CheckedMap CheckMapOf(const MeshInput& input, const MapCheckOptions& options, const Execution& execution);
// Checks `uv` instead of the file's own UV: 6 numbers a triangle.
CheckedMap CheckMapOf(const MeshInput& input, const CornerUv& uv, const MapCheckOptions& options,
                      const Execution& execution);

enum class Requirement { kUv, kNoOverlap, kNoFlip, kNoMirror, kNoDegenerate, kInTile };
const char* ToString(Requirement requirement);  // "no-overlap", ...

// The requirements of --require, --max-stretch and --min-padding.
struct Requirements {
  std::set<Requirement> required;
  double max_stretch = 0;  // largest L2 stretch of a chart, above 1; 0: no limit
  double min_padding = 0;  // smallest distance of two charts, in texels; 0: no limit
};

struct RequirementResult {
  std::string name;  // "no-overlap", "max-stretch", ...
  bool met = true;
  std::string message;  // why it is not met; empty if it is
};

// The result of each requirement in `wanted`, in the order of the help text. A file without any UV has the single
// result that "uv" is not met.
std::vector<RequirementResult> CheckRequirements(const Requirements& wanted, const CheckedMap& map);
bool AreMet(const std::vector<RequirementResult>& results);

// Names a map: "hero.glb", or "hero.glb TEXCOORD_1" where `uv_set` is not 0.
std::string MapName(const std::string& path, int uv_set);

// The figures of the map as names and values, for people; empty without UV.
std::vector<std::pair<std::string, std::string>> CheckLines(const MeshInput& input, const MapCheckOptions& options,
                                                            const CheckedMap& map);
// The text for people: about twenty lines for any map. `uv_sets`: the UV sets of the file.
std::string CheckText(const MeshInput& input, int uv_set, const std::vector<int>& uv_sets,
                      const MapCheckOptions& options, const CheckedMap& map,
                      const std::vector<RequirementResult>& results);
// For programs; the fields are described in client/JSON.md.
Json CheckJson(const MeshInput& input, int uv_set, const std::vector<int>& uv_sets, const MapCheckOptions& options,
               const CheckedMap& map, const std::vector<RequirementResult>& results);

}  // namespace planish::cli
