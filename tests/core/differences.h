// Derivatives by finite differences, for the tests of those by formula.
#pragma once

#include "Eigen/Core"

namespace planish::testing {

inline constexpr double kDifferenceStep = 1e-6;

// Central differences of a vector function, one column per variable.
template <typename Function>
Eigen::MatrixXd Differences(const Function& f, const Eigen::VectorXd& x) {
  Eigen::MatrixXd result(f(x).size(), x.size());
  for (Eigen::Index i = 0; i < x.size(); ++i) {
    Eigen::VectorXd plus = x, minus = x;
    plus[i] += kDifferenceStep;
    minus[i] -= kDifferenceStep;
    result.col(i) = (f(plus) - f(minus)) / (2 * kDifferenceStep);
  }
  return result;
}

}  // namespace planish::testing
