// How far to go along a Newton step.
#pragma once

#include "core/abf/constraints.h"
#include "core/abf/lagrangian.h"
#include "core/abf/objective.h"

namespace planish {

// The largest alpha in (0, 1] for which no angle of x + alpha step comes closer to 0 or pi than a twentieth of its
// present distance.
double LargestStep(const Eigen::VectorXd& x, const Eigen::VectorXd& step, ThreadTeam& team = Alone());

// `step`, but no angle of x comes closer to 0 or pi than a tenth of its present distance: those that would are held
// there by themselves.
Eigen::VectorXd HeldStep(const Eigen::VectorXd& x, const Eigen::VectorXd& step, ThreadTeam& team = Alone());

// The exact penalty function  phi(x) = f(x) + sum of nu_j |h_j(x)|  with one penalty per constraint, nu_j >= |mu_j|.
class MeritFunction {
 public:
  // `objective` and `team` must outlive this.
  explicit MeritFunction(const Objective& objective, ThreadTeam& team = Alone()) : objective_(objective), team_(team) {}

  // Forgets all penalties.
  void Reset() { nu_ = Multipliers(); }
  // Penalties that make the step a descent direction, from the multipliers mu + step.
  void UpdatePenalties(const Multipliers& mu, const Multipliers& step);

  // What the rows of the pairs contribute for values `pair` of theirs.
  double PairPenalty(const Eigen::VectorXd& pair) const;
  // phi(x), where f without a barrier is `energy`.
  double Value(const Eigen::VectorXd& x, double energy, const ConstraintValues& h) const;
  // Directional derivative along a step that meets the linearized constraints: grad f^t step - sum of nu_j |h_j|.
  struct Derivative {
    double slope;
    double
        noise;  // what it may be off by: the step is solved for to a tolerance only, and near the solution terms cancel
  };
  Derivative Slope(const Eigen::VectorXd& x, const ConstraintValues& h, const Eigen::VectorXd& step) const;

 private:
  double Penalty(const ConstraintValues& h) const;

  const Objective& objective_;
  ThreadTeam& team_;
  Multipliers nu_;
};

}  // namespace planish
