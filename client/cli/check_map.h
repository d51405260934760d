// The UV that a mesh file has, judged.
#pragma once

#include <cstdint>
#include <vector>

#include "client/cli/mesh_input.h"
#include "core/unwrap/map_check.h"

namespace planish::cli {

// A map with its judgement. Faces and corners are those of `mesh`, which has the triangles of the file that have UV.
struct CheckedMap {
  std::int64_t triangles = 0;                  // of the file
  std::vector<std::int32_t> without_uv;        // triangles of the file: some corner has none
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

}  // namespace planish::cli
