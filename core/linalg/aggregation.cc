#include "core/linalg/aggregation.h"

#include <algorithm>
#include <cmath>

namespace planish {
namespace {

// Of the leading 2x2 part.
float SquaredNorm(const float* block) {
  return block[0] * block[0] + block[1] * block[1] + block[2] * block[2] + block[3] * block[3];
}

}  // namespace

template <int N>
std::vector<char> StrongCouplings(const LevelMatrix<N>& matrix, double theta, std::int32_t num_coupled,
                                  ThreadTeam* team) {
  const std::int32_t n = matrix.num_rows();
  std::vector<float> diagonal(n);
  team->ForEach(n, [&](std::int64_t i) { diagonal[i] = std::sqrt(SquaredNorm(matrix.Block(matrix.diagonal[i]))); });
  const auto threshold = static_cast<float>(theta * theta);
  std::vector<char> strong(matrix.column.size());
  team->ForEach(std::min(n, num_coupled), [&](std::int64_t i) {
    for (std::int32_t k = matrix.row_begin[i]; k < matrix.row_begin[i + 1]; ++k) {
      const std::int32_t j = matrix.column[k];
      strong[k] = j != i && j < num_coupled && SquaredNorm(matrix.Block(k)) >= threshold * diagonal[i] * diagonal[j];
    }
  });
  return strong;
}

template <int N>
Aggregates Aggregate(const LevelMatrix<N>& matrix, const std::vector<char>& strong,
                     std::int64_t second_ring_neighbours) {
  constexpr std::int32_t kFree = -2, kIsolated = -1;
  const bool wide = second_ring_neighbours > 0;
  const std::int32_t n = matrix.num_rows();
  Aggregates aggregates;
  std::vector<std::int32_t>& of_row = aggregates.of_row;
  of_row.assign(n, kFree);
  // Calls see(j) for the strong neighbours of i until it returns false; true if it never does.
  const auto each_neighbour = [&](std::int32_t i, const auto& see) {
    for (std::int32_t k = matrix.row_begin[i]; k < matrix.row_begin[i + 1]; ++k) {
      if (strong[k] && !see(matrix.column[k])) return false;
    }
    return true;
  };
  const auto is_free = [&](std::int32_t j) { return of_row[j] == kFree; };
  const auto take = [&](std::int32_t j) {
    of_row[j] = aggregates.count;
    return true;
  };

  std::vector<std::int32_t> second_ring;
  std::vector<int> inside(wide ? n : 0, 0);  // neighbours that a row of the second ring has in the first
  for (std::int32_t i = 0; i < n; ++i) {
    if (each_neighbour(i, [](std::int32_t) { return false; })) {
      of_row[i] = kIsolated;
      continue;
    }
    if (!is_free(i) || !each_neighbour(i, is_free)) continue;
    take(i);
    each_neighbour(i, take);
    if (wide) {
      second_ring.clear();
      each_neighbour(i, [&](std::int32_t j) {
        return each_neighbour(j, [&](std::int32_t m) {
          if (is_free(m) && inside[m]++ == 0) second_ring.push_back(m);
          return true;
        });
      });
      for (const std::int32_t m : second_ring) {
        if (inside[m] >= second_ring_neighbours) take(m);
        inside[m] = 0;
      }
    }
    ++aggregates.count;
  }

  // A row between aggregates joins the one it is coupled to most strongly. Looking at the first pass's result only
  // keeps aggregates from growing chains.
  const std::vector<std::int32_t> first_pass = of_row;
  for (std::int32_t i = 0; i < n; ++i) {
    if (first_pass[i] != kFree) continue;
    float best = -1;
    for (std::int32_t k = matrix.row_begin[i]; k < matrix.row_begin[i + 1]; ++k) {
      if (!strong[k] || first_pass[matrix.column[k]] < 0) continue;
      const float coupling = SquaredNorm(matrix.Block(k));
      if (coupling > best) {
        best = coupling;
        of_row[i] = first_pass[matrix.column[k]];
      }
    }
  }

  for (std::int32_t i = 0; i < n; ++i) {
    if (of_row[i] != kFree) continue;
    take(i);
    each_neighbour(i, [&](std::int32_t j) { return is_free(j) ? take(j) : true; });
    ++aggregates.count;
  }
  return aggregates;
}

template std::vector<char> StrongCouplings(const LevelMatrix<2>&, double, std::int32_t, ThreadTeam*);
template std::vector<char> StrongCouplings(const LevelMatrix<4>&, double, std::int32_t, ThreadTeam*);
template Aggregates Aggregate(const LevelMatrix<2>&, const std::vector<char>&, std::int64_t);
template Aggregates Aggregate(const LevelMatrix<4>&, const std::vector<char>&, std::int64_t);

}  // namespace planish
