// Sparse Cholesky factorization S = L L^t of symmetric positive definite matrices of 2x2 blocks.
//
// Without BLAS: one thread, no locks, and the same bits on every machine. Row by row (the "up-looking" method: Davis
// 2006, "Direct Methods for Sparse Linear Systems", chapter 4), with 2x2 blocks in place of numbers: one index serves
// four numbers, and the inner loop has 16 operations for each block that it reads.
#pragma once

#include <cstdint>
#include <limits>
#include <vector>

#include "Eigen/Core"
#include "absl/status/status.h"
#include "core/linalg/block_matrix.h"

namespace planish {

// The factorization of one matrix. Not thread-safe; independent objects may be used on different threads.
class SparseCholesky {
 public:
  // Limits the size of the factor, in bytes; no limit by default.
  void set_max_bytes(std::int64_t bytes) { max_bytes_ = bytes; }

  // Factorizes `matrix`. The ordering (approximate minimum degree; Amestoy, Davis, Duff 1996) and the pattern of L are
  // computed in the first call and kept while the pattern of the matrix stays the same. FAILED_PRECONDITION: not
  // positive definite; the message has the row. RESOURCE_EXHAUSTED: L takes more than the limit (the message has both
  // numbers), or memory ran out; the factorization is then empty.
  absl::Status Factorize(const BlockMatrix<double>& matrix);

  // Solves S x = b for the matrix S of the last Factorize(), which must have succeeded.
  void Solve(const Eigen::VectorXd& b, Eigen::VectorXd* x) const;

  // The size of L, in bytes; 0 before the first factorization.
  std::int64_t bytes() const;

 private:
  struct Factor {
    // The pattern of the matrix that the other members were made for.
    std::vector<std::int32_t> row_begin = {0}, column;
    std::vector<std::int32_t> order, place;  // place[order[k]] = k
    std::vector<std::int32_t> parent;        // in the elimination tree; -1 for a root
    // Column j of L below its diagonal: blocks [begin[j], begin[j + 1]), rows ascending. A block L_kj is stored as its
    // transpose by rows, four numbers.
    std::vector<std::int64_t> begin;
    std::vector<std::int32_t> row;
    std::vector<double> value;
    // The inverse of the diagonal block of column j: ((a, 0), (b, c)) as a, b, c.
    std::vector<double> inverse;

    // Computes the order, the elimination tree and the pattern of L.
    void Analyze(const BlockMatrix<double>& matrix);
    absl::Status FactorizeNumbers(const BlockMatrix<double>& matrix);
    // Finds the columns of row k of L: the nodes of the elimination tree on the paths from the columns of row k of the
    // matrix up to k. Writes them to the end of `pattern` and returns where they begin. Each comes after those that it
    // depends on.
    std::int32_t RowPattern(const BlockMatrix<double>& matrix, std::int32_t k, std::vector<std::int32_t>* mark,
                            std::vector<std::int32_t>* pattern) const;
  };

  std::int64_t max_bytes_ = std::numeric_limits<std::int64_t>::max();
  Factor l_;
};

}  // namespace planish
