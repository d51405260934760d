// Maps of charts that keep their borders, where the slit chart's own map overlaps itself or is stretched beyond use
// (MapWithFixedBorders()): by ABF with holes filled, and by means of neighbours, which cannot overlap.
#pragma once

#include <cstdint>
#include <optional>
#include <vector>

#include "Eigen/Core"
#include "absl/status/statusor.h"
#include "core/abf/flatten.h"
#include "core/abf/topology.h"
#include "core/base/execution.h"
#include "core/unwrap/chart.h"

namespace planish {

// A chart whose slits are glued and whose holes have faces: a fan each, round a vertex in its middle.
struct FilledChart {
  Topology topology;
  std::vector<std::int32_t> corner;  // per corner: that of the chart, -1 for those of fans
  std::vector<Vec3> places;          // per vertex: on the surface
};

// The chart as it is, slit.
FilledChart Unfilled(const Mesh& mesh, const Chart& chart);

// Nothing if the chart has no slits, or is no piece of a plane with holes in it when they are glued (it is closed, or
// has a handle). The boundary loop that is longest on the surface is the outer one. O(F log F).
std::optional<FilledChart> FillHoles(const Mesh& mesh, const Chart& chart, const Execution& execution);

// The map of the chart by the places in the plane of the filled one's vertices. `summary` becomes the map's, with the
// energy of the chart's own angles. `measured` is that of AnglesToKeep(). Errors as LayOutChart().
absl::StatusOr<ChartMap> PlaceFilled(const Mesh& mesh, const Chart& chart, const FilledChart& filled,
                                     const std::vector<Vec2>& places, const Eigen::VectorXd& measured,
                                     FlattenSummary summary, const Execution& execution);

// The map of the chart by ABF of the filled one; all its slits are closed. Fans take the angles that the faces round a
// hole leave them, and weigh little. Errors as FlattenAngles() and LayOutChart().
absl::StatusOr<ChartMap> MapFilled(const Mesh& mesh, const Chart& chart, const FilledChart& filled,
                                   const Eigen::VectorXd& measured, const FlattenOptions& options,
                                   const Execution& execution);

// ---- Maps that cannot overlap: every vertex lies at a weighted mean of its neighbours.

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
