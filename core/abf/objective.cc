#include "core/abf/objective.h"

#include "core/base/portable_math.h"
#include "core/linalg/vector_ops.h"

namespace planish {

std::vector<double> BarrierSequence(const BarrierTuning& tuning) {
  std::vector<double> sequence;
  for (double tau = tuning.strongest; tau > tuning.weakest; tau /= tuning.reduction) sequence.push_back(tau);
  sequence.push_back(tuning.weakest);
  return sequence;
}

double Objective::Energy(const Eigen::VectorXd& x) const {
  return Sum(team_, target_.weight.cwiseProduct((x - target_.angle).cwiseAbs2()));
}

double Objective::Value(const Eigen::VectorXd& x, double energy) const {
  if (barrier_ == 0) return energy;
  return energy + barrier_ * Sum(team_, x.binaryExpr(target_.angle, [](double angle, double target) {
                    const double ratio = angle / target;
                    return ratio - 1 - portable::Log(ratio);
                  }));
}

Eigen::VectorXd Objective::Gradient(const Eigen::VectorXd& x) const {
  Eigen::VectorXd gradient;
  Assign(team_, 2 * target_.weight.cwiseProduct(x - target_.angle), &gradient);
  if (barrier_ != 0) {
    Assign(team_, gradient + barrier_ * (target_.angle.cwiseInverse() - x.cwiseInverse()), &gradient);
  }
  return gradient;
}

Objective::Directional Objective::Along(const Eigen::VectorXd& x, const Eigen::VectorXd& step) const {
  if (barrier_ != 0) {
    const Eigen::VectorXd gradient = Gradient(x);
    return {Dot(team_, gradient, step), Sum(team_, gradient.cwiseProduct(step).cwiseAbs())};
  }
  const auto terms = 2 * target_.weight.cwiseProduct(x - target_.angle).cwiseProduct(step);
  return {Sum(team_, terms), Sum(team_, terms.cwiseAbs())};
}

Eigen::VectorXd Objective::Curvature(const Eigen::VectorXd& x) const {
  Eigen::VectorXd curvature;
  Assign(team_, 2 * target_.weight, &curvature);
  if (barrier_ != 0) Assign(team_, curvature + barrier_ * x.cwiseAbs2().cwiseInverse(), &curvature);
  return curvature;
}

Eigen::VectorXd BoundMultipliers::Curvature(const Eigen::VectorXd& x) {
  const double tau = objective_.barrier();
  if (tau == 0) return objective_.Curvature(x);
  if (z_.size() == 0) Assign(team_, tau * x.cwiseMax(tuning_.min_start_ratio * target_.angle).cwiseInverse(), &z_);
  Eigen::VectorXd curvature;
  Assign(team_, 2 * target_.weight + z_.cwiseQuotient(x), &curvature);
  return curvature;
}

void BoundMultipliers::Follow(const Eigen::VectorXd& x, const Eigen::VectorXd& next, double length) {
  const double tau = objective_.barrier();
  if (tau == 0 || z_.size() == 0) return;
  // The step dz of z solves x z + x dz + z dx = tau.
  Assign(team_,
         (z_ + length * (tau * x.cwiseInverse() - z_) - z_.cwiseQuotient(x).cwiseProduct(next - x))
             .cwiseMax(tau / tuning_.multiplier_range * next.cwiseInverse())
             .cwiseMin(tau * tuning_.multiplier_range * next.cwiseInverse()),
         &z_);
}

}  // namespace planish
