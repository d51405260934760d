// Pieces of a surface with holes: whether a chart is one, where it is slit open, and how its holes are filled.
#pragma once

#include <cstdint>
#include <functional>
#include <optional>
#include <utility>
#include <vector>

#include "core/abf/topology.h"
#include "core/base/execution.h"
#include "core/mesh/half_edges.h"
#include "core/mesh/mesh.h"
#include "core/unwrap/chart.h"

namespace planish {

// A plane piece with holes, in one piece with itself: no slits.
struct HoledPiece {
  FlatMesh mesh;
  Loops loops;              // two or more
  std::int32_t outer = -1;  // the loop that is longest on the surface; the others are holes
};

// The piece that a slit chart is when its slits are glued. Nothing if that has no holes, or is no part of a plane: it
// is closed, or has a handle. O(n) in its faces.
std::optional<HoledPiece> HoledPieceOf(const Mesh& mesh, const Chart& chart);

// Lets the slits of a chart that is a plane piece with holes run along short paths: from the outline to the nearest
// hole, from there or from the outline to the next one, until all are joined (as in Prim's algorithm). `disc` and
// `slits` are those of ChartMesh() (core/charts/gluing.h). `cost`, per half-edge of `disc`: of a slit there; infinite:
// none may be there. Leaves everything as it was where the chart is no such piece, or holes cannot be reached.
void SlitAlongShortPaths(const std::function<double(std::int32_t)>& cost, FlatMesh* disc,
                         std::vector<std::pair<std::int32_t, std::int32_t>>* slits);

// The chart with its slits glued and its holes filled by virtual faces, a fan each round a virtual vertex.
struct FilledChart {
  Topology topology;
  std::vector<std::int32_t> corner;  // per corner: that of the chart, -1 for those of virtual faces
  std::vector<Vec3> places;          // per vertex: on the surface
};
// Nothing if the chart is no HoledPiece, or a hole has less than three edges. O(n log n).
std::optional<FilledChart> FillHoles(const Mesh& mesh, const Chart& chart, const Execution& execution);

}  // namespace planish
