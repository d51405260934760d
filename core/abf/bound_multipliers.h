// How the barrier bends: a primal-dual interior point method for f_tau (Waechter & Biegler 2006, sections 2.1 and 2.2;
// Nocedal & Wright 2006, section 19.2).
#pragma once

#include <utility>

#include "Eigen/Core"
#include "core/abf/objective.h"
#include "core/base/thread_team.h"

namespace planish {

// Multipliers z of the bounds x > 0. At a minimum of f_tau they are tau / x, and on the way there z_i / x_i takes the
// place of tau / x_i^2 in the Hessian. An angle that is far too small for tau is back in one step with that; with the
// barrier's own second derivative each step can but double it.
class BoundMultipliers {
 public:
  // All of these must outlive this.
  BoundMultipliers(const TargetAngles& target, const Objective& objective, ThreadTeam& team)
      : target_(target), objective_(objective), team_(team) {}

  const Eigen::VectorXd& z() const { return z_; }
  // Those of an earlier iterate, with the same barrier or another; with none, z begins anew.
  void set_z(Eigen::VectorXd z) { z_ = std::move(z); }
  // The diagonal of the Hessian with z, positive: 2 w_i + z_i / x_i. Begins with z = tau / x if there is none yet, but
  // takes angles below 0.03 of their targets for as large as that. Without a barrier it is f's.
  Eigen::VectorXd Curvature(const Eigen::VectorXd& x);
  // After a step from x to `next`, of which that is `length`, in (0, 1]: z takes its own, but no z_i becomes less
  // than a third of tau / x_i or more than three times that. Nothing without a barrier.
  void Follow(const Eigen::VectorXd& x, const Eigen::VectorXd& next, double length);

 private:
  const TargetAngles& target_;
  const Objective& objective_;
  ThreadTeam& team_;
  Eigen::VectorXd z_;  // empty: none yet
};

}  // namespace planish
