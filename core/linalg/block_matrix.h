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

// y = A x, summed up in double. For float and double.
template <typename Scalar>
void Multiply(const BlockMatrix<Scalar>& a, const Eigen::VectorXd& x, Eigen::VectorXd* y, ThreadTeam& team = Alone());

}  // namespace planish
