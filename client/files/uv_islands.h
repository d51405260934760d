// Finds connected faces in a UV map, regardless of the file's vertices.
#pragma once

#include <cstdint>
#include <vector>

#include "core/mesh/half_edges.h"
#include "core/mesh/mesh.h"

namespace planish {

struct UvIslands {
  std::vector<std::int32_t> island_of_face;  // numbered in the order of their first faces
  std::int32_t count = 0;
  // Per corner c an id of its position and UV: equal exactly if both are.
  std::vector<std::int32_t> place_of_corner;
  std::int32_t num_places = 0;
  // Per half-edge c (half_edges.h): whether the map ends there, because no other face shares the edge with the same
  // positions and UV.
  std::vector<char> is_outline;
  EdgeGroups edges;  // half-edges between the same two places
};

// Two faces are in one island if they share an edge with equal positions and equal UV at both ends, even if the file
// splits the vertices there for its normals. Consecutive faces with equal numbers in `polygon` (one per face; may be
// empty) are in one island too. A face whose three corners coincide is in the island of another face that has a corner
// there. `uv` has 6 numbers a face. Positions and UV must be finite. O(F log F).
UvIslands FindUvIslands(const Mesh& mesh, const std::vector<double>& uv, const std::vector<std::int64_t>& polygon = {});

}  // namespace planish
