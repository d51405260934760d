#include "core/linalg/level_matrix.h"

#include <algorithm>
#include <atomic>

#include "Eigen/Cholesky"
#include "absl/strings/str_cat.h"

namespace planish {
namespace {

using Index = std::int32_t;

// Rows of a loop whose rows do not depend on each other.
constexpr Index kRows = 4096;

template <int N>
Eigen::Matrix<double, N, N> DenseBlock(const float* block) {
  Eigen::Matrix<double, N, N> dense;
  for (int p = 0; p < N; ++p) {
    for (int q = 0; q < N; ++q) {
      const int part = N == 2 ? 0 : 8 * (p / 2) + 4 * (q / 2);
      dense(p, q) = block[part + 2 * (p % 2) + q % 2];
    }
  }
  return dense;
}

template <int N>
void StoreDense(const Eigen::Matrix<double, N, N>& dense, float* block) {
  for (int p = 0; p < N; ++p) {
    for (int q = 0; q < N; ++q) {
      const int part = N == 2 ? 0 : 8 * (p / 2) + 4 * (q / 2);
      block[part + 2 * (p % 2) + q % 2] = static_cast<float>(dense(p, q));
    }
  }
}

}  // namespace

template <int N>
void LevelMatrix<N>::SetPattern(const std::vector<Index>& begin, const std::vector<Index>& columns, ThreadTeam* team) {
  row_begin = begin;
  column.resize(columns.size());
  const Index n = num_rows();
  diagonal.resize(n);
  outside_begin.resize(n);
  team->For(n, kRows, [&](std::int64_t first_row, std::int64_t last_row) {
    std::vector<Index> sorted;
    for (auto i = static_cast<Index>(first_row); i < last_row; ++i) {
      sorted.assign(columns.begin() + begin[i], columns.begin() + begin[i + 1]);
      if (!std::is_sorted(sorted.begin(), sorted.end())) std::sort(sorted.begin(), sorted.end());
      const Index first = i / kChunk * kChunk, last = first + kChunk;
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
absl::Status LevelMatrix<N>::InvertDiagonal(ThreadTeam* team) {
  const Index n = num_rows();
  inverse.resize(static_cast<std::size_t>(kBlockSize * n));
  std::atomic<Index> bad = n;
  team->For(n, kRows, [&](std::int64_t begin, std::int64_t end) {
    for (auto i = static_cast<Index>(begin); i < end; ++i) {
      if (diagonal[i] == row_begin[i + 1]) {
        bad = i;
        return;
      }
      const Eigen::LLT<Eigen::Matrix<double, N, N>> factorization(DenseBlock<N>(Block(diagonal[i])));
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
  team->For(level->num_rows(), kRows, [&](std::int64_t begin, std::int64_t end) {
    for (auto i = static_cast<Index>(begin); i < end; ++i) {
      const Index first = i / level->kChunk * level->kChunk, last = first + level->kChunk;
      Index inside = level->row_begin[i], outside = level->outside_begin[i];
      for (Index k = matrix.row_begin[i]; k < matrix.row_begin[i + 1]; ++k) {
        const Index j = matrix.column[k];
        float* to = level->Block(j < first || j >= last ? outside++ : inside++);
        std::copy_n(&matrix.value[4 * static_cast<std::size_t>(k)], 4, to);
      }
    }
  });
}

}  // namespace planish
