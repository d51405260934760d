// Sparse Cholesky factorization S = L L^t of symmetric positive definite matrices of 2x2 blocks.
//
// Without BLAS: one thread, no locks, and the same bits on every machine. The factorization goes row by row (the
// "up-looking" method: Davis 2006, "Direct Methods for Sparse Linear Systems", chapter 4), with blocks of 2x2 in the
// place of numbers: one index serves four numbers, and the inner loop has 16 operations for each block that it reads.
#pragma once

#include <cstdint>
#include <memory>

#include "Eigen/Core"
#include "absl/status/status.h"
#include "core/linalg/block_matrix.h"

namespace planish {

// Not thread-safe; independent objects may be used on different threads.
class SparseCholesky {
 public:
  SparseCholesky();
  ~SparseCholesky();
  SparseCholesky(const SparseCholesky&) = delete;
  SparseCholesky& operator=(const SparseCholesky&) = delete;

  // The most that the factor may take, in bytes; the default is no limit.
  void set_max_bytes(std::int64_t bytes);

  // Factorizes `matrix`. The ordering (approximate minimum degree; Amestoy, Davis, Duff 1996) and the pattern of L are
  // made in the first call and kept while the pattern of the matrix stays the same.
  // FAILED_PRECONDITION: not positive definite, with the row. RESOURCE_EXHAUSTED: L takes more than the limit, with
  // both numbers, or there is no memory; nothing is left of the factorization then.
  absl::Status Factorize(const BlockMatrix<double>& matrix);

  // x = S^-1 b for the matrix S factorized last, which must have succeeded.
  void Solve(const Eigen::VectorXd& b, Eigen::VectorXd* x) const;

  // The size of L, in bytes; 0 before the first factorization.
  std::int64_t bytes() const;

 private:
  struct Impl;
  std::unique_ptr<Impl> impl_;
};

}  // namespace planish
