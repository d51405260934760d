// Smoothed-aggregation multigrid for symmetric positive definite matrices of 2x2 blocks whose near-null vectors are
// the two constants (Vanek, Mandel, Brezina 1996). A preconditioner: one V-cycle in float.
//
// Per level, with D the diagonal blocks:
//   aggregates     sets of strongly coupled neighbours: |A_ij| >= theta
//   sqrt(|A_ii| |A_jj|), Frobenius norms prolongation   P = (I - omega D^-1 A)
//   P_0, P_0 constant on aggregates, omega = 4/3 over the largest
//                  eigenvalue of D^-1 A
//   coarse matrix  P^t A P, again of 2x2 blocks
//   smoother       Gauss-Seidel, forward before and backward after the coarse
//   correction: the cycle is symmetric
// The coarsest matrix is factorized.
#pragma once

#include <cstdint>
#include <memory>

#include "Eigen/Core"
#include "absl/status/status.h"
#include "core/linalg/block_matrix.h"
#include "core/linalg/preconditioner.h"

namespace planish {

struct MultigridOptions {
  double strength = 0.08;            // theta on the finest level, halved on every coarser one; in [0, 1)
  std::int32_t coarsest_rows = 120;  // block rows at which coarsening ends
  int max_levels = 20;
};

// Not thread-safe.
class Multigrid {
 public:
  explicit Multigrid(const MultigridOptions& options = {});
  ~Multigrid();
  Multigrid(const Multigrid&) = delete;
  Multigrid& operator=(const Multigrid&) = delete;

  // Builds aggregates and numbers for `matrix`. O(blocks). FAILED_PRECONDITION: a diagonal block or the coarsest
  // matrix is not positive definite.
  absl::Status Build(const BlockMatrix<double>& matrix);
  // New numbers on the aggregates of the last Build(); the pattern must be the same.
  absl::Status Refresh(const BlockMatrix<double>& matrix);

  // z = one V-cycle on r from zero.
  void Apply(const Eigen::VectorXd& r, Eigen::VectorXd* z) const;

  int num_levels() const;
  // Blocks on all levels over blocks on the finest.
  double operator_complexity() const;

 private:
  struct Impl;
  std::unique_ptr<Impl> impl_;
};

// K^-1 = one V-cycle of `multigrid`, which must outlive this.
class MultigridPreconditioner final : public Preconditioner {
 public:
  explicit MultigridPreconditioner(const Multigrid* multigrid) : multigrid_(multigrid) {}
  void Apply(const Eigen::VectorXd& r, Eigen::VectorXd* z) const override { multigrid_->Apply(r, z); }

 private:
  const Multigrid* multigrid_;
};

}  // namespace planish
