// Symmetric positive definite approximations of the inverse of a Schur complement.
#pragma once

#include "Eigen/Core"
#include "core/linalg/sparse_cholesky.h"

namespace planish {

class Preconditioner {
 public:
  virtual ~Preconditioner() = default;
  // z = K^-1 r.
  virtual void Apply(const Eigen::VectorXd& r, Eigen::VectorXd* z) const = 0;
};

class IdentityPreconditioner final : public Preconditioner {
 public:
  void Apply(const Eigen::VectorXd& r, Eigen::VectorXd* z) const override { *z = r; }
};

// K = diagonal, where positive; entries that are not (an indefinite system has such) count by their magnitude.
class JacobiPreconditioner final : public Preconditioner {
 public:
  explicit JacobiPreconditioner(const Eigen::VectorXd& diagonal);
  void Apply(const Eigen::VectorXd& r, Eigen::VectorXd* z) const override { *z = inverse_.cwiseProduct(r); }

 private:
  Eigen::VectorXd inverse_;
};

// K = a matrix that `factorization` has factorized; it must outlive this.
class CholeskyPreconditioner final : public Preconditioner {
 public:
  explicit CholeskyPreconditioner(const SparseCholesky* factorization) : factorization_(factorization) {}
  void Apply(const Eigen::VectorXd& r, Eigen::VectorXd* z) const override { factorization_->Solve(r, z); }

 private:
  const SparseCholesky* factorization_;
};

}  // namespace planish
