// Exact solves on a few rows before and after another preconditioner: a multiplicative Schwarz method of two subspaces.
#pragma once

#include <cstdint>
#include <memory>
#include <utility>
#include <vector>

#include "absl/status/status.h"
#include "core/linalg/block_matrix.h"
#include "core/linalg/preconditioner.h"
#include "core/linalg/sparse_cholesky.h"

namespace planish {

// For a matrix S and a patch, some of its rows of blocks, where the other preconditioner M^-1 serves badly: with P^-1,
// the inverse of the rows' own part of S and zero elsewhere,
//   1 - K^-1 S = (1 - P^-1 S) (1 - M^-1 S) (1 - P^-1 S).
// Symmetric, and positive definite wherever 1 - M^-1 S is not negative beyond -1, as that of a multigrid cycle.
class PatchPreconditioner final : public Preconditioner {
 public:
  explicit PatchPreconditioner(std::unique_ptr<Preconditioner> other) : other_(std::move(other)) {}

  // The patch. Copies what it needs of `matrix`, so that this may change; `rows` ascend. Nothing changes after an
  // error: FAILED_PRECONDITION, not positive definite.
  absl::Status SetPatch(const BlockMatrix<float>& matrix, std::vector<std::int32_t> rows);

  void Apply(const Eigen::VectorXd& r, Eigen::VectorXd* z) const override;

 private:
  std::unique_ptr<Preconditioner> other_;
  std::vector<std::int32_t> rows_;
  BlockMatrix<double> matrix_;  // row i is row rows_[i] of S
  SparseCholesky factorization_;
};

}  // namespace planish
