#include "core/abf/bound_multipliers.h"

#include "core/linalg/vector_ops.h"

namespace planish {

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
  // z + dz is to meet x z + x dz + z dx = tau.
  Assign(team_,
         (z_ + length * (tau * x.cwiseInverse() - z_) - z_.cwiseQuotient(x).cwiseProduct(next - x))
             .cwiseMax(tau / tuning_.multiplier_range * next.cwiseInverse())
             .cwiseMin(tau * tuning_.multiplier_range * next.cwiseInverse()),
         &z_);
}

}  // namespace planish
