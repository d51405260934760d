// Which half-edges lie on the same edge, for any triangle soup with valid indices.
#pragma once

#include <cstdint>
#include <vector>

#include "core/base/execution.h"
#include "core/mesh/mesh.h"

namespace planish {

// Half-edge c = 3 f + k runs from v_{k+1} to v_{k+2}: it is the one that corner k of face f faces.
inline std::int32_t Origin(const std::vector<Face>& faces, std::int32_t c) {
  return faces[c / 3][Next(c % 3)];
}
inline std::int32_t Target(const std::vector<Face>& faces, std::int32_t c) {
  return faces[c / 3][Prev(c % 3)];
}

// The half-edge on an outline (opposite[c] < 0) that starts where half-edge c ends, and the one that ends where it
// starts, for `opposite` as in Topology: on the outline of c's face's piece, round the vertex through faces that are
// joined. Some half-edge there must be on an outline.
inline std::int32_t NextOnOutline(const std::vector<std::int32_t>& opposite, std::int32_t c) {
  for (;;) {
    c = 3 * (c / 3) + Next(c % 3);
    if (opposite[c] < 0) return c;
    c = opposite[c];
  }
}
inline std::int32_t PreviousOnOutline(const std::vector<std::int32_t>& opposite, std::int32_t c) {
  for (;;) {
    c = 3 * (c / 3) + Prev(c % 3);
    if (opposite[c] < 0) return c;
    c = opposite[c];
  }
}

// Half-edges grouped by undirected edge: group e is [begin[e], begin[e + 1]) of half_edge, ascending.
struct EdgeGroups {
  std::vector<std::int32_t> begin = {0};
  std::vector<std::int32_t> half_edge;

  std::int32_t num_edges() const { return static_cast<std::int32_t>(begin.size()) - 1; }
};

// O(F) for bounded valence. Faces must have three distinct vertices in [0, num_vertices). No groups after an interrupt.
EdgeGroups GroupHalfEdges(const std::vector<Face>& faces, std::int64_t num_vertices, const Execution& execution = {});

}  // namespace planish
