#include "core/linalg/block_matrix.h"

namespace planish {

void Multiply(const BlockMatrix<double>& a, const Eigen::VectorXd& x, Eigen::VectorXd* y) {
  y->resize(x.size());
  const double* value = a.value.data();
  for (std::int32_t i = 0; i < a.num_rows(); ++i) {
    double y0 = 0, y1 = 0;
    for (std::int32_t k = a.row_begin[i]; k < a.row_begin[i + 1]; ++k) {
      const double x0 = x[2 * a.column[k]], x1 = x[2 * a.column[k] + 1];
      const double* block = value + 4 * static_cast<std::int64_t>(k);
      y0 += block[0] * x0 + block[1] * x1;
      y1 += block[2] * x0 + block[3] * x1;
    }
    (*y)[2 * i] = y0;
    (*y)[2 * i + 1] = y1;
  }
}

SparseMatrix LowerTriangle(const BlockMatrix<double>& a) {
  const std::int32_t n = a.num_rows();
  SparseMatrix lower(2 * n, 2 * n);
  lower.resizeNonZeros(2 * (a.num_blocks() + n) - n);
  int* begin = lower.outerIndexPtr();
  int* row = lower.innerIndexPtr();
  double* value = lower.valuePtr();
  // The matrix is symmetric: column j of the lower triangle is row j from the diagonal on.
  int at = 0;
  for (std::int32_t j = 0; j < n; ++j) {
    for (int q = 0; q < 2; ++q) {
      begin[2 * j + q] = at;
      for (std::int32_t k = a.row_begin[j]; k < a.row_begin[j + 1]; ++k) {
        const std::int32_t i = a.column[k];
        for (int p = i == j ? q : 0; i >= j && p < 2; ++p, ++at) {
          row[at] = 2 * i + p;
          value[at] = a.value[4 * static_cast<std::int64_t>(k) + 2 * q + p];
        }
      }
    }
  }
  begin[2 * n] = at;
  return lower;
}

}  // namespace planish
