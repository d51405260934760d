// The UV that a mesh file has, judged, and what `planish check` has to say about them.
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

// A map with the result of its check. Face and corner numbers refer to `mesh`, which has those triangles of the file
// that have UV.
struct CheckedMap {
  std::int64_t triangles = 0;                  // of the file
  std::vector<std::int32_t> without_uv;        // triangles of the file with a corner without UV
  std::vector<std::int32_t> not_finite;        // some position or UV is NaN or infinite
  Mesh mesh;                                   // vertices as in the file
  std::vector<std::int32_t> triangle_of_face;  // of the file
  CornerUv uv;
  MapTopology topology;
  std::vector<std::int32_t> first_face_of_chart;
  std::vector<std::int32_t> material_of_face;  // as MapCheckOptions has them
  MapCheck check;

  bool has_uv() const { return !mesh.faces.empty(); }
};

// Judges the UV of `input`, one file. Of `options` all but the materials are taken.
CheckedMap CheckMapOf(const MeshInput& input, const MapCheckOptions& options, const Execution& execution);
// The same for UV that are not the file's: 6 numbers a triangle, all finite.
CheckedMap CheckMapOf(const MeshInput& input, const CornerUv& uv, const MapCheckOptions& options,
                      const Execution& execution);

enum class Requirement { kUv, kNoOverlap, kNoFlip, kNoMirror, kNoDegenerate, kInTile };
const char* ToString(Requirement requirement);  // "no-overlap", ...

// What a map must be like.
struct Requirements {
  std::set<Requirement> required;
  double max_stretch = 0;  // L2 stretch of any chart, above 1; 0: any
  double min_padding = 0;  // texels between any two charts; 0: any
};

struct RequirementResult {
  std::string name;  // "no-overlap", "max-stretch", ...
  bool met = true;
  std::string message;  // if not met: what there is instead
};

// The results of the requirements, in the order of the flags' help. A file without any UV always fails.
std::vector<RequirementResult> CheckRequirements(const Requirements& wanted, const CheckedMap& map);
bool AreMet(const std::vector<RequirementResult>& results);

// Names a map: "hero.glb", or "hero.glb TEXCOORD_1" where `uv_set` is not 0.
std::string MapName(const std::string& path, int uv_set);

// What the map is like, as names and values; nothing without UV.
std::vector<std::pair<std::string, std::string>> CheckLines(const MeshInput& input, const MapCheckOptions& options,
                                                            const CheckedMap& map);
// For people: about twenty lines for any map. `uv_sets`: the sets that the file has.
std::string CheckText(const MeshInput& input, int uv_set, const std::vector<int>& uv_sets,
                      const MapCheckOptions& options, const CheckedMap& map,
                      const std::vector<RequirementResult>& results);
// For programs; the fields are described in client/JSON.md.
Json CheckJson(const MeshInput& input, int uv_set, const std::vector<int>& uv_sets, const MapCheckOptions& options,
               const CheckedMap& map, const std::vector<RequirementResult>& results);

}  // namespace planish::cli
