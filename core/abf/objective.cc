#include "core/abf/objective.h"

namespace planish {

double Objective::Value(const Eigen::VectorXd& x) const {
  const double energy = target_.Energy(x);
  if (barrier_ == 0) return energy;
  const Eigen::ArrayXd ratio = x.array() / target_.angle.array();
  return energy + barrier_ * (ratio - 1 - ratio.log()).sum();
}

Eigen::VectorXd Objective::Gradient(const Eigen::VectorXd& x) const {
  Eigen::VectorXd gradient = 2 * target_.weight.array() * (x - target_.angle).array();
  if (barrier_ != 0) gradient.array() += barrier_ * (target_.angle.array().inverse() - x.array().inverse());
  return gradient;
}

Eigen::VectorXd Objective::Curvature(const Eigen::VectorXd& x) const {
  Eigen::VectorXd curvature = 2 * target_.weight;
  if (barrier_ != 0) curvature.array() += barrier_ * x.array().square().inverse();
  return curvature;
}

}  // namespace planish
