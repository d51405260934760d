// Target angles a_i and weights w_i (section 5 of the paper).
#pragma once

#include "Eigen/Core"
#include "core/abf/topology.h"
#include "core/base/execution.h"
#include "core/base/thread_team.h"

namespace planish {

struct TargetAngles {
  Eigen::VectorXd angle;   // a_i, radians, positive: alpha*_i scaled to sum to 2 pi round an interior vertex
  Eigen::VectorXd weight;  // w_i = 1 / a_i^2
};

// `measured` are the 3F angles alpha* of the surface, all positive. No angle is clamped. After a cancellation the
// result is incomplete and must not be used.
TargetAngles MakeTargetAngles(const Topology& topology, const Eigen::VectorXd& measured,
                              const Execution& execution = {});

// The starting point of Newton's method: of all angles whose triangles sum to pi, those with the least energy f (eq.
// 4). They are positive wherever the targets are less than 2 pi. Starting from the targets is worse: their triangles
// may sum to much more or less than pi, and then an angle on its way to 0 or pi often cuts the first step short.
Eigen::VectorXd StartingAngles(const TargetAngles& target, ThreadTeam& team = Alone());

}  // namespace planish
