#include "core/abf/line_search.h"

#include <algorithm>
#include <cmath>
#include <numbers>

#include "core/linalg/vector_ops.h"

namespace planish {
namespace {

void UpdatePenalty(ThreadTeam& team, double factor, const Eigen::VectorXd& mu, const Eigen::VectorXd& step,
                   Eigen::VectorXd* nu) {
  if (nu->size() == 0) *nu = Eigen::VectorXd::Zero(mu.size());
  // Powell's rule (1978, "A fast algorithm for nonlinearly constrained optimization calculations") lets penalties
  // shrink, but slowly.
  Assign(team,
         nu->binaryExpr(mu + step,
                        [factor](double old, double multiplier) {
                          const double wanted = factor * std::abs(multiplier);
                          return std::max(wanted, (old + wanted) / 2);
                        }),
         nu);
}

}  // namespace

double LargestStepLength(const Eigen::VectorXd& x, const Eigen::VectorXd& step, ThreadTeam& team,
                         const LineSearchTuning& tuning) {
  const double fraction = tuning.fraction_to_boundary;
  // Nearly all steps fit, which this test finds without a division or branch per angle.
  const double excess = Largest(
      team, (-step - fraction * x).cwiseMax(step - fraction * (std::numbers::pi - x.array()).matrix()).cwiseMax(0));
  if (!(excess > 0)) return 1;
  // The largest fraction of an angle's allowed change that the whole step would take.
  const double taken = Largest(team, x.binaryExpr(step, [fraction](double angle, double change) {
    return std::abs(change) / (fraction * (change < 0 ? angle : std::numbers::pi - angle));
  }));
  return taken > 1 ? 1 / taken : 1;
}

Eigen::VectorXd ClippedStep(const Eigen::VectorXd& x, const Eigen::VectorXd& step, ThreadTeam& team,
                            const LineSearchTuning& tuning) {
  const double fraction = tuning.clipped_fraction;
  Eigen::VectorXd clipped;
  Assign(team,
         x.binaryExpr(step,
                      [fraction](double angle, double change) {
                        return std::clamp(change, -fraction * angle, fraction * (std::numbers::pi - angle));
                      }),
         &clipped);
  return clipped;
}

void MeritFunction::UpdatePenalties(const Multipliers& mu, const Multipliers& step) {
  UpdatePenalty(team_, tuning_.penalty_factor, mu.triangle, step.triangle, &nu_.triangle);
  UpdatePenalty(team_, tuning_.penalty_factor, mu.pair, step.pair, &nu_.pair);
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
  const Objective::Directional along = objective_.Along(x, step);
  return {along.derivative - Penalty(h), tuning_.slope_noise * along.magnitude};
}

}  // namespace planish
