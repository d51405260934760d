// A rough place in the plane for every vertex under constraints.
#pragma once

#include <complex>
#include <vector>

#include "Eigen/Core"
#include "core/mesh/topology.h"

namespace planish {

// The mesh unfolded triangle by triangle, breadth first, with the angles whose cotangents are given: every triangle has
// its shape next to the one it was reached from, and where paths meet they agree as far as the angles meet the
// constraints. One complex number per row of constraints; all zero if the numbers overflow. O(F).
std::vector<std::complex<double>> UnfoldRows(const Topology& topology, const Eigen::VectorXd& cot);

}  // namespace planish
