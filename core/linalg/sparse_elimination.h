// Gaussian elimination without pivots, for sparse matrices that have the same pattern and need none.
#pragma once

#include <cstdint>
#include <vector>

#include "Eigen/Core"
#include "Eigen/SparseCore"

namespace planish {

// For matrices of one symmetric pattern, whose rows each have a diagonal of 1 and other entries that are at most 0 and
// add up to -1 or more, as those of barycentric maps: elimination without pivots is stable for these. Keeps the pattern
// of U alone (A = L U, where U has the diagonal 1); the right-hand sides are eliminated with A. Without BLAS: the same
// bytes on every machine. Rows are taken as they come: whoever numbers them chooses the fill.
//
// Thread-safe: constant after construction.
class SparseElimination {
 public:
  using Matrix = Eigen::SparseMatrix<double, Eigen::RowMajor>;

  // `a` has the pattern of all matrices to come; its numbers do not count.
  explicit SparseElimination(const Matrix& a);

  // Replaces the right-hand sides x, a pair of numbers per row, by the solutions of A x = x. They are not finite if A
  // is singular in double precision.
  void Solve(const Matrix& a, std::vector<Eigen::Vector2d>* x) const;

 private:
  // The first column of row k of U beside the diagonal, or the number of rows.
  std::int32_t First(std::int32_t k) const { return begin_[k] < begin_[k + 1] ? column_[begin_[k]] : rows_; }

  std::int32_t rows_;
  std::vector<std::int64_t> begin_ = {0};  // per row of U: its first entry beside the diagonal
  std::vector<std::int32_t> column_;       // of these entries, ascending in each row
};

}  // namespace planish
