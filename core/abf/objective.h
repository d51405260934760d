// The objective of Newton's method: f of eq. 4, or f with a barrier that keeps angles from collapsing.
#pragma once

#include <utility>
#include <vector>

#include "Eigen/Core"
#include "core/abf/target_angles.h"
#include "core/abf/tuning.h"
#include "core/base/thread_team.h"

namespace planish {

// The barriers to solve with in turn, from the strongest to the weakest.
std::vector<double> BarrierSequence(const BarrierTuning& tuning);

// f_tau(x) = f(x) + tau * sum of (x_i / a_i - 1 - log(x_i / a_i)).
//
// The barrier has its minimum at x = a, as f has, grows without bound towards x_i = 0, and keeps the Hessian diagonal.
// No barrier at pi is needed: no angle reaches pi before another one of its face reaches 0. f_0 is f.
class Objective {
 public:
  // `target` and `team` must outlive this.
  explicit Objective(const TargetAngles& target, ThreadTeam& team = Alone()) : target_(target), team_(team) {}

  double barrier() const { return barrier_; }
  void set_barrier(double tau) { barrier_ = tau; }

  // f(x) = sum of w_i (x_i - a_i)^2, the ABF energy of eq. 4, without the barrier.
  double Energy(const Eigen::VectorXd& x) const;
  double Value(const Eigen::VectorXd& x) const { return Value(x, Energy(x)); }
  // f_tau(x), where `energy` is Energy(x).
  double Value(const Eigen::VectorXd& x, double energy) const;
  Eigen::VectorXd Gradient(const Eigen::VectorXd& x) const;
  // gradient^t step, and the sum of the magnitudes of its terms.
  struct Directional {
    double derivative, magnitude;
  };
  Directional Along(const Eigen::VectorXd& x, const Eigen::VectorXd& step) const;
  // The diagonal of the Hessian, positive: 2 w_i + tau / x_i^2.
  Eigen::VectorXd Curvature(const Eigen::VectorXd& x) const;

 private:
  const TargetAngles& target_;
  ThreadTeam& team_;
  double barrier_ = 0;
};

// The curvature of the barrier by a primal-dual interior point method for f_tau (Waechter and Biegler 2006, "On the
// implementation of an interior-point filter line-search algorithm for large-scale nonlinear programming", sections 2.1
// and 2.2; Nocedal and Wright 2006, "Numerical Optimization", section 19.2): multipliers z of the bounds x > 0. At a
// minimum of f_tau they are tau / x. On the way there, the Hessian uses z_i / x_i instead of tau / x_i^2, the barrier's
// second derivative. With z, an angle that is far too small for tau returns in one step; with the second derivative no
// step can more than double the angle.
class BoundMultipliers {
 public:
  // `target`, `objective` and `team` must outlive this.
  BoundMultipliers(const TargetAngles& target, const Objective& objective, ThreadTeam& team,
                   const BarrierTuning& tuning = {})
      : target_(target), objective_(objective), team_(team), tuning_(tuning) {}

  const Eigen::VectorXd& z() const { return z_; }
  // Sets the multipliers of an earlier iterate, with the same or another barrier. If empty, z is initialized again.
  void set_z(Eigen::VectorXd z) { z_ = std::move(z); }
  // The diagonal of the Hessian with z, positive: 2 w_i + z_i / x_i. If z is empty, initializes it to tau / x, where
  // angles count as at least BarrierTuning::min_start_ratio of their targets. Without a barrier: the diagonal f''.
  Eigen::VectorXd Curvature(const Eigen::VectorXd& x);
  // Steps z along with a step of the angles from x to `next` of length `length` in (0, 1]. Every z_i stays within
  // BarrierTuning::multiplier_range of tau / next_i. No effect without a barrier.
  void Follow(const Eigen::VectorXd& x, const Eigen::VectorXd& next, double length);

 private:
  const TargetAngles& target_;
  const Objective& objective_;
  ThreadTeam& team_;
  const BarrierTuning tuning_;
  Eigen::VectorXd z_;  // empty: not started yet
};

}  // namespace planish
