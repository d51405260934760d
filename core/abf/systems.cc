#include "core/abf/systems.h"

#include <algorithm>
#include <array>

#include "core/abf/lagrangian.h"
#include "core/linalg/vector_ops.h"

namespace planish {
namespace {

constexpr std::int64_t kAssemblyRows = 1024;  // in a chunk

// The position of u among `length` ascending columns. Counting takes a third of the time of a search in short rows, as
// it has no branches.
std::int32_t PlaceIn(const std::int32_t* column, std::int32_t length, std::int32_t u) {
  constexpr std::int32_t kShort = 32;
  if (length > kShort) return static_cast<std::int32_t>(std::lower_bound(column, column + length, u) - column);
  std::int32_t place = 0;
  for (std::int32_t k = 0; k < length; ++k) place += column[k] < u ? 1 : 0;
  return place;
}

// x = P r - h D 1 / s for one face (the letters of systems.h), `a` being its Hessian and `inverse` 1 / e.
inline void SolveFace(const double* a, double inverse, const double* r, double h, double* x) {
  // Differences first: P annihilates the constants, and a large common part of r must not drown the rest.
  const double d01 = r[0] - r[1], d12 = r[1] - r[2], d20 = r[2] - r[0];
  x[0] = (a[2] * d01 - a[1] * d20 - h * a[1] * a[2]) * inverse;
  x[1] = (a[0] * d12 - a[2] * d01 - h * a[2] * a[0]) * inverse;
  x[2] = (a[1] * d20 - a[0] * d12 - h * a[0] * a[1]) * inverse;
}

}  // namespace

FullSystem::FullSystem(const Topology& topology, const Eigen::VectorXd& hessian, const Eigen::VectorXd& cot)
    : topology_(topology), inverse_hessian_(hessian.cwiseInverse()), cot_(cot) {}

void FullSystem::ApplyB(const Eigen::VectorXd& x, Eigen::VectorXd* y) const {
  Eigen::VectorXd pair;
  ApplyPairRows(topology_, cot_, x, &pair);
  y->resize(num_multipliers());
  for (std::int32_t f = 0; f < topology_.num_faces(); ++f) (*y)[f] = x[3 * f] + x[3 * f + 1] + x[3 * f + 2];
  y->tail(pair.size()) = pair;
}

void FullSystem::ApplyBTransposed(const Eigen::VectorXd& lambda, Eigen::VectorXd* x) const {
  x->resize(topology_.num_corners());
  for (std::int32_t c = 0; c < topology_.num_corners(); ++c) (*x)[c] = lambda[c / 3];
  AddPairRowsTransposed(topology_, cot_, lambda.tail(2 * topology_.num_rows), x);
}

void FullSystem::ApplyInverseA(const Eigen::VectorXd& f, Eigen::VectorXd* x) const {
  *x = inverse_hessian_.cwiseProduct(f);
}

Eigen::VectorXd FullSystem::SchurDiagonal() const {
  Eigen::VectorXd diagonal = Eigen::VectorXd::Zero(num_multipliers());
  for (std::int32_t c = 0; c < topology_.num_corners(); ++c) {
    const std::int32_t f = c / 3, k = c % 3;
    diagonal[f] += inverse_hessian_[c];
    const std::int32_t v = topology_.corner_row[c];
    if (v < 0) continue;
    double* pair = &diagonal[topology_.num_faces() + 2 * v];
    const std::int32_t after = 3 * f + Next(k), before = 3 * f + Prev(k);
    pair[0] += inverse_hessian_[c];
    if (!topology_.has_wheel(v)) {
      pair[1] = pair[0];  // the row is empty: any positive value will do
      continue;
    }
    pair[1] +=
        cot_[after] * cot_[after] * inverse_hessian_[after] + cot_[before] * cot_[before] * inverse_hessian_[before];
  }
  return diagonal;
}

ReducedSystem::ReducedSystem(const Topology& topology, const Eigen::VectorXd& hessian, const Eigen::VectorXd& cot,
                             ThreadTeam& team)
    : topology_(topology), team_(team), hessian_(hessian), cot_(cot), inverse_e_(topology.num_faces()) {
  team_.ForEach(topology.num_faces(), [&](std::int64_t f) { inverse_e_[f] = 1 / PlaneDeterminant(&hessian_[3 * f]); });
}

void ReducedSystem::ApplyB(const Eigen::VectorXd& x, Eigen::VectorXd* y) const {
  ApplyPairRows(topology_, cot_, x, y, team_);
}

void ReducedSystem::ApplyBTransposed(const Eigen::VectorXd& lambda, Eigen::VectorXd* x) const {
  Assign(team_, Eigen::VectorXd::Zero(topology_.num_corners()), x);
  AddPairRowsTransposed(topology_, cot_, lambda, x, team_);
}

void ReducedSystem::ApplyInverseA(const Eigen::VectorXd& f, Eigen::VectorXd* x) const {
  x->resize(f.size());
  team_.ForEach(topology_.num_faces(), [&](std::int64_t face) {
    SolveFace(&hessian_[3 * face], inverse_e_[face], &f[3 * face], 0, &(*x)[3 * face]);
  });
}

void ReducedSystem::ApplySchur(const Eigen::VectorXd& lambda, Eigen::VectorXd* y) const {
  multiply_ ? multiply_(lambda, y) : SaddlePointOperator::ApplySchur(lambda, y);
}

void ReducedSystem::ApplyExactSchur(const Eigen::VectorXd& lambda, Eigen::VectorXd* y) const {
  rounds_ ? SaddlePointOperator::ApplySchur(lambda, y) : ApplySchur(lambda, y);
}

Eigen::VectorXd ReducedSystem::SchurDiagonal() const {
  Eigen::VectorXd diagonal = Eigen::VectorXd::Zero(num_multipliers());
  for (std::int32_t c = 0; c < topology_.num_corners(); ++c) {
    const std::int32_t f = c / 3, v = topology_.corner_row[c], after = 3 * f + Next(c % 3),
                       before = 3 * f + Prev(c % 3);
    if (v < 0) continue;
    const double a0 = hessian_[c], a1 = hessian_[after], a2 = hessian_[before], c1 = cot_[after], c2 = cot_[before];
    diagonal[2 * v] += (a1 + a2) * inverse_e_[f];
    diagonal[2 * v + 1] += (c1 * c1 * (a2 + a0) + c2 * c2 * (a0 + a1) + 2 * c1 * c2 * a0) * inverse_e_[f];
  }
  // The wheel row of a vertex without a wheel condition is empty: any positive diagonal will do.
  for (std::int32_t v = topology_.num_interior; v < topology_.num_rows; ++v) diagonal[2 * v + 1] = diagonal[2 * v];
  return diagonal;
}

void ReducedSystem::Recover(const Eigen::VectorXd& gradient, const Eigen::VectorXd& h1, const Eigen::VectorXd& lambda2,
                            Eigen::VectorXd* x, Eigen::VectorXd* lambda1) const {
  x->resize(topology_.num_corners());
  if (lambda1 != nullptr) lambda1->resize(topology_.num_faces());
  team_.ForEach(topology_.num_faces(), [&](std::int64_t f) {
    const double *a = &hessian_[3 * f], *g = &gradient[3 * f], *c = &cot_[3 * f];
    const std::array<double, 3> wheel = WheelDifferences(topology_, f, lambda2);
    double r[3];  // f - J^t lambda_2
    for (int k = 0; k < 3; ++k) {
      const std::int32_t row = topology_.corner_row[3 * f + k];
      r[k] = -g[k] - (row < 0 ? 0 : lambda2[2 * row]) - c[k] * wheel[k];
    }
    SolveFace(a, inverse_e_[f], r, h1[f], &(*x)[3 * f]);
    if (lambda1 == nullptr) return;
    (*lambda1)[f] =
        (a[1] * a[2] * r[0] + a[2] * a[0] * r[1] + a[0] * a[1] * r[2] + a[0] * a[1] * a[2] * h1[f]) * inverse_e_[f];
  });
}

std::vector<std::int32_t> RowsOfFaces(const Topology& topology, const std::vector<std::int32_t>& faces) {
  std::vector<std::int32_t> rows;
  for (const std::int32_t f : faces) {
    for (int k = 0; k < 3; ++k) {
      if (const std::int32_t v = topology.corner_row[3 * f + k]; v >= 0) rows.push_back(v);
    }
  }
  std::sort(rows.begin(), rows.end());
  rows.erase(std::unique(rows.begin(), rows.end()), rows.end());
  return rows;
}

template <typename Scalar>
ReducedMatrix<Scalar>::ReducedMatrix(const Topology& topology, ThreadTeam& team) : topology_(topology), team_(team) {
  const std::int32_t n = topology.num_rows;
  // Builds chunks in parallel, then concatenates them.
  matrix_.row_begin.assign(n + 1, 0);
  diagonal_.resize(n);
  using Part = std::vector<std::int32_t>;
  std::vector<Part> parts = team_.Collect<Part>(n, kAssemblyRows, [&](std::int64_t begin, std::int64_t end) {
    Part part, columns;
    for (std::int64_t v = begin; v < end; ++v) {
      // The rows next to row v, v itself included, ascending.
      columns.assign(1, static_cast<std::int32_t>(v));
      for (std::int32_t i = topology.row_corner_begin[v]; i < topology.row_corner_begin[v + 1]; ++i) {
        const std::int32_t f = topology.row_corner[i] / 3, k = topology.row_corner[i] % 3;
        for (const int other : {Next(k), Prev(k)}) {
          if (const std::int32_t u = topology.corner_row[3 * f + other]; u >= 0) columns.push_back(u);
        }
      }
      std::sort(columns.begin(), columns.end());
      columns.erase(std::unique(columns.begin(), columns.end()), columns.end());
      const auto place = std::lower_bound(columns.begin(), columns.end(), v) - columns.begin();
      diagonal_[v] = static_cast<std::int32_t>(place);
      matrix_.row_begin[v + 1] = static_cast<std::int32_t>(columns.size());
      part.insert(part.end(), columns.begin(), columns.end());
    }
    return part;
  });
  for (std::int32_t v = 0; v < n; ++v) {
    diagonal_[v] += matrix_.row_begin[v];
    matrix_.row_begin[v + 1] += matrix_.row_begin[v];
  }
  matrix_.column.reserve(static_cast<std::size_t>(matrix_.row_begin[n]));
  for (Part& part : parts) {
    matrix_.column.insert(matrix_.column.end(), part.begin(), part.end());
    part = {};
  }
  matrix_.value.resize(4 * matrix_.column.size());
}

template <typename Scalar>
const BlockMatrix<Scalar>& ReducedMatrix<Scalar>::Assemble(const Eigen::VectorXd& hessian, const Eigen::VectorXd& cot,
                                                           const std::function<void()>& beside) {
  team_.ForBeside(beside, topology_.num_rows, kAssemblyRows, [&](std::int64_t begin, std::int64_t end) {
    std::vector<double> row;
    for (std::int64_t v = begin; v < end; ++v) {
      const std::int32_t row_begin = matrix_.row_begin[v], length = matrix_.row_begin[v + 1] - row_begin;
      const std::int32_t* columns = &matrix_.column[row_begin];
      row.assign(4 * std::size_t(length), 0.0);
      for (std::int32_t i = topology_.row_corner_begin[v]; i < topology_.row_corner_begin[v + 1]; ++i) {
        // The face's contribution to J P J^t in the rows of corner k. Indices are relative to k: 0 is k, 1 the angle
        // after it and 2 the one before it.
        const std::int32_t f = topology_.row_corner[i] / 3, k = topology_.row_corner[i] % 3;
        const std::int32_t at[3] = {3 * f + k, 3 * f + Next(k), 3 * f + Prev(k)};
        const double a0 = hessian[at[0]], a1 = hessian[at[1]], a2 = hessian[at[2]];
        const double c0 = cot[at[0]], c1 = cot[at[1]], c2 = cot[at[2]];
        const double scale = 1 / (a0 * a1 + a1 * a2 + a2 * a0);
        const double p00 = scale * (a1 + a2), p11 = scale * (a2 + a0), p22 = scale * (a0 + a1);
        const double p01 = -scale * a2, p12 = -scale * a0, p02 = -scale * a1;
        // The vertex row of J is (1, 0, 0); the wheel row is (0, c1, -c2), or zero for a vertex without a wheel. t and
        // w are these rows times P.
        const auto wheel = [&](int corner) {
          return topology_.has_wheel(topology_.corner_row[at[corner]]) ? 1.0 : 0.0;
        };
        const double w0 = wheel(0), w1 = wheel(1), w2 = wheel(2);
        const double t[3] = {p00, p01, p02};
        const double w[3] = {w0 * (c1 * p01 - c2 * p02), w0 * (c1 * p11 - c2 * p12), w0 * (c1 * p12 - c2 * p22)};
        const auto add = [&](int corner, double wheel_t, double wheel_w) {
          const std::int32_t u = topology_.corner_row[at[corner]];
          if (u < 0) return;
          const std::int32_t block = corner == 0 ? diagonal_[v] - row_begin : PlaceIn(columns, length, u);
          double* value = &row[4 * std::size_t(block)];
          value[0] += t[corner];
          value[1] += wheel_t;
          value[2] += w[corner];
          value[3] += wheel_w;
        };
        add(0, w0 * (c1 * t[1] - c2 * t[2]), w0 * (c1 * w[1] - c2 * w[2]));
        add(1, w1 * (c2 * t[2] - c0 * t[0]), w1 * (c2 * w[2] - c0 * w[0]));
        add(2, w2 * (c0 * t[0] - c1 * t[1]), w2 * (c0 * w[0] - c1 * w[1]));
      }
      // The wheel row of a vertex without a wheel condition is empty: any positive diagonal will do.
      if (!topology_.has_wheel(static_cast<std::int32_t>(v))) {
        double* diagonal = &row[4 * std::size_t(diagonal_[v] - row_begin)];
        diagonal[3] = diagonal[0];
      }
      std::transform(row.begin(), row.end(), &matrix_.value[4 * std::size_t(row_begin)],
                     [](double value) { return static_cast<Scalar>(value); });
    }
  });
  return matrix_;
}

template class ReducedMatrix<float>;
template class ReducedMatrix<double>;

}  // namespace planish
