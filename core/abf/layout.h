// Computes positions in the plane from angles: first every edge as a vector, then sums of edges.
//
// The edges of a triangle follow from those of a neighbour by one rotation and one scaling, along a spanning tree of
// the dual graph, so the error of an edge stays small relative to its length. Positions are sums of edges along a
// spanning tree of the vertices that prefers short edges. Any edge outside of that tree closes a loop with edges that
// are not much longer than itself. So errors of the angles stay small relative to every edge, however much the scale
// varies over the mesh.
#pragma once

#include <complex>
#include <vector>

#include "Eigen/Core"
#include "core/abf/topology.h"
#include "core/base/execution.h"

namespace planish {

// Positions of the vertices, in units of the longest edge; vertices without a face are at 0. `angles` are 3F planar
// angles in (0, pi) that meet the constraints; the edges of a loop add up to zero only as far as the angles do so. If
// the scale of the map exceeds the range of a double, positions are not finite. O(F). Empty after a cancellation.
std::vector<Vec2> LayOut(const Topology& topology, const Eigen::VectorXd& angles, const Execution& execution = {});

// A rough layout for the multigrid (core/linalg/multigrid.h): unfolds the mesh triangle by triangle, breadth first,
// with the angles whose cotangents are `cot`. Every triangle keeps its shape and is placed next to the one from which
// it was reached. Where two paths meet, positions agree as far as the angles meet the constraints. One complex number
// per row; all are zero if numbers overflow, and the multigrid's coarse spaces then hold only the constants. O(F).
std::vector<std::complex<double>> UnfoldRows(const Topology& topology, const Eigen::VectorXd& cot);

}  // namespace planish
