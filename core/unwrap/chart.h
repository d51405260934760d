// One chart: faces of the mesh that make a disc, and their map into the plane.
#pragma once

#include <cstdint>
#include <utility>
#include <vector>

#include "Eigen/Core"
#include "absl/status/statusor.h"
#include "core/abf/flatten.h"
#include "core/abf/target_angles.h"
#include "core/base/execution.h"
#include "core/charts/gluing.h"
#include "core/mesh/topology.h"
#include "core/unwrap/verify.h"

namespace planish {

// Its faces have numbers of their own, in the order in which the solver likes them.
struct Chart {
  Topology topology;
  std::vector<std::int32_t> faces;  // the mesh's, of each face
  // Corners that face the same edge from either side of a slit, where the chart's outline meets itself on the surface.
  std::vector<std::pair<std::int32_t, std::int32_t>> slits;
};

// Of these faces of `gluing`'s surface, which must be one of its discs. O(F log F) in the chart's faces.
Chart MakeChart(const Gluing& gluing, const std::vector<std::int32_t>& faces, const Execution& execution = {});

// The whole of a disc (core/mesh/disc_check.h).
Chart MakeChart(const Topology& disc);

// Values of the mesh's corners, 3 a face, for the chart's corners; and back, into `corners`.
Eigen::VectorXd Gather(const Chart& chart, const double* corners);
void Scatter(const Chart& chart, const Eigen::VectorXd& values, double* corners);

struct ChartMap {
  FlattenSummary flatten;
  // Per vertex of the chart's topology; the area of the map is that of the surface.
  std::vector<Vec2> positions;
  bool is_barycentric = false;  // not by ABF (barycentric.h): `flatten` tells of a solve whose map was no use
  std::vector<std::int32_t> closed_slits;  // indices into Chart::slits: both sides have become one line again
};

// Judged by UV of the mesh's corners, as delivered: stretch as in ChartFaults, and pairs of triangles of the chart that
// overlap, with face numbers of the chart. `opposite` has the half-edges of the mesh that are joined.
double StretchOf(const Mesh& mesh, const Chart& chart, const CornerUv& uv, const std::vector<char>& ignored,
                 const Execution& execution);
Overlaps OverlapsWithin(const Chart& chart, const std::vector<std::int32_t>& opposite, const CornerUv& uv,
                        const std::vector<char>& ignored, const Execution& execution);

// What a map looks like before packing and rounding.
struct ChartFaults {
  bool does_overlap = false;  // or has flipped or collapsed triangles
  std::int64_t turned = 0;    // of those: how many
  // Faces of the mesh that overlap each other; -1 if none or unknown.
  std::int32_t face = -1, other_face = -1;
  double stretch = 1;  // root mean square, as Quality::stretch_l2
  double extent = 0;   // diameter of a circle that holds it, in the units of the surface
};
ChartFaults FindFaults(const Mesh& mesh, const Chart& chart, const ChartMap& map, const std::vector<char>& ignored,
                       const Execution& execution);

// Angles by ABF. `measured` are the angles on the surface of the chart's corners, radians. Errors as FlattenAngles().
absl::StatusOr<Flattening> FlattenChart(const Chart& chart, Eigen::VectorXd measured, const FlattenOptions& options,
                                        const FlattenControl& control, const Execution& execution);

// Positions from angles. Slits whose sides come to lie on each other, up to rounding, are closed: as around a hole in a
// flat sheet. INTERNAL, SOLVER_FAILED: a position is not finite.
absl::StatusOr<ChartMap> LayOutChart(const Mesh& mesh, const Chart& chart, Flattening flattening,
                                     const Execution& execution);
// The second half of that: from positions in any unit to the map.
absl::StatusOr<ChartMap> PlaceChart(const Mesh& mesh, const Chart& chart, FlattenSummary summary,
                                    std::vector<Vec2> positions, const Execution& execution);

}  // namespace planish
