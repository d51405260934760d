#include "core/abf/line_search.h"

#include <algorithm>
#include <cmath>
#include <numbers>

#include "core/linalg/vector_ops.h"

namespace planish {
namespace {

constexpr double kPenaltyFactor = 1.5;

void Raise(ThreadTeam& team, const Eigen::VectorXd& mu, const Eigen::VectorXd& step, Eigen::VectorXd* nu) {
  if (nu->size() == 0) {
    Assign(team, kPenaltyFactor * (mu + step).cwiseAbs(), nu);
    return;
  }
  // Powell's rule lets penalties shrink, but slowly.
  Assign(team,
         nu->binaryExpr(mu + step,
                        [](double old, double multiplier) {
                          const double wanted = kPenaltyFactor * std::abs(multiplier);
                          return std::max(wanted, (old + wanted) / 2);
                        }),
         nu);
}

}  // namespace

double LargestStep(const Eigen::VectorXd& x, const Eigen::VectorXd& step, ThreadTeam& team) {
  constexpr double kKeep = 0.05;
  // The largest share of an angle's room that the whole step would take.
  const double taken = Largest(team, x.binaryExpr(step, [](double angle, double change) {
    return std::abs(change) / ((1 - kKeep) * (change < 0 ? angle : std::numbers::pi - angle));
  }));
  return taken > 1 ? 1 / taken : 1;
}

void MeritFunction::UpdatePenalties(const Multipliers& mu, const Multipliers& step) {
  Raise(team_, mu.triangle, step.triangle, &nu_.triangle);
  Raise(team_, mu.pair, step.pair, &nu_.pair);
}

double MeritFunction::PairPenalty(const Eigen::VectorXd& pair) const {
  return Sum(team_, nu_.pair.cwiseProduct(pair.cwiseAbs()));
}

double MeritFunction::Penalty(const ConstraintValues& h) const {
  return Sum(team_, nu_.triangle.cwiseProduct(h.triangle.cwiseAbs())) + PairPenalty(h.pair);
}

double MeritFunction::Value(const Eigen::VectorXd& x, const ConstraintValues& h) const {
  return objective_.Value(x) + Penalty(h);
}

MeritFunction::Derivative MeritFunction::Slope(const Eigen::VectorXd& x, const ConstraintValues& h,
                                               const Eigen::VectorXd& step) const {
  constexpr double kRelative = 1e-6;
  const Eigen::VectorXd gradient = objective_.Gradient(x);
  return {Dot(team_, gradient, step) - Penalty(h), kRelative * Sum(team_, gradient.cwiseProduct(step).cwiseAbs())};
}

}  // namespace planish
