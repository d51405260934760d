// The connectivity of a disc in flat arrays, for the solver and the layout, made from a chart.
#pragma once

#include <cstdint>
#include <vector>

#include "core/base/execution.h"
#include "core/mesh/half_edges.h"
#include "core/mesh/mesh.h"

namespace planish {

// Constant after construction.
struct Topology {
  std::int32_t num_vertices = 0;
  std::int32_t num_interior = 0;
  // Constrained vertices, each with a pair of rows. First the interior ones, which have both conditions of the pair
  // (vertex consistency and wheel). Then the boundary vertices whose angles must add up to pi, which have only the
  // first; boundary control adds these.
  std::int32_t num_rows = 0;
  std::vector<Face> faces;
  // The corner that faces the same edge as corner c = 3 f + k, the edge (v_{k+1}, v_{k+2}), from the other face; -1 on
  // the boundary.
  std::vector<std::int32_t> opposite;
  // Per vertex: its row, or -1 if it is not constrained. Rows of interior vertices are in an order that keeps
  // neighbours together (InSpatialOrder).
  std::vector<std::int32_t> vertex_row;
  // vertex_row of the vertex at each corner.
  std::vector<std::int32_t> corner_row;
  // The corners at each row, ascending: those of row i are [row_corner_begin[i], row_corner_begin[i + 1]) of
  // row_corner.
  std::vector<std::int32_t> row_corner_begin = {0};
  std::vector<std::int32_t> row_corner;

  // Whether a row (or corner_row, which may be -1) belongs to an interior vertex, with a wheel condition.
  bool has_wheel(std::int32_t row) const { return row >= 0 && row < num_interior; }

  std::int32_t num_faces() const { return static_cast<std::int32_t>(faces.size()); }
  std::int32_t num_corners() const { return 3 * num_faces(); }
};

// The topology of a disc, with the vertices of `disc`. Interior vertices have rows, in InSpatialOrder(). Faces are
// sorted by their lowest row, so that neighbours are close in memory: face i is face (*face_order)[i] of `disc`. O(F).
// After a cancellation the result is incomplete and must not be used.
Topology MakeTopology(const FlatMesh& disc, std::vector<std::int32_t>* face_order, const Execution& execution = {});

// Assigns row i to vertices[i]: sets num_rows, vertex_row, corner_row, row_corner_begin and row_corner. num_vertices,
// num_interior and faces must be set; the first num_interior of `vertices` must be the interior ones. O(F).
void AssignRows(const std::vector<std::int32_t>& vertices, Topology* topology);

// The inverse of vertex_row: the vertex of every row.
std::vector<std::int32_t> RowVertices(const Topology& topology);

}  // namespace planish
