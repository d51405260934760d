// Orders in which neighbours in space are neighbours in memory.
#pragma once

#include <cstdint>
#include <vector>

#include "core/base/execution.h"
#include "core/mesh/mesh.h"

namespace planish {

// `vertices` in the order of a Hilbert curve through their bounding box: vertices with close numbers are close in
// space. The curve has 2^21 cells along the longest side; vertices of one cell keep their order. Positions must be
// finite; the box may have no extent, or nearly all of a double's range. O(n). After a cancellation the result is
// incomplete and must not be used.
std::vector<std::int32_t> InSpatialOrder(const std::vector<Vec3>& positions, const std::vector<std::int32_t>& vertices,
                                         const Execution& execution = {});

// The faces, ordered by the first of their vertices: `rank` is the position of each vertex in the order. Faces with the
// same first vertex are ordered by number. O(F).
std::vector<std::int32_t> FacesByFirstVertex(const std::vector<Face>& faces, const std::vector<std::int32_t>& rank);

}  // namespace planish
