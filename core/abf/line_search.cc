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
  // Nearly all steps fit, which takes neither a division nor a branch per angle to see.
  const double excess = Largest(
      team,
      (-step - (1 - kKeep) * x).cwiseMax(step - (1 - kKeep) * (std::numbers::pi - x.array()).matrix()).cwiseMax(0));
  if (!(excess > 0)) return 1;
  // The largest share of an angle's room that the whole step would take.
  const double taken = Largest(team, x.binaryExpr(step, [](double angle, double change) {
    return std::abs(change) / ((1 - kKeep) * (change < 0 ? angle : std::numbers::pi - angle));
  }));
  return taken > 1 ? 1 / taken : 1;
}

Eigen::VectorXd HeldStep(const Eigen::VectorXd& x, const Eigen::VectorXd& step, ThreadTeam& team) {
  constexpr double kKeep = 0.1;
  Eigen::VectorXd held;
  Assign(team,
         x.binaryExpr(step,
                      [](double angle, double change) {
                        return std::clamp(change, -(1 - kKeep) * angle, (1 - kKeep) * (std::numbers::pi - angle));
                      }),
         &held);
  return held;
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

double MeritFunction::Value(const Eigen::VectorXd& x, double energy, const ConstraintValues& h) const {
  return objective_.Value(x, energy) + Penalty(h);
}

MeritFunction::Derivative MeritFunction::Slope(const Eigen::VectorXd& x, const ConstraintValues& h,
                                               const Eigen::VectorXd& step) const {
  constexpr double kRelative = 1e-6;
  const Objective::Directional along = objective_.Along(x, step);
  return {along.derivative - Penalty(h), kRelative * along.magnitude};
}

}  // namespace planish
