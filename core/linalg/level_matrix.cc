#include "core/linalg/level_matrix.h"

#include <algorithm>
#include <atomic>
#include <cmath>

#include "Eigen/Cholesky"
#include "absl/strings/str_cat.h"

namespace planish {
namespace {

using Index = std::int32_t;

template <int N>
void StoreDense(const Eigen::Matrix<double, N, N>& dense, float* block) {
  for (int p = 0; p < N; ++p) {
    for (int q = 0; q < N; ++q) block[PlaceInBlock<N>(p, q)] = static_cast<float>(dense(p, q));
  }
}

// E in row i, whose diagonal block is `own`: large enough that D + 2 E - Out is positive definite. By |x a y| <= |a| (s
// x^2 + y^2 / s) / 2, where s is the square root of the quotient of the two diagonal entries (which makes this
// independent of the scale of unknowns), the couplings take the sum computed here from the diagonal.
template <int N>
Eigen::Matrix<double, N, 1> Damping(const LevelMatrix<N>& a, Index i, const Eigen::Matrix<double, N, N>& own,
                                    double undamped_part) {
  const auto number = [](const float* block, int p, int q) { return double{block[PlaceInBlock<N>(p, q)]}; };
  Eigen::Matrix<double, N, 1> sums = Eigen::Matrix<double, N, 1>::Zero();
  for (Index k = a.outside_begin[i]; k < a.row_begin[i + 1]; ++k) {
    const float *block = a.Block(k), *other = a.Block(a.diagonal[a.column[k]]);
    for (int q = 0; q < N; ++q) {
      const double scale = 1 / number(other, q, q);
      for (int p = 0; p < N; ++p) sums[p] += std::abs(number(block, p, q)) * std::sqrt(own(p, p) * scale);
    }
  }
  // A lower bound of the eigenvalues of a 2x2 block relative to its diagonal; 0, which uses none of it, for 4x4 blocks.
  const double least = N == 2 ? 1 - std::abs(own(0, 1)) / std::sqrt(own(0, 0) * own(1, 1)) : 0;
  return 0.5 * (sums - undamped_part * least * own.diagonal()).cwiseMax(0.0);
}

}  // namespace

template <int N>
void LevelMatrix<N>::SetPattern(const std::vector<Index>& begin, const std::vector<Index>& columns,
                                std::int64_t rows_per_chunk, ThreadTeam* team) {
  chunk_rows = static_cast<Index>(rows_per_chunk);
  row_begin = begin;
  column.resize(columns.size());
  const Index n = num_rows();
  diagonal.resize(n);
  outside_begin.resize(n);
  team->For(n, kRowsPerChunk, [&](std::int64_t first_row, std::int64_t last_row) {
    std::vector<Index> sorted;
    for (auto i = static_cast<Index>(first_row); i < last_row; ++i) {
      sorted.assign(columns.begin() + begin[i], columns.begin() + begin[i + 1]);
      if (!std::is_sorted(sorted.begin(), sorted.end())) std::sort(sorted.begin(), sorted.end());
      const Index first = i / chunk_rows * chunk_rows, last = first + chunk_rows;
      Index at = begin[i];
      diagonal[i] = begin[i + 1];
      for (const Index j : sorted) {
        if (j < first || j >= last) continue;
        if (j == i) diagonal[i] = at;
        column[at++] = j;
      }
      outside_begin[i] = at;
      for (const Index j : sorted) {
        if (j < first || j >= last) column[at++] = j;
      }
    }
  });
  value.resize(static_cast<std::size_t>(kBlockSize) * column.size());
}

template <int N>
absl::Status LevelMatrix<N>::InvertDiagonal(double undamped_part, ThreadTeam* team) {
  const Index n = num_rows();
  inverse.resize(static_cast<std::size_t>(kBlockSize * n));
  damping.assign(N * static_cast<std::size_t>(n), 0.0F);
  std::atomic<Index> bad = n;
  team->For(n, kRowsPerChunk, [&](std::int64_t begin, std::int64_t end) {
    for (auto i = static_cast<Index>(begin); i < end; ++i) {
      if (diagonal[i] == row_begin[i + 1]) {
        bad = i;
        return;
      }
      Eigen::Matrix<double, N, N> block = DenseBlock<N>(Block(diagonal[i]));
      if (HasOutside(i)) {
        const Eigen::Matrix<double, N, 1> damped = Damping(*this, i, block, undamped_part);
        for (int p = 0; p < N; ++p) damping[N * std::size_t(i) + p] = static_cast<float>(damped[p]);
        block.diagonal() += damped;
      }
      const Eigen::LLT<Eigen::Matrix<double, N, N>> factorization(block);
      if (factorization.info() != Eigen::Success) {
        bad = i;
        return;
      }
      StoreDense<N>(factorization.solve(Eigen::Matrix<double, N, N>::Identity()),
                    &inverse[static_cast<std::size_t>(kBlockSize * i)]);
    }
  });
  if (bad == n) return absl::OkStatus();
  return absl::FailedPreconditionError(
      absl::StrCat("multigrid: diagonal block ", bad.load(), " of ", n, " is not positive definite"));
}

template struct LevelMatrix<2>;
template struct LevelMatrix<4>;

void SetValues(const BlockMatrix<float>& matrix, LevelMatrix<2>* level, ThreadTeam* team) {
  team->ForEach(level->num_rows(), [&](Index i) {
    const Index first = i / level->chunk_rows * level->chunk_rows, last = first + level->chunk_rows;
    Index inside = level->row_begin[i], outside = level->outside_begin[i];
    for (Index k = matrix.row_begin[i]; k < matrix.row_begin[i + 1]; ++k) {
      const Index j = matrix.column[k];
      float* to = level->Block(j < first || j >= last ? outside++ : inside++);
      std::copy_n(&matrix.value[4 * static_cast<std::size_t>(k)], 4, to);
    }
  });
}

}  // namespace planish
