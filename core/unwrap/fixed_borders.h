// A map that cannot overlap: every vertex is a weighted mean of its neighbours. One of the maps that
// MapWithFixedBorders() (core/unwrap/steps.h) tries.
#pragma once

#include <vector>

#include "core/abf/topology.h"
#include "core/base/execution.h"
#include "core/mesh/mesh.h"

namespace planish {

// Injective positions of the vertices of `disc` in the plane: the outline is on a circle, in proportion to its length,
// and all other vertices are means of their neighbours with positive weights (Tutte, "How to draw a graph", 1963;
// Floater, "One-to-one piecewise linear mappings over triangulations", 2003). The weights are initially mean value
// coordinates (Floater, 2003); then vertices attract less where triangles are stretched, as long as that lowers the
// total stretch (Yoshizawa, Belyaev and Seidel, "A fast and simple stretch-minimizing mesh parameterization", 2004).
// Angles are kept only as far as that allows. `places` are the vertices on the surface; triangles without area are
// allowed.
//
// Takes up to 30 sparse eliminations with a row for each interior vertex. Deterministic. Empty after a cancellation, or
// if there is no solution in double precision.
std::vector<Vec2> MapByBarycentres(const Topology& disc, const std::vector<Vec3>& places, const Execution& execution);

}  // namespace planish
