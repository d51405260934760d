// Gaussian elimination without pivoting, for sparse matrices of one pattern that need none.
#pragma once

#include <cstdint>
#include <vector>

#include "Eigen/Core"
#include "Eigen/SparseCore"

namespace planish {

// For matrices of one symmetric pattern in which each row has a diagonal of 1 and other entries that are at most 0 and
// sum to -1 or more, such as those of barycentric maps: elimination without pivoting is stable for these. Stores only
// the pattern of U (A = L U, where U has the diagonal 1); right-hand sides are eliminated together with A. Without
// BLAS: the same bytes on every machine. Rows are eliminated in their order, so the caller's numbering decides the
// fill.
//
// Thread-safe: constant after construction.
class SparseElimination {
 public:
  using Matrix = Eigen::SparseMatrix<double, Eigen::RowMajor>;

  // `a` has the pattern of all matrices to come; its numbers are ignored.
  explicit SparseElimination(const Matrix& a);

  // Replaces the right-hand sides x, a pair of numbers per row, by the solutions. They are not finite if A is singular
  // in double precision.
  void Solve(const Matrix& a, std::vector<Eigen::Vector2d>* x) const;

 private:
  // The first column of row k of U after the diagonal, or the number of rows.
  std::int32_t First(std::int32_t k) const { return begin_[k] < begin_[k + 1] ? column_[begin_[k]] : rows_; }

  std::int32_t rows_;
  std::vector<std::int64_t> begin_ = {0};  // per row of U: its first entry after the diagonal
  std::vector<std::int32_t> column_;       // of these entries, ascending in each row
};

}  // namespace planish
