// The map that cannot overlap: every vertex lies at a weighted mean of its neighbours. One of those that
// MapWithFixedBorders() (core/unwrap/steps.h) tries.
#pragma once

#include <vector>

#include "core/abf/topology.h"
#include "core/base/execution.h"
#include "core/mesh/mesh.h"

namespace planish {

// Positions of the vertices of `disc` in the plane, one to one: the outline lies on a circle, by its length, and all
// others at means of their neighbours with weights above 0 (Tutte, "How to draw a graph", 1963; Floater, "One-to-one
// piecewise linear mappings over triangulations", 2003). The weights are mean value coordinates (Floater, 2003), at
// first; then vertices draw less where triangles are stretched, for as long as that lowers the stretch of the whole
// (Yoshizawa, Belyaev and Seidel, "A fast and simple stretch-minimizing mesh parameterization", 2004). Angles are kept
// as far as that leaves them. `places` are the vertices on the surface; triangles without area do no harm.
//
// Up to 30 sparse eliminations of as many rows as there are interior vertices. Deterministic. After a cancellation,
// or if there is no solution in double precision, nothing.
std::vector<Vec2> MapByBarycentres(const Topology& disc, const std::vector<Vec3>& places, const Execution& execution);

}  // namespace planish
