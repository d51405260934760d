// Maps that cannot overlap: every vertex lies at a weighted mean of its neighbours.
#pragma once

#include <vector>

#include "Eigen/Core"
#include "absl/status/statusor.h"
#include "core/abf/topology.h"
#include "core/base/execution.h"
#include "core/mesh/mesh.h"
#include "core/unwrap/chart.h"
#include "core/unwrap/hole_filling.h"

namespace planish {

// Positions of the vertices of `disc` in the plane, one to one: the outline lies on a circle, by its length, and all
// others at means of their neighbours with weights above 0 (Tutte, "How to draw a graph", 1963; Floater, "One-to-one
// piecewise linear mappings over triangulations", 2003). The weights are mean value coordinates (Floater, 2003), at
// first; then vertices draw less where triangles are stretched, for as long as that lowers the stretch of the whole
// (Yoshizawa, Belyaev and Seidel, "A fast and simple stretch-minimizing mesh parameterization", 2004). Angles are kept
// as far as that leaves them. `places` are the vertices on the surface; triangles without area do no harm.
//
// Up to 30 sparse factorizations of as many rows as there are interior vertices. Deterministic. After a cancellation,
// or if there is no solution in double precision, nothing.
std::vector<Vec2> MapByBarycentres(const Topology& disc, const std::vector<Vec3>& places, const Execution& execution);

// The same for a chart, by that of `filled`. `summary` is that of the solve which it takes the place of
// (PlaceFilled()). CANCELLED after a cancellation; INTERNAL, SOLVER_FAILED, if there is no such map.
absl::StatusOr<ChartMap> MapByBarycentres(const Mesh& mesh, const Chart& chart, const FilledChart& filled,
                                          const Eigen::VectorXd& measured, FlattenSummary summary,
                                          const Execution& execution);

}  // namespace planish
