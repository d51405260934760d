// Square sparse matrices of dense 2x2 blocks, symmetric, stored whole.
#pragma once

#include <cstdint>
#include <vector>

#include "Eigen/Core"
#include "core/base/thread_team.h"

namespace planish {

// Row i of blocks is [row_begin[i], row_begin[i + 1]), columns ascending. `value` holds four numbers a block, by rows.
// Entry (2 i + p, 2 j + q) of the matrix is number 2 p + q of block (i, j).
template <typename Scalar>
struct BlockMatrix {
  std::vector<std::int32_t> row_begin = {0};
  std::vector<std::int32_t> column;
  std::vector<Scalar> value;

  std::int32_t num_rows() const { return static_cast<std::int32_t>(row_begin.size()) - 1; }
};

// y = A x, summed up in double.
template <typename Scalar>
void Multiply(const BlockMatrix<Scalar>& a, const Eigen::VectorXd& x, Eigen::VectorXd* y, ThreadTeam& team = Alone()) {
  using Block = Eigen::Array<Scalar, 2, 1>;
  y->resize(x.size());
  team.ForEach(a.num_rows(), [&](std::int64_t i) {
    Eigen::Array2d upper(0, 0), lower(0, 0);
    for (std::int32_t k = a.row_begin[i]; k < a.row_begin[i + 1]; ++k) {
      const Scalar* block = &a.value[4 * static_cast<std::size_t>(k)];
      const Eigen::Array2d at = x.segment<2>(2 * Eigen::Index{a.column[k]}).array();
      upper += Eigen::Map<const Block>(block).template cast<double>() * at;
      lower += Eigen::Map<const Block>(block + 2).template cast<double>() * at;
    }
    (*y)[2 * i] = upper.sum();
    (*y)[2 * i + 1] = lower.sum();
  });
}

}  // namespace planish
