// One chart: faces of the mesh that make a disc, and their map into the plane.
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

// Its faces are numbered in the order of its topology (MakeTopology()).
struct Chart {
  std::shared_ptr<const Topology> topology;  // never null in a chart with faces; single triangles share one
  std::vector<std::int32_t> faces;           // the mesh's, of each face
  // Corners that face the same edge from either side of a slit, where the chart's outline meets itself on the surface.
  std::vector<std::pair<std::int32_t, std::int32_t>> slits;
  // Per face: the least angle that its map may have, radians (widening.h); 0: the angles on the surface are kept.
  // Empty: all 0.
  std::vector<double> least_angle;
  // Length in the map over length on the surface: above 1 where all faces are too small (widening.h), below 1 where
  // they are too long (long_needles.h).
  double enlargement = 1;

  bool is_widened(std::int32_t f) const { return !least_angle.empty() && least_angle[f] > 0; }
  // Whether there is one face only, and all of its angles are those of the surface.
  bool is_triangle_as_measured() const { return faces.size() == 1 && !is_widened(0); }
};

// The solver's arrays of a chart (core/charts/gluing.h) or a whole disc, from its mesh, which may be freed then. Face i
// of that is face faces[i]; `slits` in the corners of the mesh. O(F).
Chart MakeChart(const FlatMesh& disc, const std::vector<std::int32_t>& faces,
                const std::vector<std::pair<std::int32_t, std::int32_t>>& slits = {}, const Execution& execution = {});

struct ChartMap {
  std::shared_ptr<const FlattenSummary> flatten;  // of the solve; null before
  // Per vertex of the chart's topology; the area of the map is that of the surface, widened faces left out of both,
  // before Chart::enlargement.
  std::vector<Vec2> positions;
  std::optional<ChartPlacement> placement = {};  // in the texture, since it was packed last; none before
  bool is_barycentric = false;  // not by ABF (fixed_borders.h); `flatten` then describes the solve that failed
  std::vector<std::int32_t> closed_slits;  // indices into Chart::slits: both sides have become one line again
};

// Topology::opposite of the chart with these slits joined, such as ChartMap::closed_slits.
std::vector<std::int32_t> OppositeWithClosedSlits(const Chart& chart, const std::vector<std::int32_t>& closed_slits);

// The outline of the map, counter-clockwise.
std::vector<Vec2> OutlineOf(const Chart& chart, const std::vector<Vec2>& positions);

// What a map looks like before packing and rounding.
struct ChartFaults {
  bool is_injective = true;                // no two triangles overlap, and none is flipped or collapsed
  std::int64_t flipped_or_degenerate = 0;  // triangles
  // Faces of the mesh that overlap each other; -1 if none or unknown.
  std::int32_t face = -1, other_face = -1;
  double stretch = 1;  // root mean square, as Quality::stretch_l2, of all faces but the widened ones
  double extent = 0;   // ExtentOf() the map, in the units of the surface
};
// The diameter of a circle that holds these points, of which there is at least one.
double ExtentOf(const std::vector<Vec2>& points);

// `resolution`: what places are rounded to when they are delivered, in the units of the surface; 0: not at all.
// Overlaps that such a rounding makes count, as where an outline touches itself; triangles that it flips or collapses
// do not.
ChartFaults FindFaults(const Mesh& mesh, const Chart& chart, const ChartMap& map, const std::vector<char>& ignored,
                       double resolution, const Execution& execution);

// Positions from angles. Slits whose sides come to lie on each other, up to rounding, are closed: as around a hole in a
// flat sheet. INTERNAL, SOLVER_FAILED: a position is not finite.
absl::StatusOr<ChartMap> LayOutChart(const Mesh& mesh, const Chart& chart, Flattening flattening,
                                     const Execution& execution);
// The same of a chart that is_triangle_as_measured(), by its edges: there is nothing to solve. Such charts are solved
// alike, and there may be a hundred thousand of them: one summary serves all.
absl::StatusOr<ChartMap> LayOutTriangle(const Mesh& mesh, const Chart& chart,
                                        std::shared_ptr<const FlattenSummary> summary, const Execution& execution);
// The second half of both: from positions in any unit to the map.
absl::StatusOr<ChartMap> PlaceChart(const Mesh& mesh, const Chart& chart, std::shared_ptr<const FlattenSummary> summary,
                                    std::vector<Vec2> positions, const Execution& execution);

}  // namespace planish
