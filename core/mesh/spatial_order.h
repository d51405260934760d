// Orders that keep together in memory what is together in space.
#pragma once

#include <cstdint>
#include <vector>

#include "core/base/execution.h"
#include "core/mesh/mesh.h"

namespace planish {

// `vertices` in the order of a Hilbert curve through the box round them: vertices with near numbers are near in space.
// The curve has 2^21 cells along the longest side; vertices of one cell keep their order. Positions must be finite; the
// box may have no extent, or nearly all of a double's range. O(n). After a cancellation the result is incomplete and
// must not be used.
std::vector<std::int32_t> InSpatialOrder(const std::vector<Vec3>& positions, const std::vector<std::int32_t>& vertices,
                                         const Execution& execution = {});

// The faces by the first of their vertices in an order: `rank` is the place of each vertex in it. Of several faces with
// the same first vertex the lower number comes first. O(F).
std::vector<std::int32_t> FacesByFirstVertex(const std::vector<Face>& faces, const std::vector<std::int32_t>& rank);

}  // namespace planish
