// The line search: the length of a Newton step.
#pragma once

#include "core/abf/constraints.h"
#include "core/abf/lagrangian.h"
#include "core/abf/objective.h"
#include "core/abf/tuning.h"

namespace planish {

// The fraction-to-the-boundary rule: the largest alpha in (0, 1] for which no angle of x + alpha step goes further than
// LineSearchTuning::fraction_to_boundary of its way to 0 or pi.
double LargestStepLength(const Eigen::VectorXd& x, const Eigen::VectorXd& step, ThreadTeam& team = Alone(),
                         const LineSearchTuning& tuning = {});

// `step` with each entry clipped on its own, so that no angle goes further than LineSearchTuning::clipped_fraction of
// its way to 0 or pi.
Eigen::VectorXd ClippedStep(const Eigen::VectorXd& x, const Eigen::VectorXd& step, ThreadTeam& team = Alone(),
                            const LineSearchTuning& tuning = {});

// The exact penalty function  phi(x) = f(x) + sum of nu_j |h_j(x)|  with one penalty per constraint, nu_j >= |mu_j|
// (Nocedal and Wright 2006, sections 15.4 and 18.3).
class MeritFunction {
 public:
  // `objective` and `team` must outlive this.
  explicit MeritFunction(const Objective& objective, ThreadTeam& team = Alone(), const LineSearchTuning& tuning = {})
      : objective_(objective), team_(team), tuning_(tuning) {}

  // Forgets all penalties.
  void Reset() { nu_ = Multipliers(); }
  // Penalties that make the step a descent direction, from the multipliers mu + step.
  void UpdatePenalties(const Multipliers& mu, const Multipliers& step);

  // The penalty terms of phi for the pairs, for constraint values `pair`.
  double PairPenalty(const Eigen::VectorXd& pair) const;
  // phi(x), given the energy without a barrier.
  double Value(const Eigen::VectorXd& x, double energy, const ConstraintValues& h) const;
  // Directional derivative along a step that meets the linearized constraints: grad f^t step - sum of nu_j |h_j|.
  struct Derivative {
    double slope;
    double noise;  // bound of the slope's error (LineSearchTuning::slope_noise)
  };
  Derivative Slope(const Eigen::VectorXd& x, const ConstraintValues& h, const Eigen::VectorXd& step) const;

 private:
  double Penalty(const ConstraintValues& h) const;

  const Objective& objective_;
  ThreadTeam& team_;
  const LineSearchTuning tuning_;
  Multipliers nu_;
};

}  // namespace planish
