// The matrix of one level of the multigrid: blocks of float, in the order of the smoother.
#pragma once

#include <cstdint>
#include <type_traits>
#include <vector>

#include "Eigen/Core"
#include "absl/status/status.h"
#include "core/base/thread_team.h"
#include "core/linalg/block_matrix.h"
#include "core/linalg/float_block.h"

namespace planish {

// Rows of a chunk in all loops but the smoother's.
inline constexpr std::int64_t kRowsPerChunk = 4096;

// The position of entry (p, q) in an N x N block: by rows for N = 2; for N = 4 by its four 2x2 parts (00, 01, 10, 11),
// each by rows.
template <int N>
constexpr int PlaceInBlock(int p, int q) {
  return (N == 2 ? 0 : 8 * (p / 2) + 4 * (q / 2)) + 2 * (p % 2) + q % 2;
}
template <int N>
Eigen::Matrix<double, N, N> DenseBlock(const float* block) {
  Eigen::Matrix<double, N, N> dense;
  for (int p = 0; p < N; ++p) {
    for (int q = 0; q < N; ++q) dense(p, q) = block[PlaceInBlock<N>(p, q)];
  }
  return dense;
}

// N x N blocks (PlaceInBlock), N = 2 on the finest level and 4 on the others. Row i holds [row_begin[i], row_begin[i +
// 1]) in this order: columns of its own chunk before i, the diagonal at diagonal[i], columns of its own chunk after i,
// and from outside_begin[i] on columns of other chunks.
template <int N>
struct LevelMatrix {
  static constexpr std::int64_t kBlockSize = N * N;

  // Rows that one thread relaxes in sequence (MultigridTuning). Rows of different chunks are relaxed in parallel from
  // each other's old values, whatever the number of threads.
  std::int32_t chunk_rows = 1;
  std::vector<std::int32_t> row_begin = {0};
  std::vector<std::int32_t> diagonal, outside_begin;
  std::vector<std::int32_t> column;
  std::vector<float> value;
  std::vector<float> inverse;  // of D + E, the diagonal blocks and the damping
  // E: N numbers a row, zero in rows without columns of other chunks.
  std::vector<float> damping;

  std::int32_t num_rows() const { return static_cast<std::int32_t>(row_begin.size()) - 1; }
  const float* Block(std::int32_t k) const { return &value[static_cast<std::size_t>(kBlockSize * k)]; }
  float* Block(std::int32_t k) { return &value[static_cast<std::size_t>(kBlockSize * k)]; }

  // Whether row i has columns of other chunks.
  bool HasOutside(std::int32_t i) const { return outside_begin[i] < row_begin[i + 1]; }

  // Sets the pattern: row i has columns [begin[i], begin[i + 1]) of `columns`, in any order. The smoother's chunks have
  // `rows_per_chunk` rows.
  void SetPattern(const std::vector<std::int32_t>& begin, const std::vector<std::int32_t>& columns,
                  std::int64_t rows_per_chunk, ThreadTeam* team);
  // Fills `damping` and `inverse`; for `undamped_part` see MultigridTuning. FAILED_PRECONDITION: a diagonal block is
  // missing or not positive definite.
  absl::Status InvertDiagonal(double undamped_part, ThreadTeam* team);
};

// Copies the numbers of `matrix`, whose columns ascend, into `level`, which has its pattern.
void SetValues(const BlockMatrix<float>& matrix, LevelMatrix<2>* level, ThreadTeam* team);

template <int N>
using LevelVector = std::conditional_t<N == 2, Float2, Float4>;

// The product of blocks [first, last) of `a`, which are in one row, and x.
inline Float2 RowProduct(const LevelMatrix<2>& a, std::int32_t first, std::int32_t last, const float* x) {
  Float4 terms = {};
  for (std::int32_t k = first; k < last; ++k) {
    terms += Terms(Load<Float4>(a.Block(k)), Load<Float2>(x + 2 * std::int64_t{a.column[k]}));
  }
  return RowSums(terms);
}
inline Float4 RowProduct(const LevelMatrix<4>& a, std::int32_t first, std::int32_t last, const float* x) {
  Products4 sum;
  for (std::int32_t k = first; k < last; ++k) sum.Add(a.Block(k), Load<Float4>(x + 4 * std::int64_t{a.column[k]}));
  return sum.Value();
}

// The inverse of diagonal block i times r.
inline Float2 SolveRow(const LevelMatrix<2>& a, std::int32_t i, const Float2& r) {
  return RowSums(Terms(Load<Float4>(&a.inverse[4 * std::size_t(i)]), r));
}
inline Float4 SolveRow(const LevelMatrix<4>& a, std::int32_t i, const Float4& r) {
  Products4 product;
  product.Add(&a.inverse[16 * std::size_t(i)], r);
  return product.Value();
}

}  // namespace planish
