// Angles to (u, v): additive propagation (DESIGN.md, section 3.6).
//
// Each triangle's log scale and turning angle follow from its neighbour's by additions alone, over a spanning tree of
// the dual graph; so does each edge as a vector. Positions are sums of edge vectors along the spanning tree of the
// vertices with the shortest edges: the path that closes the loop of any other edge then has no edge longer than it,
// so what error the angles have shows relative to that edge, however much the scale varies over the mesh.
#pragma once

#include <vector>

#include "Eigen/Core"
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

// `angles` are 3F planar angles that meet the constraints. O(F log F).
Layout LayOut(const Topology& topology, const Eigen::VectorXd& angles);

}  // namespace planish
