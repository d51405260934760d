// A rough place in the plane for every vertex under constraints.
#pragma once

#include <complex>
#include <vector>

#include "Eigen/Core"
#include "core/abf/topology.h"

namespace planish {

// Unfolds the mesh triangle by triangle, breadth first, with the angles whose cotangents are `cot`. Every triangle has
// its shape, beside the one from which it was reached; where two paths meet, the places agree as far as the angles meet
// the constraints. One complex number per row; all are zero if numbers overflow, and multigrid then has the constants
// alone for its coarse spaces. O(F).
std::vector<std::complex<double>> UnfoldRows(const Topology& topology, const Eigen::VectorXd& cot);

}  // namespace planish
