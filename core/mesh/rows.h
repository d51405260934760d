// Which vertices are under constraints, and in which order: the rows of the solver's systems.
#pragma once

#include <cstdint>
#include <vector>

#include "core/base/execution.h"
#include "core/mesh/mesh.h"
#include "core/mesh/topology.h"

namespace planish {

// `vertices` along a Hilbert curve through the box round them, so that those near each other in number are near in
// space; in the order given where they fall into the same of 2^21 cells along the longest side. Positions must be
// finite, nothing else: the box may have no extent or nearly all of a double's range. O(n). Of no use after an
// interrupt.
std::vector<std::int32_t> InSpatialOrder(const std::vector<Vec3>& positions, const std::vector<std::int32_t>& vertices,
                                         const Execution& execution = {});

// Gives row i to vertices[i]: sets num_rows, vertex_row, corner_row, row_corner_begin and row_corner, whatever they
// were. num_vertices and faces must be set; the first num_interior of `vertices` must be the interior ones. O(F).
void AssignRows(const std::vector<std::int32_t>& vertices, Topology* topology);

// Gives back the memory of what AssignRows has set.
void DropRows(Topology* topology);

// The inverse of vertex_row: the vertex of every row.
std::vector<std::int32_t> RowVertices(const Topology& topology);

}  // namespace planish
