// Connectivity of a disc: what the solver and the layout need, in flat arrays.
#pragma once

#include <cstdint>
#include <vector>

#include "core/mesh/mesh.h"

namespace planish {

// Constant after construction.
struct Topology {
  std::int32_t num_vertices = 0;
  std::int32_t num_interior = 0;
  // Vertices under constraints, each with a pair of rows: first the interior ones, which have both conditions of the
  // pair (vertex consistency and wheel), then the boundary vertices whose angles must add up to pi, which have the
  // first only. None of the latter unless boundary control put them there.
  std::int32_t num_rows = 0;
  std::vector<Face> faces;
  // Corner across the edge opposite corner c = 3 f + k, i.e. the corner of the neighbouring face that faces the edge
  // (v_{k+1}, v_{k+2}); -1 on the boundary.
  std::vector<std::int32_t> opposite;
  // Per vertex: its number among the vertices under constraints, the interior ones in an order that keeps neighbours
  // together (core/mesh/rows.h); -1 for none.
  std::vector<std::int32_t> vertex_row;
  // vertex_row of the vertex at each corner.
  std::vector<std::int32_t> corner_row;
  // The corners round each row, ascending: those of row i are [row_corner_begin[i], row_corner_begin[i + 1]) of
  // row_corner.
  std::vector<std::int32_t> row_corner_begin = {0};
  std::vector<std::int32_t> row_corner;

  std::int32_t num_faces() const { return static_cast<std::int32_t>(faces.size()); }
  std::int32_t num_corners() const { return 3 * num_faces(); }
};

}  // namespace planish
