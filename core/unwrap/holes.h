// Pieces of a surface with holes: whether a chart is one, where to slit it open, and how to fill its holes.
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

// A planar piece with holes, without slits.
struct HoledPiece {
  FlatMesh mesh;
  Loops loops;              // two or more
  std::int32_t outer = -1;  // the longest loop on the surface; the others are holes
};

// The piece that results from gluing the slits of a chart. nullopt if it has no holes, or is not planar: closed, or
// with a handle. O(n) in its faces.
std::optional<HoledPiece> HoledPieceOf(const Mesh& mesh, const Chart& chart);

// Moves the slits of a chart that is a planar piece with holes to short paths: from the outline to the nearest hole,
// from there or from the outline to the next one, until all are joined (as in Prim's algorithm). `disc` and `slits`
// come from ChartMesh() (core/charts/gluing.h). `cost`: cost of a slit per half-edge of `disc`; infinite where slits
// are not allowed. Changes nothing if the chart is not a planar piece with holes, or if holes cannot be reached.
void SlitAlongShortPaths(const std::function<double(std::int32_t)>& cost, FlatMesh* disc,
                         std::vector<std::pair<std::int32_t, std::int32_t>>* slits);

// The chart with its slits glued and each hole filled by a fan of virtual faces round a virtual vertex.
struct FilledChart {
  Topology topology;
  std::vector<std::int32_t> corner;  // per corner: the chart's corner, -1 for virtual faces
  std::vector<Vec3> places;          // per vertex: its position on the surface
};
// nullopt if the chart is not a HoledPiece, or if a loop has fewer than three edges. O(n log n).
std::optional<FilledChart> FillHoles(const Mesh& mesh, const Chart& chart, const Execution& execution);

}  // namespace planish
