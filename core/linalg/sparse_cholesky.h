// Sparse Cholesky factorization of a sequence of matrices with one pattern (CHOLMOD).
#pragma once

#include <memory>

#include "Eigen/Core"
#include "absl/status/status.h"
#include "core/linalg/saddle_point.h"

namespace planish {

// Not thread-safe; independent objects may be used on different threads.
class SparseCholesky {
 public:
  SparseCholesky();
  ~SparseCholesky();
  SparseCholesky(const SparseCholesky&) = delete;
  SparseCholesky& operator=(const SparseCholesky&) = delete;

  // Factorizes `lower`, the lower triangle of a symmetric matrix. The fill-reducing ordering (nested dissection) and
  // the symbolic factorization are made at the first call and reused as long as the pattern stays the same. Rows and
  // columns that come in dense blocks of `block_size` are ordered as one: the ordering works on a graph that much
  // smaller. FAILED_PRECONDITION: not positive definite, with the column. RESOURCE_EXHAUSTED: no memory.
  absl::Status Factorize(const SparseMatrix& lower, int block_size);

  // x = K^-1 b for the matrix K factorized last, which must have succeeded.
  void Solve(const Eigen::VectorXd& b, Eigen::VectorXd* x) const;

 private:
  struct Impl;
  std::unique_ptr<Impl> impl_;
};

}  // namespace planish
