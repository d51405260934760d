// Symmetric positive definite approximations K^-1 of the inverse of a Schur complement. Not thread-safe: some work in
// vectors of their own.
#pragma once

#include <cmath>

#include "Eigen/Core"
#include "core/linalg/sparse_cholesky.h"

namespace planish {

class Preconditioner {
 public:
  virtual ~Preconditioner() = default;
  // z = K^-1 r. z is resized, and must not be r.
  virtual void Apply(const Eigen::VectorXd& r, Eigen::VectorXd* z) const = 0;
};

class IdentityPreconditioner final : public Preconditioner {
 public:
  void Apply(const Eigen::VectorXd& r, Eigen::VectorXd* z) const override { *z = r; }
};

// K = the magnitudes of `diagonal`, which has negative entries for an indefinite system; entries of 0 count as 1.
class JacobiPreconditioner final : public Preconditioner {
 public:
  explicit JacobiPreconditioner(const Eigen::VectorXd& diagonal)
      : inverse_(diagonal.unaryExpr([](double d) { return d == 0 ? 1.0 : 1.0 / std::abs(d); })) {}
  void Apply(const Eigen::VectorXd& r, Eigen::VectorXd* z) const override { *z = inverse_.cwiseProduct(r); }

 private:
  Eigen::VectorXd inverse_;
};

// K = the matrix that `factorization` factorized last. The factorization must outlive this.
class CholeskyPreconditioner final : public Preconditioner {
 public:
  explicit CholeskyPreconditioner(const SparseCholesky* factorization) : factorization_(factorization) {}
  void Apply(const Eigen::VectorXd& r, Eigen::VectorXd* z) const override { factorization_->Solve(r, z); }

 private:
  const SparseCholesky* factorization_;
};

}  // namespace planish
