#include "core/linalg/multigrid.h"

#include <algorithm>
#include <cmath>
#include <utility>
#include <vector>

#include "Eigen/Cholesky"
#include "absl/strings/str_cat.h"
#include "core/base/status_macros.h"
#include "core/linalg/aggregation.h"

namespace planish {
namespace {

using Index = std::int32_t;

// Rows of 2x2 blocks, rectangular.
struct BlockRows {
  std::vector<Index> row_begin = {0};
  std::vector<Index> column;
  std::vector<float> value;
  Index num_columns = 0;

  Index num_rows() const { return static_cast<Index>(row_begin.size()) - 1; }
  const float* Block(Index k) const { return &value[4 * std::int64_t{k}]; }
  float* Block(Index k) { return &value[4 * std::int64_t{k}]; }
};

// c += a b.
void AddProduct(const float* a, const float* b, float* c) {
  c[0] += a[0] * b[0] + a[1] * b[2];
  c[1] += a[0] * b[1] + a[1] * b[3];
  c[2] += a[2] * b[0] + a[3] * b[2];
  c[3] += a[2] * b[1] + a[3] * b[3];
}

// Gathers the blocks of one row, whatever order they come in.
class RowAccumulator {
 public:
  explicit RowAccumulator(Index num_columns) : place_(num_columns, -1) {}

  float* At(BlockRows* rows, Index column) {
    if (place_[column] < row_start_) {
      place_[column] = static_cast<Index>(rows->column.size());
      rows->column.push_back(column);
      rows->value.insert(rows->value.end(), 4, 0.0F);
    }
    return rows->Block(place_[column]);
  }
  void EndRow(BlockRows* rows) {
    row_start_ = static_cast<Index>(rows->column.size());
    rows->row_begin.push_back(row_start_);
  }

 private:
  std::vector<Index> place_;
  Index row_start_ = 0;
};

BlockRows Transpose(const BlockRows& a) {
  BlockRows t;
  t.num_columns = a.num_rows();
  t.row_begin.assign(a.num_columns + 1, 0);
  for (const Index j : a.column) ++t.row_begin[j + 1];
  for (Index j = 0; j < a.num_columns; ++j) t.row_begin[j + 1] += t.row_begin[j];
  t.column.resize(a.column.size());
  t.value.resize(a.value.size());
  std::vector<Index> cursor(t.row_begin.begin(), t.row_begin.end() - 1);
  for (Index i = 0; i < a.num_rows(); ++i) {
    for (Index k = a.row_begin[i]; k < a.row_begin[i + 1]; ++k) {
      const Index at = cursor[a.column[k]]++;
      t.column[at] = i;
      const float* from = a.Block(k);
      float* to = t.Block(at);
      to[0] = from[0];
      to[1] = from[2];
      to[2] = from[1];
      to[3] = from[3];
    }
  }
  return t;
}

struct Level {
  BlockMatrix<float> a;
  std::vector<Index> diagonal;  // place of the diagonal block in each row
  std::vector<float> inverse;   // of the diagonal blocks
  Aggregates aggregates;        // empty on the coarsest level
  double omega = 0;
  BlockRows prolongation;
  // The cycle's right-hand side and solution on this level.
  Eigen::VectorXf b, x;

  const float* Block(Index k) const { return &a.value[4 * std::int64_t{k}]; }
};

absl::Status InvertDiagonal(Level* level) {
  const Index n = level->a.num_rows();
  level->diagonal.resize(n);
  level->inverse.resize(4 * std::size_t(n));
  for (Index i = 0; i < n; ++i) {
    const auto first = level->a.column.begin() + level->a.row_begin[i];
    const auto last = level->a.column.begin() + level->a.row_begin[i + 1];
    const auto found = std::find(first, last, i);
    if (found == last) return absl::FailedPreconditionError("multigrid: a row has no diagonal block");
    level->diagonal[i] = static_cast<Index>(found - level->a.column.begin());
    const float* d = level->Block(level->diagonal[i]);
    const double determinant = double(d[0]) * d[3] - double(d[1]) * d[2];
    if (!(d[0] > 0 && determinant > 0)) {
      return absl::FailedPreconditionError(
          absl::StrCat("multigrid: diagonal block ", i, " of ", n, " is not positive definite"));
    }
    float* inverse = &level->inverse[4 * std::size_t(i)];
    inverse[0] = static_cast<float>(d[3] / determinant);
    inverse[1] = static_cast<float>(-d[1] / determinant);
    inverse[2] = static_cast<float>(-d[2] / determinant);
    inverse[3] = static_cast<float>(d[0] / determinant);
  }
  return absl::OkStatus();
}

// Largest eigenvalue of D^-1 A, from below, by a few power iterations.
double LargestEigenvalue(const Level& level) {
  constexpr int kIterations = 8;
  const Index n = level.a.num_rows();
  Eigen::VectorXf v(2 * n), next(2 * n);
  std::uint32_t state = 1;
  for (float& entry : v) {
    state = state * 1664525U + 1013904223U;  // fixed seed: the same numbers on every run
    entry = static_cast<float>(state >> 8) / 8388608.0F - 1.0F;
  }
  double eigenvalue = 1;
  for (int iteration = 0; iteration < kIterations; ++iteration) {
    v /= v.norm();
    for (Index i = 0; i < n; ++i) {
      float y0 = 0, y1 = 0;
      for (Index k = level.a.row_begin[i]; k < level.a.row_begin[i + 1]; ++k) {
        const float* block = level.Block(k);
        const float* at = &v[2 * level.a.column[k]];
        y0 += block[0] * at[0] + block[1] * at[1];
        y1 += block[2] * at[0] + block[3] * at[1];
      }
      const float* inverse = &level.inverse[4 * std::size_t(i)];
      next[2 * i] = inverse[0] * y0 + inverse[1] * y1;
      next[2 * i + 1] = inverse[2] * y0 + inverse[3] * y1;
    }
    eigenvalue = next.norm();
    v.swap(next);
  }
  return eigenvalue;
}

// Least determinant of a filtered diagonal block, relative to the product of the unfiltered entries.
constexpr float kLeastFiltered = 1e-4F;

// P = (I - omega D_F^-1 A_F) P_0. A_F is A with the weak couplings added to the diagonal, so that the constants stay
// what they are.
BlockRows SmoothedProlongation(const Level& level, const std::vector<char>& strong) {
  const Index n = level.a.num_rows();
  BlockRows p;
  p.num_columns = level.aggregates.count;
  p.column.reserve(3 * std::size_t(n));
  p.value.reserve(12 * std::size_t(n));
  RowAccumulator row(p.num_columns);
  const std::vector<Index>& aggregate = level.aggregates.of_row;
  for (Index i = 0; i < n; ++i) {
    if (aggregate[i] >= 0) {
      float filtered[4] = {};
      for (Index k = level.a.row_begin[i]; k < level.a.row_begin[i + 1]; ++k) {
        if (strong[k]) continue;
        for (int q = 0; q < 4; ++q) filtered[q] += level.Block(k)[q];
      }
      const float determinant = filtered[0] * filtered[3] - filtered[1] * filtered[2];
      float* own = row.At(&p, aggregate[i]);
      own[0] += 1;
      own[3] += 1;
      // Lumping can spoil the diagonal of a badly shaped row; such a row keeps its plain constant.
      if (filtered[0] > 0 &&
          determinant > kLeastFiltered * level.Block(level.diagonal[i])[0] * level.Block(level.diagonal[i])[3]) {
        const float scale = -static_cast<float>(level.omega) / determinant;
        const float weight[4] = {scale * filtered[3], -scale * filtered[1], -scale * filtered[2], scale * filtered[0]};
        own[0] -= static_cast<float>(level.omega);
        own[3] -= static_cast<float>(level.omega);
        for (Index k = level.a.row_begin[i]; k < level.a.row_begin[i + 1]; ++k) {
          if (!strong[k] || aggregate[level.a.column[k]] < 0) continue;
          AddProduct(weight, level.Block(k), row.At(&p, aggregate[level.a.column[k]]));
        }
      }
    }
    row.EndRow(&p);
  }
  return p;
}

BlockMatrix<float> CoarseMatrix(const Level& level) {
  const BlockRows& p = level.prolongation;
  BlockRows ap;
  ap.num_columns = p.num_columns;
  {
    RowAccumulator row(p.num_columns);
    for (Index i = 0; i < level.a.num_rows(); ++i) {
      for (Index k = level.a.row_begin[i]; k < level.a.row_begin[i + 1]; ++k) {
        const Index j = level.a.column[k];
        for (Index m = p.row_begin[j]; m < p.row_begin[j + 1]; ++m) {
          AddProduct(level.Block(k), p.Block(m), row.At(&ap, p.column[m]));
        }
      }
      row.EndRow(&ap);
    }
  }
  const BlockRows t = Transpose(p);
  BlockRows c;
  c.num_columns = p.num_columns;
  RowAccumulator row(p.num_columns);
  for (Index j = 0; j < t.num_rows(); ++j) {
    row.At(&c, j);
    for (Index k = t.row_begin[j]; k < t.row_begin[j + 1]; ++k) {
      const Index i = t.column[k];
      for (Index m = ap.row_begin[i]; m < ap.row_begin[i + 1]; ++m) {
        AddProduct(t.Block(k), ap.Block(m), row.At(&c, ap.column[m]));
      }
    }
    row.EndRow(&c);
  }
  // Transposing sorts the columns, and the matrix is symmetric.
  c = Transpose(c);
  BlockMatrix<float> coarse;
  coarse.row_begin = std::move(c.row_begin);
  coarse.column = std::move(c.column);
  coarse.value = std::move(c.value);
  return coarse;
}

}  // namespace

struct Multigrid::Impl {
  // Numbers of all levels from the matrix on the finest; also the aggregates if `build`.
  absl::Status Fill(const BlockMatrix<double>& matrix, bool build);
  absl::Status FactorizeCoarsest();
  void Cycle(std::size_t l);

  MultigridOptions options;
  std::vector<Level> levels;
  Eigen::LLT<Eigen::MatrixXd> coarsest;
};

absl::Status Multigrid::Impl::Fill(const BlockMatrix<double>& matrix, bool build) {
  if (build) levels.assign(1, Level());
  Level& finest = levels[0];
  if (build) {
    finest.a.row_begin = matrix.row_begin;
    finest.a.column = matrix.column;
  }
  finest.a.value.assign(matrix.value.begin(), matrix.value.end());
  double theta = options.strength;
  for (std::size_t l = 0;; ++l, theta /= 2) {
    PLANISH_RETURN_IF_ERROR(InvertDiagonal(&levels[l]));
    const bool last =
        build ? levels[l].a.num_rows() <= options.coarsest_rows || l + 1 == static_cast<std::size_t>(options.max_levels)
              : l + 1 == levels.size();
    if (last) break;
    const std::vector<char> strong = StrongCouplings(levels[l].a, theta);
    if (build) {
      levels[l].aggregates = Aggregate(levels[l].a, strong);
      if (levels[l].aggregates.count == 0 || levels[l].aggregates.count > 0.9 * levels[l].a.num_rows()) break;
      levels[l].omega = 4.0 / 3 / (1.05 * LargestEigenvalue(levels[l]));
    }
    levels[l].prolongation = SmoothedProlongation(levels[l], strong);
    BlockMatrix<float> coarse = CoarseMatrix(levels[l]);
    if (build) levels.emplace_back();
    levels[l + 1].a = std::move(coarse);
  }
  for (Level& level : levels) level.b.resize(2 * level.a.num_rows());
  for (Level& level : levels) level.x.resize(2 * level.a.num_rows());
  return FactorizeCoarsest();
}

absl::Status Multigrid::Impl::FactorizeCoarsest() {
  const BlockMatrix<float>& a = levels.back().a;
  Eigen::MatrixXd dense = Eigen::MatrixXd::Zero(2 * a.num_rows(), 2 * a.num_rows());
  for (Index i = 0; i < a.num_rows(); ++i) {
    for (Index k = a.row_begin[i]; k < a.row_begin[i + 1]; ++k) {
      for (int q = 0; q < 4; ++q) dense(2 * i + q / 2, 2 * a.column[k] + q % 2) = a.value[4 * std::size_t(k) + q];
    }
  }
  coarsest.compute(dense);
  if (coarsest.info() != Eigen::Success) {
    return absl::FailedPreconditionError("multigrid: the coarsest matrix is not positive definite");
  }
  return absl::OkStatus();
}

void Multigrid::Impl::Cycle(std::size_t l) {
  Level& level = levels[l];
  if (l + 1 == levels.size()) {
    level.x = coarsest.solve(level.b.cast<double>()).cast<float>();
    return;
  }
  const BlockMatrix<float>& a = level.a;
  const Index n = a.num_rows();
  float* x = level.x.data();
  const float* b = level.b.data();
  const auto solve_row = [&](Index i, float r0, float r1) {
    const float* inverse = &level.inverse[4 * std::size_t(i)];
    x[2 * i] = inverse[0] * r0 + inverse[1] * r1;
    x[2 * i + 1] = inverse[2] * r0 + inverse[3] * r1;
  };
  // r -= blocks [first, last) times x.
  const auto subtract = [&](Index first, Index last, float* r0, float* r1) {
    for (Index k = first; k < last; ++k) {
      const float* block = level.Block(k);
      const float* at = x + 2 * std::size_t(a.column[k]);
      *r0 -= block[0] * at[0] + block[1] * at[1];
      *r1 -= block[2] * at[0] + block[3] * at[1];
    }
  };

  // Forward Gauss-Seidel from zero needs the lower triangle only, and leaves the residual -(upper triangle) x.
  for (Index i = 0; i < n; ++i) {
    float r0 = b[2 * i], r1 = b[2 * i + 1];
    subtract(a.row_begin[i], level.diagonal[i], &r0, &r1);
    solve_row(i, r0, r1);
  }
  Level& coarser = levels[l + 1];
  const BlockRows& p = level.prolongation;
  coarser.b.setZero();
  for (Index i = 0; i < n; ++i) {
    float r0 = 0, r1 = 0;
    subtract(level.diagonal[i] + 1, a.row_begin[i + 1], &r0, &r1);
    for (Index k = p.row_begin[i]; k < p.row_begin[i + 1]; ++k) {
      const float* block = p.Block(k);
      coarser.b[2 * p.column[k]] += block[0] * r0 + block[2] * r1;
      coarser.b[2 * p.column[k] + 1] += block[1] * r0 + block[3] * r1;
    }
  }
  Cycle(l + 1);
  for (Index i = 0; i < n; ++i) {
    for (Index k = p.row_begin[i]; k < p.row_begin[i + 1]; ++k) {
      const float* block = p.Block(k);
      const float* e = &coarser.x[2 * p.column[k]];
      x[2 * i] += block[0] * e[0] + block[1] * e[1];
      x[2 * i + 1] += block[2] * e[0] + block[3] * e[1];
    }
  }
  for (Index i = n - 1; i >= 0; --i) {
    float r0 = b[2 * i], r1 = b[2 * i + 1];
    subtract(a.row_begin[i], level.diagonal[i], &r0, &r1);
    subtract(level.diagonal[i] + 1, a.row_begin[i + 1], &r0, &r1);
    solve_row(i, r0, r1);
  }
}

Multigrid::Multigrid(const MultigridOptions& options) : impl_(std::make_unique<Impl>()) {
  impl_->options = options;
}
Multigrid::~Multigrid() = default;

absl::Status Multigrid::Build(const BlockMatrix<double>& matrix) {
  return impl_->Fill(matrix, true);
}
absl::Status Multigrid::Refresh(const BlockMatrix<double>& matrix) {
  return impl_->Fill(matrix, false);
}

void Multigrid::Apply(const Eigen::VectorXd& r, Eigen::VectorXd* z) const {
  // The cycle is linear; scaling keeps small residuals clear of float's underflow.
  const double scale = r.cwiseAbs().maxCoeff();
  if (scale == 0) {
    *z = r;
    return;
  }
  impl_->levels[0].b = (r / scale).cast<float>();
  impl_->Cycle(0);
  *z = scale * impl_->levels[0].x.cast<double>();
}

int Multigrid::num_levels() const {
  return static_cast<int>(impl_->levels.size());
}

double Multigrid::operator_complexity() const {
  double blocks = 0;
  for (const Level& level : impl_->levels) blocks += static_cast<double>(level.a.num_blocks());
  return blocks / static_cast<double>(impl_->levels[0].a.num_blocks());
}

}  // namespace planish
