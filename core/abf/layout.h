// Angles to (u, v): propagation of edges, then sums of them (DESIGN.md, section 3.6).
//
// Each triangle's edges follow from its neighbour's by one turn and one change of scale, over a spanning tree of the
// dual graph: errors add up relative to each edge, as they would for logarithms of lengths and for directions.
// Positions are sums of edges along a spanning tree of the vertices that prefers short edges: the path that closes the
// loop of any other edge then has no edge much longer than it, so what error the angles have shows relative to that
// edge, however much the scale varies over the mesh.
#pragma once

#include <vector>

#include "Eigen/Core"
#include "core/base/execution.h"
#include "core/mesh/topology.h"

namespace planish {

struct Layout {
  // Per vertex; its unit is the longest edge. Vertices without a face are at 0.
  std::vector<Vec2> positions;
  // Largest distance between the end of an edge and where its own triangle wants it, relative to its length.
  double largest_gap = 0;
  // Longest over shortest edge.
  double scale_range = 1;
};

// `angles` are 3F planar angles that meet the constraints. O(F). No positions after an interrupt.
Layout LayOut(const Topology& topology, const Eigen::VectorXd& angles, const Execution& execution = {});

}  // namespace planish
