#include "core/linalg/aggregation.h"

#include <cmath>

namespace planish {
namespace {

float SquaredNorm(const float* block) {
  return block[0] * block[0] + block[1] * block[1] + block[2] * block[2] + block[3] * block[3];
}

}  // namespace

std::vector<char> StrongCouplings(const BlockMatrix<float>& matrix, double theta) {
  const std::int32_t n = matrix.num_rows();
  std::vector<float> diagonal(n, 0);
  for (std::int32_t i = 0; i < n; ++i) {
    for (std::int32_t k = matrix.row_begin[i]; k < matrix.row_begin[i + 1]; ++k) {
      if (matrix.column[k] == i) diagonal[i] = std::sqrt(SquaredNorm(&matrix.value[4 * std::int64_t{k}]));
    }
  }
  const auto threshold = static_cast<float>(theta * theta);
  std::vector<char> strong(matrix.column.size());
  for (std::int32_t i = 0; i < n; ++i) {
    for (std::int32_t k = matrix.row_begin[i]; k < matrix.row_begin[i + 1]; ++k) {
      const std::int32_t j = matrix.column[k];
      strong[k] = j != i && SquaredNorm(&matrix.value[4 * std::int64_t{k}]) >= threshold * diagonal[i] * diagonal[j];
    }
  }
  return strong;
}

Aggregates Aggregate(const BlockMatrix<float>& matrix, const std::vector<char>& strong) {
  constexpr std::int32_t kFree = -2, kIsolated = -1;
  const std::int32_t n = matrix.num_rows();
  Aggregates aggregates;
  std::vector<std::int32_t>& of_row = aggregates.of_row;
  of_row.assign(n, kFree);

  for (std::int32_t i = 0; i < n; ++i) {
    bool any = false, all_free = of_row[i] == kFree;
    for (std::int32_t k = matrix.row_begin[i]; k < matrix.row_begin[i + 1]; ++k) {
      if (!strong[k]) continue;
      any = true;
      all_free = all_free && of_row[matrix.column[k]] == kFree;
    }
    if (!any) {
      of_row[i] = kIsolated;
    } else if (all_free) {
      of_row[i] = aggregates.count;
      for (std::int32_t k = matrix.row_begin[i]; k < matrix.row_begin[i + 1]; ++k) {
        if (strong[k]) of_row[matrix.column[k]] = aggregates.count;
      }
      ++aggregates.count;
    }
  }

  // A row between aggregates joins the one it is coupled to most strongly. Looking at the first pass's result only
  // keeps aggregates from growing chains.
  const std::vector<std::int32_t> first_pass = of_row;
  for (std::int32_t i = 0; i < n; ++i) {
    if (first_pass[i] != kFree) continue;
    float best = -1;
    for (std::int32_t k = matrix.row_begin[i]; k < matrix.row_begin[i + 1]; ++k) {
      if (!strong[k] || first_pass[matrix.column[k]] < 0) continue;
      const float coupling = SquaredNorm(&matrix.value[4 * std::int64_t{k}]);
      if (coupling > best) {
        best = coupling;
        of_row[i] = first_pass[matrix.column[k]];
      }
    }
  }

  for (std::int32_t i = 0; i < n; ++i) {
    if (of_row[i] != kFree) continue;
    of_row[i] = aggregates.count;
    for (std::int32_t k = matrix.row_begin[i]; k < matrix.row_begin[i + 1]; ++k) {
      if (strong[k] && of_row[matrix.column[k]] == kFree) of_row[matrix.column[k]] = aggregates.count;
    }
    ++aggregates.count;
  }
  return aggregates;
}

}  // namespace planish
