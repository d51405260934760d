#include "core/linalg/patch_preconditioner.h"

#include <algorithm>
#include <memory>
#include <utility>

#include "core/base/status_macros.h"
#include "core/linalg/sparse_cholesky.h"

namespace planish {
namespace {

struct Patch {
  std::vector<std::int32_t> rows;
  BlockMatrix<double> matrix;  // row i is row rows[i] of S
  SparseCholesky factorization;

  void Apply(const Preconditioner& other, const Eigen::VectorXd& r, Eigen::VectorXd* z) const {
    const auto count = static_cast<std::int32_t>(rows.size());
    Eigen::VectorXd own(2 * count), solution;
    for (std::int32_t i = 0; i < count; ++i) own.segment<2>(2 * i) = r.segment<2>(2 * rows[i]);
    factorization.Solve(own, &solution);
    // block(k, i, j): block k of the patch's rows, in its row i and column j of S.
    const auto for_blocks = [&](const auto& block) {
      for (std::int32_t i = 0; i < count; ++i) {
        for (std::int32_t k = matrix.row_begin[i]; k < matrix.row_begin[i + 1]; ++k) {
          block(&matrix.value[4 * static_cast<std::size_t>(k)], i, matrix.column[k]);
        }
      }
    };
    // S is symmetric, so its columns are its rows.
    Eigen::VectorXd rest = r;
    for_blocks([&](const double* s, std::int32_t i, std::int32_t j) {
      rest[2 * j] -= s[0] * solution[2 * i] + s[2] * solution[2 * i + 1];
      rest[2 * j + 1] -= s[1] * solution[2 * i] + s[3] * solution[2 * i + 1];
    });
    other(rest, z);
    for (std::int32_t i = 0; i < count; ++i) z->segment<2>(2 * rows[i]) += solution.segment<2>(2 * i);
    for_blocks([&](const double* s, std::int32_t i, std::int32_t j) {
      own[2 * i] -= s[0] * (*z)[2 * j] + s[1] * (*z)[2 * j + 1];
      own[2 * i + 1] -= s[2] * (*z)[2 * j] + s[3] * (*z)[2 * j + 1];
    });
    factorization.Solve(own, &solution);
    for (std::int32_t i = 0; i < count; ++i) z->segment<2>(2 * rows[i]) += solution.segment<2>(2 * i);
  }
};

}  // namespace

absl::StatusOr<Preconditioner> PatchedPreconditioner(Preconditioner other, const BlockMatrix<float>& matrix,
                                                     std::vector<std::int32_t> rows, std::int64_t max_bytes) {
  BlockMatrix<double> part, own;  // the rows, and their columns in the patch, in the patch's numbering
  for (const std::int32_t row : rows) {
    for (std::int32_t k = matrix.row_begin[row]; k < matrix.row_begin[row + 1]; ++k) {
      const float* block = &matrix.value[4 * static_cast<std::size_t>(k)];
      part.column.push_back(matrix.column[k]);
      part.value.insert(part.value.end(), block, block + 4);
      const auto place = std::lower_bound(rows.begin(), rows.end(), matrix.column[k]);
      if (place == rows.end() || *place != matrix.column[k]) continue;
      own.column.push_back(static_cast<std::int32_t>(place - rows.begin()));
      own.value.insert(own.value.end(), block, block + 4);
    }
    part.row_begin.push_back(static_cast<std::int32_t>(part.column.size()));
    own.row_begin.push_back(static_cast<std::int32_t>(own.column.size()));
  }
  const auto patch = std::make_shared<Patch>(Patch{std::move(rows), std::move(part), {}});
  patch->factorization.set_max_bytes(max_bytes);
  PLANISH_RETURN_IF_ERROR(patch->factorization.Factorize(own));
  return [patch, other = std::move(other)](const Eigen::VectorXd& r, Eigen::VectorXd* z) { patch->Apply(other, r, z); };
}

}  // namespace planish
