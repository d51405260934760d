// Target angles a_i and weights w_i (section 5 of the paper).
#pragma once

#include "Eigen/Core"
#include "core/base/execution.h"
#include "core/mesh/topology.h"

namespace planish {

struct TargetAngles {
  Eigen::VectorXd angle;   // a_i, radians, positive: alpha*_i scaled to sum to 2 pi round an interior vertex
  Eigen::VectorXd weight;  // w_i = 1 / a_i^2
};

// `measured` are the 3F angles alpha* of the surface, all positive. No angle is clamped (DESIGN.md 3.9).
// Of no use after an interrupt.
TargetAngles MakeTargetAngles(const Topology& topology, const Eigen::VectorXd& measured,
                              const Execution& execution = {});

}  // namespace planish
