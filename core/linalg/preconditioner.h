// Symmetric positive definite approximations K^-1 of the inverse of a Schur complement.
#pragma once

#include <cmath>
#include <functional>
#include <utility>

#include "Eigen/Core"

namespace planish {

// z = K^-1 r. Resizes z, which must not be r. Not thread-safe: some have vectors of their own.
using Preconditioner = std::function<void(const Eigen::VectorXd& r, Eigen::VectorXd* z)>;

inline Preconditioner IdentityPreconditioner() {
  return [](const Eigen::VectorXd& r, Eigen::VectorXd* z) { *z = r; };
}

// K = the magnitudes of `diagonal`, which has negative entries for an indefinite system; entries of 0 count as 1.
inline Preconditioner JacobiPreconditioner(const Eigen::VectorXd& diagonal) {
  Eigen::VectorXd inverse = diagonal.unaryExpr([](double d) { return d == 0 ? 1.0 : 1.0 / std::abs(d); });
  return [inverse = std::move(inverse)](const Eigen::VectorXd& r, Eigen::VectorXd* z) { *z = inverse.cwiseProduct(r); };
}

}  // namespace planish
