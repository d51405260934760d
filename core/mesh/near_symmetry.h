// Finds meshes whose two sides have about the same shape, but not the same triangles, as scans of faces have.
#pragma once

#include <cstdint>
#include <optional>
#include <vector>

#include "core/base/execution.h"
#include "core/mesh/mesh.h"

namespace planish {

// One side of a mesh, maybe simplified, and its mirror image.
struct FoldedMesh {
  Mesh mesh;                          // symmetrical about the plane x = 0; faces f and f + num_faces() / 2 are images
  std::vector<std::int32_t> polygon;  // per face of `mesh`
  // Per face of the original mesh: a face of `mesh` in about the same place, or -1.
  std::vector<std::int32_t> like;
  double share = 0;  // of the area of the original that lies near its mirror image
};

// Looks for a plane for which 95 % of the area lies near its mirror image: within 1.5 % of the mesh's diagonal, with a
// similar normal (mirror_plane.h). Cuts the mesh at the plane, and returns one side with its mirror image. `polygon`
// has the polygon of each face (empty: every face is one). If both sides would have more than `most_faces`, they are
// simplified to about that many, as far as shapes allow it, and every face is then a polygon. nullopt if there is no
// such plane, or after a cancellation. O(n log n).
std::optional<FoldedMesh> FoldNearlySymmetric(const Mesh& mesh, const std::vector<std::int32_t>& polygon,
                                              std::int64_t most_faces, const Execution& execution = {});

}  // namespace planish
