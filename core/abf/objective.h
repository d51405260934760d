// What Newton's method minimizes: f of eq. 4, and on the way to it f with a barrier that keeps angles from collapsing.
#pragma once

#include "Eigen/Core"
#include "core/abf/target_angles.h"
#include "core/base/thread_team.h"

namespace planish {

// f_tau(x) = f(x) + tau * sum of (x_i / a_i - 1 - log(x_i / a_i)).
//
// The barrier is least at x = a, as f is, grows without bound towards x_i = 0, and keeps the Hessian diagonal. Angles
// cannot reach pi before another one of their face reaches 0. With tau = 0 it is f.
class Objective {
 public:
  // `target` and `team` must outlive this.
  explicit Objective(const TargetAngles& target, ThreadTeam& team = Alone()) : target_(target), team_(team) {}

  double barrier() const { return barrier_; }
  void set_barrier(double tau) { barrier_ = tau; }

  // f(x) = sum of w_i (x_i - a_i)^2, the ABF energy of eq. 4, without the barrier.
  double Energy(const Eigen::VectorXd& x) const;
  double Value(const Eigen::VectorXd& x) const { return Value(x, Energy(x)); }
  // The same where Energy(x) is known.
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

}  // namespace planish
