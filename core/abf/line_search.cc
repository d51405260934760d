#include "core/abf/line_search.h"

#include <algorithm>
#include <numbers>

namespace planish {
namespace {

constexpr double kPenaltyFactor = 1.5;

void Raise(const Eigen::VectorXd& mu, const Eigen::VectorXd& step, Eigen::VectorXd* nu) {
  const Eigen::ArrayXd wanted = kPenaltyFactor * (mu + step).array().abs();
  if (nu->size() == 0) {
    *nu = wanted;
  } else {
    // Powell's rule lets penalties shrink, but slowly.
    *nu = wanted.max((nu->array() + wanted) / 2);
  }
}

}  // namespace

double LargestStep(const Eigen::VectorXd& x, const Eigen::VectorXd& step) {
  constexpr double kKeep = 0.05;
  double alpha = 1;
  for (Eigen::Index i = 0; i < x.size(); ++i) {
    const double room = (1 - kKeep) * (step[i] < 0 ? x[i] : std::numbers::pi - x[i]);
    if (std::abs(step[i]) * alpha > room) alpha = room / std::abs(step[i]);
  }
  return alpha;
}

void MeritFunction::UpdatePenalties(const Multipliers& mu, const Multipliers& step) {
  Raise(mu.triangle, step.triangle, &nu_.triangle);
  Raise(mu.pair, step.pair, &nu_.pair);
}

double MeritFunction::Penalty(const ConstraintValues& h) const {
  return (nu_.triangle.array() * h.triangle.array().abs()).sum() + (nu_.pair.array() * h.pair.array().abs()).sum();
}

double MeritFunction::Value(const Objective& objective, const Eigen::VectorXd& x, const ConstraintValues& h) const {
  return objective.Value(x) + Penalty(h);
}

double MeritFunction::SlopeNoise(const Objective& objective, const Eigen::VectorXd& x,
                                 const Eigen::VectorXd& step) const {
  constexpr double kRelative = 1e-6;
  return kRelative * objective.Gradient(x).cwiseProduct(step).cwiseAbs().sum();
}

double MeritFunction::Slope(const Objective& objective, const Eigen::VectorXd& x, const ConstraintValues& h,
                            const Eigen::VectorXd& step) const {
  return objective.Gradient(x).dot(step) - Penalty(h);
}

}  // namespace planish
