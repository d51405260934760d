// Derivatives by finite differences, for the tests of those by formula.
#pragma once

#include <functional>

#include "Eigen/Core"

namespace planish::testing {

inline constexpr double kDifferenceStep = 1e-6;

// Central differences of a vector function, one column per variable.
inline Eigen::MatrixXd Differences(const std::function<Eigen::VectorXd(const Eigen::VectorXd&)>& f,
                                   const Eigen::VectorXd& x) {
  Eigen::MatrixXd result(f(x).size(), x.size());
  for (Eigen::Index i = 0; i < x.size(); ++i) {
    Eigen::VectorXd plus = x, minus = x;
    plus[i] += kDifferenceStep;
    minus[i] -= kDifferenceStep;
    result.col(i) = (f(plus) - f(minus)) / (2 * kDifferenceStep);
  }
  return result;
}

// The largest absolute difference of two entries. One function for all: Eigen's expressions are slow to compile.
inline double Distance(const Eigen::MatrixXd& a, const Eigen::MatrixXd& b) {
  return (a - b).cwiseAbs().maxCoeff();
}

}  // namespace planish::testing
