#include "core/linalg/sparse_elimination.h"

#include <algorithm>
#include <utility>

namespace planish {

// Row k of U has the columns right of the diagonal in row k of A, and those of the rows of U whose first column is k.
SparseElimination::SparseElimination(const Matrix& a) : rows_(static_cast<std::int32_t>(a.rows())) {
  std::vector<std::int32_t> seen(rows_, -1);
  std::vector<std::vector<std::int32_t>> beginning_at(rows_);
  for (std::int32_t k = 0; k < rows_; ++k) {
    const auto add = [&](std::int32_t column) {
      if (column > k && std::exchange(seen[column], k) != k) column_.push_back(column);
    };
    for (Matrix::InnerIterator it(a, k); it; ++it) add(static_cast<std::int32_t>(it.col()));
    for (const std::int32_t j : beginning_at[k]) {
      for (std::int64_t e = begin_[j]; e < begin_[j + 1]; ++e) add(column_[e]);
    }
    std::sort(column_.begin() + begin_[k], column_.end());
    begin_.push_back(std::ssize(column_));
    if (First(k) < rows_) beginning_at[First(k)].push_back(k);
  }
}

void SparseElimination::Solve(const Matrix& a, std::vector<Eigen::Vector2d>* x) const {
  std::vector<double> row(rows_, 0), u(column_.size());
  std::vector<std::int32_t> reached, seen(rows_, -1);
  for (std::int32_t k = 0; k < rows_; ++k) {
    reached.clear();
    for (Matrix::InnerIterator it(a, k); it; ++it) {
      row[it.col()] = it.value();
      for (auto j = static_cast<std::int32_t>(it.col()); j < k && std::exchange(seen[j], k) != k; j = First(j)) {
        reached.push_back(j);
      }
    }
    std::sort(reached.begin(), reached.end());
    for (const std::int32_t j : reached) {
      const double l = std::exchange(row[j], 0);
      for (std::int64_t e = begin_[j]; e < begin_[j + 1]; ++e) row[column_[e]] -= l * u[e];
      (*x)[k] -= l * (*x)[j];
    }
    const double diagonal = std::exchange(row[k], 0);
    for (std::int64_t e = begin_[k]; e < begin_[k + 1]; ++e) u[e] = std::exchange(row[column_[e]], 0) / diagonal;
    (*x)[k] /= diagonal;
  }
  for (std::int32_t k = rows_ - 1; k >= 0; --k) {
    for (std::int64_t e = begin_[k]; e < begin_[k + 1]; ++e) (*x)[k] -= u[e] * (*x)[column_[e]];
  }
}

}  // namespace planish
