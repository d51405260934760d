// The objective of Newton's method: f of eq. 4, or f with a barrier that keeps angles from collapsing.
#pragma once

#include <vector>

#include "Eigen/Core"
#include "core/abf/target_angles.h"
#include "core/abf/tuning.h"
#include "core/base/thread_team.h"

namespace planish {

// The barriers to solve with, one after the other: from the strongest to the weakest.
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

}  // namespace planish
