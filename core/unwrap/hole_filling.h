// Maps of pieces with holes that keep their borders: nothing is slit open.
#pragma once

#include <optional>

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

}  // namespace planish
