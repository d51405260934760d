#include "core/linalg/sparse_cholesky.h"

#include <cmath>
#include <new>

#include "Eigen/OrderingMethods"
#include "Eigen/SparseCore"
#include "absl/strings/str_cat.h"
#include "absl/strings/str_format.h"
#include "core/linalg/float_block.h"

namespace planish {
namespace {

// The order in which rows are eliminated: entry k is the row eliminated as number k.
std::vector<std::int32_t> MinimumDegreeOrder(const BlockMatrix<double>& matrix) {
  const std::int32_t n = matrix.num_rows();
  // Only the pattern matters. Eigen adds that of the transpose, so one triangle is enough. The diagonal is included,
  // since rows without a diagonal are put last, unordered.
  Eigen::SparseMatrix<float, Eigen::ColMajor, int> pattern(n, n);
  for (std::int32_t i = 0; i < n; ++i) {
    pattern.startVec(i);
    for (std::int32_t k = matrix.row_begin[i]; k < matrix.row_begin[i + 1]; ++k) {
      if (matrix.column[k] >= i) pattern.insertBack(matrix.column[k], i) = 1;
    }
  }
  pattern.finalize();
  Eigen::PermutationMatrix<Eigen::Dynamic, Eigen::Dynamic, int> order(n);
  Eigen::AMDOrdering<int>()(pattern, order);
  return {order.indices().data(), order.indices().data() + n};
}

}  // namespace

std::int32_t SparseCholesky::Factor::RowPattern(const BlockMatrix<double>& matrix, std::int32_t k,
                                                std::vector<std::int32_t>* mark,
                                                std::vector<std::int32_t>* pattern) const {
  auto top = static_cast<std::int32_t>(pattern->size());
  (*mark)[k] = k;
  const std::int32_t row_of_matrix = order[k];
  for (std::int32_t e = matrix.row_begin[row_of_matrix]; e < matrix.row_begin[row_of_matrix + 1]; ++e) {
    std::int32_t length = 0;
    // The path fits into the rest of `pattern`: both are parts of the same n - 1 nodes.
    for (std::int32_t i = place[matrix.column[e]]; i < k && (*mark)[i] != k; i = parent[i]) {
      (*pattern)[length++] = i;
      (*mark)[i] = k;
    }
    while (length > 0) (*pattern)[--top] = (*pattern)[--length];
  }
  return top;
}

void SparseCholesky::Factor::Analyze(const BlockMatrix<double>& matrix) {
  const std::int32_t n = matrix.num_rows();
  order = MinimumDegreeOrder(matrix);
  place.resize(n);
  for (std::int32_t k = 0; k < n; ++k) place[order[k]] = k;
  // The elimination tree (Liu 1990), with path compression.
  parent.assign(n, -1);
  std::vector<std::int32_t> ancestor(n, -1);
  for (std::int32_t k = 0; k < n; ++k) {
    for (std::int32_t e = matrix.row_begin[order[k]]; e < matrix.row_begin[order[k] + 1]; ++e) {
      for (std::int32_t i = place[matrix.column[e]]; i >= 0 && i < k;) {
        const std::int32_t next = ancestor[i];
        ancestor[i] = k;
        if (next < 0) parent[i] = k;
        i = next;
      }
    }
  }
  std::vector<std::int32_t> mark(n, -1), pattern(n);
  begin.assign(n + 1, 0);
  for (std::int32_t k = 0; k < n; ++k) {
    for (std::int32_t t = RowPattern(matrix, k, &mark, &pattern); t < n; ++t) ++begin[pattern[t] + 1];
  }
  for (std::int32_t j = 0; j < n; ++j) begin[j + 1] += begin[j];
  row_begin = matrix.row_begin;
  column = matrix.column;
}

absl::Status SparseCholesky::Factor::FactorizeNumbers(const BlockMatrix<double>& matrix) {
  const std::int32_t n = matrix.num_rows();
  row.resize(static_cast<std::size_t>(begin[n]));
  value.resize(4 * static_cast<std::size_t>(begin[n]));
  inverse.resize(3 * static_cast<std::size_t>(n));
  std::vector<std::int64_t> end(begin.begin(), begin.end() - 1);  // end of the filled part of each column
  std::vector<std::int32_t> mark(n, -1), pattern(n);
  std::vector<double> y(4 * static_cast<std::size_t>(n), 0.0);  // block i: what is left of S_ik in the substitution
  for (std::int32_t k = 0; k < n; ++k) {
    // Row k of L is the solution Z of L Z = (column k of S), transposed.
    const std::int32_t top = RowPattern(matrix, k, &mark, &pattern);
    double d00 = 0, d10 = 0, d11 = 0;
    for (std::int32_t e = matrix.row_begin[order[k]]; e < matrix.row_begin[order[k] + 1]; ++e) {
      const std::int32_t i = place[matrix.column[e]];
      const double* block = &matrix.value[4 * static_cast<std::size_t>(e)];
      if (i == k) {
        d00 = block[0], d10 = block[2], d11 = block[3];
      } else if (i < k) {
        double* to = &y[4 * static_cast<std::size_t>(i)];
        to[0] = block[0], to[1] = block[2], to[2] = block[1], to[3] = block[3];
      }
    }
    for (std::int32_t t = top; t < n; ++t) {
      const std::int32_t i = pattern[t];
      double* yi = &y[4 * static_cast<std::size_t>(i)];
      const double* inv = &inverse[3 * static_cast<std::size_t>(i)];
      const Double2 y0 = Load<Double2>(yi), y1 = Load<Double2>(yi + 2);
      const Double2 z0 = inv[0] * y0, z1 = inv[1] * y0 + inv[2] * y1;
      Store(Double2{0, 0}, yi);
      Store(Double2{0, 0}, yi + 2);
      for (std::int64_t p = begin[i]; p < end[i]; ++p) {
        // y_r -= L_ri Z_i.
        const double* l = &value[4 * static_cast<std::size_t>(p)];
        double* yr = &y[4 * static_cast<std::size_t>(row[static_cast<std::size_t>(p)])];
        Store(Load<Double2>(yr) - l[0] * z0 - l[2] * z1, yr);
        Store(Load<Double2>(yr + 2) - l[1] * z0 - l[3] * z1, yr + 2);
      }
      const std::int64_t at = end[i]++;
      row[static_cast<std::size_t>(at)] = k;
      Store(z0, &value[4 * static_cast<std::size_t>(at)]);
      Store(z1, &value[4 * static_cast<std::size_t>(at) + 2]);
      d00 -= z0[0] * z0[0] + z1[0] * z1[0];
      d10 -= z0[1] * z0[0] + z1[1] * z1[0];
      d11 -= z0[1] * z0[1] + z1[1] * z1[1];
    }
    const double l00 = std::sqrt(d00), l10 = d10 / l00, rest = d11 - l10 * l10, l11 = std::sqrt(rest);
    if (!(d00 > 0) || !(rest > 0) || !std::isfinite(l00) || !std::isfinite(l11)) {
      return absl::FailedPreconditionError(
          absl::StrFormat("the matrix is not positive definite: pivot %d of %d is %.3g", k, n, d00 > 0 ? rest : d00));
    }
    double* inv = &inverse[3 * static_cast<std::size_t>(k)];
    inv[0] = 1 / l00;
    inv[2] = 1 / l11;
    inv[1] = -l10 * inv[0] * inv[2];
  }
  return absl::OkStatus();
}

std::int64_t SparseCholesky::bytes() const {
  constexpr std::int64_t kPerBlock = sizeof(std::int32_t) + 4 * sizeof(double);
  return l_.begin.empty() ? 0 : kPerBlock * l_.begin.back();
}

absl::Status SparseCholesky::Factorize(const BlockMatrix<double>& matrix) {
  const auto give_up = [&](const std::string& why) {
    l_ = {};
    return absl::ResourceExhaustedError(why);
  };
  if (matrix.num_rows() == 0) return absl::OkStatus();
  try {
    if (l_.begin.empty() || l_.row_begin != matrix.row_begin || l_.column != matrix.column) {
      l_ = {};
      l_.Analyze(matrix);
    }
    if (bytes() > max_bytes_) {
      return give_up(absl::StrFormat(
          "a Cholesky factorization of %d rows takes %.0f MB, and %.0f MB are reserved for it", 2 * matrix.num_rows(),
          1e-6 * static_cast<double>(bytes()), 1e-6 * static_cast<double>(max_bytes_)));
    }
    return l_.FactorizeNumbers(matrix);
  } catch (const std::bad_alloc&) {
    return give_up(absl::StrCat("no memory for a Cholesky factorization of ", 2 * matrix.num_rows(), " rows"));
  }
}

void SparseCholesky::Solve(const Eigen::VectorXd& b, Eigen::VectorXd* x) const {
  const auto n = static_cast<std::int32_t>(b.size() / 2);
  Eigen::VectorXd y(b.size());
  for (std::int32_t k = 0; k < n; ++k) y.segment<2>(2 * k) = b.segment<2>(2 * l_.order[k]);
  for (std::int32_t j = 0; j < n; ++j) {
    double* own = &y[2 * j];
    const double* inv = &l_.inverse[3 * static_cast<std::size_t>(j)];
    const double y0 = inv[0] * own[0], y1 = inv[1] * own[0] + inv[2] * own[1];
    own[0] = y0;
    own[1] = y1;
    for (std::int64_t p = l_.begin[j]; p < l_.begin[j + 1]; ++p) {
      const double* l = &l_.value[4 * static_cast<std::size_t>(p)];
      double* to = &y[2 * l_.row[static_cast<std::size_t>(p)]];
      Store(Load<Double2>(to) - y0 * Load<Double2>(l) - y1 * Load<Double2>(l + 2), to);
    }
  }
  for (std::int32_t j = n - 1; j >= 0; --j) {
    double* own = &y[2 * j];
    Double2 first = {0, 0}, second = {0, 0};
    for (std::int64_t p = l_.begin[j]; p < l_.begin[j + 1]; ++p) {
      const double* l = &l_.value[4 * static_cast<std::size_t>(p)];
      const Double2 at = Load<Double2>(&y[2 * l_.row[static_cast<std::size_t>(p)]]);
      first += Load<Double2>(l) * at;
      second += Load<Double2>(l + 2) * at;
    }
    const double* inv = &l_.inverse[3 * static_cast<std::size_t>(j)];
    const double r0 = own[0] - (first[0] + first[1]), r1 = own[1] - (second[0] + second[1]);
    own[0] = inv[0] * r0 + inv[1] * r1;
    own[1] = inv[2] * r1;
  }
  x->resize(b.size());
  for (std::int32_t k = 0; k < n; ++k) x->segment<2>(2 * l_.order[k]) = y.segment<2>(2 * k);
}

}  // namespace planish
