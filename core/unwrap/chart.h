// A chart: faces of the mesh that form a disc, and their map into the plane.
#pragma once

#include <cstdint>
#include <memory>
#include <optional>
#include <utility>
#include <vector>

#include "absl/status/statusor.h"
#include "core/abf/flatten.h"
#include "core/abf/topology.h"
#include "core/base/execution.h"
#include "core/mesh/half_edges.h"
#include "core/pack/pack.h"
#include "core/unwrap/verify.h"

namespace planish {

// Faces are numbered in the order of the chart's topology (MakeTopology()).
struct Chart {
  std::shared_ptr<const Topology> topology;  // never null if the chart has faces; all single triangles share one
  std::vector<std::int32_t> faces;           // per face: its number in the mesh
  // Pairs of corners that face the same edge from both sides of a slit, where the chart's outline meets itself.
  std::vector<std::pair<std::int32_t, std::int32_t>> slits;
  // Per face: the least angle of its map, radians (widening.h); 0: the angles on the surface are kept. Empty: all 0.
  std::vector<double> least_angle;
  // Length in the map over length on the surface: above 1 if all faces are too small (widening.h), below 1 if they are
  // too long (long_needles.h).
  double enlargement = 1;

  bool is_widened(std::int32_t f) const { return !least_angle.empty() && least_angle[f] > 0; }
  // Whether the chart is one face that has the angles of the surface.
  bool is_triangle_as_measured() const { return faces.size() == 1 && !is_widened(0); }
};

// The solver's arrays for a chart (core/charts/gluing.h) or a whole disc, from its mesh, which may be freed afterwards.
// Face i of `disc` is face faces[i] of the mesh; `slits` are corners of `disc`. O(F).
Chart MakeChart(const FlatMesh& disc, const std::vector<std::int32_t>& faces,
                const std::vector<std::pair<std::int32_t, std::int32_t>>& slits = {}, const Execution& execution = {});

struct ChartMap {
  std::shared_ptr<const FlattenSummary> flatten;  // summary of the solve; null before the solve
  // Per vertex of the chart's topology. The map has the area of the surface (both without widened faces), before
  // Chart::enlargement.
  std::vector<Vec2> positions;
  std::optional<ChartPlacement> placement = {};  // in the texture, by the last packing
  bool is_barycentric = false;             // not by ABF (fixed_borders.h); `flatten` then describes the failed solve
  std::vector<std::int32_t> closed_slits;  // indices into Chart::slits whose two sides coincide in the map
};

// Topology::opposite of the chart with these slits joined (ChartMap::closed_slits).
std::vector<std::int32_t> OppositeWithClosedSlits(const Chart& chart, const std::vector<std::int32_t>& closed_slits);

// The outline of the map, counter-clockwise.
std::vector<Vec2> OutlineOf(const Chart& chart, const std::vector<Vec2>& positions);

// Faults and figures of a map before packing and rounding.
struct ChartFaults {
  bool is_injective = true;                // no two triangles overlap, and none is flipped or degenerate
  std::int64_t flipped_or_degenerate = 0;  // triangles
  // Faces of the mesh that overlap each other; -1 if none or unknown.
  std::int32_t face = -1, other_face = -1;
  double stretch = 1;  // root mean square as in Quality::stretch_l2, without widened faces
  double extent = 0;   // ExtentOf() the map, in units of the surface
};
// The diameter of a circle that holds these points; there must be at least one.
double ExtentOf(const std::vector<Vec2>& points);

// Finds the faults of a map, without faces marked in `ignored`. `resolution`: the rounding of delivered positions, in
// units of the surface; 0: none. Overlaps caused by rounding count, as where an outline touches itself; triangles
// flipped or collapsed by rounding do not.
ChartFaults FindFaults(const Mesh& mesh, const Chart& chart, const ChartMap& map, const std::vector<char>& ignored,
                       double resolution, const Execution& execution);

// Computes positions from angles. Closes slits whose sides coincide up to rounding errors, as round a hole in a flat
// sheet. INTERNAL, SOLVER_FAILED: a position is not finite.
absl::StatusOr<ChartMap> LayOutChart(const Mesh& mesh, const Chart& chart, Flattening flattening,
                                     const Execution& execution);
// LayOutChart() for a chart that is_triangle_as_measured(): computes positions from its edges, without a solve. There
// may be a hundred thousand such charts, so all share one summary.
absl::StatusOr<ChartMap> LayOutTriangle(const Mesh& mesh, const Chart& chart,
                                        std::shared_ptr<const FlattenSummary> summary, const Execution& execution);
// The second part of LayOutChart() and LayOutTriangle(): makes the map from positions in any unit.
absl::StatusOr<ChartMap> PlaceChart(const Mesh& mesh, const Chart& chart, std::shared_ptr<const FlattenSummary> summary,
                                    std::vector<Vec2> positions, const Execution& execution);

}  // namespace planish
