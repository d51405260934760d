// Target angles a_i and weights w_i (section 5 of the paper).
#pragma once

#include "Eigen/Core"
#include "core/base/execution.h"
#include "core/base/thread_team.h"
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

// Where Newton's method starts: of the angles whose triangles sum to pi, those with the least energy f (eq. 4),
// positive wherever the targets are less than 2 pi. The targets of a triangle may sum to much more or less than pi, and
// a step from there to triangles that are in the plane is often cut short by some angle on its way to 0 or pi.
Eigen::VectorXd StartingAngles(const TargetAngles& target, ThreadTeam& team = Alone());

}  // namespace planish
