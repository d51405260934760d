#include "core/abf/reduced_system.h"

#include <algorithm>
#include <utility>

#include "core/abf/plane.h"

namespace planish {
ReducedSystem::ReducedSystem(const Topology& topology, const Eigen::VectorXd& hessian, const Eigen::VectorXd& cot)
    : topology_(topology), hessian_(hessian), cot_(cot), inverse_e_(topology.num_faces()) {
  for (std::int32_t f = 0; f < topology.num_faces(); ++f) inverse_e_[f] = 1 / PlaneDeterminant(&hessian_[3 * f]);
}

void ReducedSystem::ApplyB(const Eigen::VectorXd& x, Eigen::VectorXd* y) const {
  ApplyPairRows(topology_, cot_, x, y);
}

void ReducedSystem::ApplyBTransposed(const Eigen::VectorXd& lambda, Eigen::VectorXd* x) const {
  x->setZero(num_unknowns());
  AddPairRowsTransposed(topology_, cot_, lambda, x);
}

void ReducedSystem::ApplyInverseA(const Eigen::VectorXd& f, Eigen::VectorXd* x) const {
  x->resize(f.size());
  for (std::int32_t face = 0; face < topology_.num_faces(); ++face) {
    const double *a = &hessian_[3 * face], *in = &f[3 * face];
    double* out = &(*x)[3 * face];
    // Differences first: P annihilates the constants, and a large common part of f must not drown the rest.
    const double d01 = in[0] - in[1], d12 = in[1] - in[2], d20 = in[2] - in[0];
    out[0] = (a[2] * d01 - a[1] * d20) * inverse_e_[face];
    out[1] = (a[0] * d12 - a[2] * d01) * inverse_e_[face];
    out[2] = (a[1] * d20 - a[0] * d12) * inverse_e_[face];
  }
}

Eigen::VectorXd ReducedSystem::SchurDiagonal() const {
  Eigen::VectorXd diagonal = Eigen::VectorXd::Zero(num_multipliers());
  for (std::int32_t f = 0; f < topology_.num_faces(); ++f) {
    const Eigen::Matrix<double, 6, 6> block = FaceBlock(f);
    for (int k = 0; k < 3; ++k) {
      if (const std::int32_t v = topology_.corner_row[3 * f + k]; v >= 0) {
        diagonal.segment<2>(2 * v) += block.diagonal().segment<2>(2 * k);
      }
    }
  }
  for (std::int32_t v = topology_.num_interior; v < topology_.num_rows; ++v) diagonal[2 * v + 1] = diagonal[2 * v];
  return diagonal;
}

Eigen::VectorXd ReducedSystem::ParticularSolution(const Eigen::VectorXd& g1) const {
  Eigen::VectorXd x(num_unknowns());
  for (std::int32_t f = 0; f < topology_.num_faces(); ++f) {
    for (int k = 0; k < 3; ++k) {
      x[3 * f + k] = g1[f] * hessian_[3 * f + Next(k)] * hessian_[3 * f + Prev(k)] * inverse_e_[f];
    }
  }
  return x;
}

Eigen::VectorXd ReducedSystem::TriangleMultipliers(const Eigen::VectorXd& residual, const Eigen::VectorXd& g1) const {
  Eigen::VectorXd lambda(topology_.num_faces());
  for (std::int32_t f = 0; f < topology_.num_faces(); ++f) {
    const double* a = &hessian_[3 * f];
    const double* r = &residual[3 * f];
    lambda[f] =
        (a[1] * a[2] * r[0] + a[2] * a[0] * r[1] + a[0] * a[1] * r[2] - a[0] * a[1] * a[2] * g1[f]) * inverse_e_[f];
  }
  return lambda;
}

Eigen::Matrix<double, 6, 6> ReducedSystem::FaceBlock(std::int32_t face) const {
  const double *a = &hessian_[3 * face], *c = &cot_[3 * face];
  Eigen::Matrix3d p;
  p << a[1] + a[2], -a[2], -a[1],  //
      -a[2], a[2] + a[0], -a[0],   //
      -a[1], -a[0], a[0] + a[1];
  p *= inverse_e_[face];
  Eigen::Matrix<double, 6, 3> j;
  j << 1, 0, 0,        //
      0, c[1], -c[2],  //
      0, 1, 0,         //
      -c[0], 0, c[2],  //
      0, 0, 1,         //
      c[0], -c[1], 0;
  for (int k = 0; k < 3; ++k) {
    if (!topology_.has_wheel(topology_.corner_row[3 * face + k])) j.row(2 * k + 1).setZero();
  }
  return j * p * j.transpose();
}

ReducedMatrix::ReducedMatrix(const Topology& topology) : topology_(topology), block_(topology.faces.size()) {
  const std::int32_t n = topology.num_rows;
  // Each edge between interior vertices is seen from both of its ends; duplicates are few and go.
  std::vector<std::int32_t> begin(n + 1, 0);
  for (std::int32_t c = 0; c < topology.num_corners(); ++c) {
    if (const std::int32_t v = topology.corner_row[c]; v >= 0) begin[v + 1] += 2;
  }
  for (std::int32_t v = 0; v < n; ++v) begin[v + 1] += begin[v] + 1;
  std::vector<std::int32_t> neighbour(begin[n]), cursor(begin.begin(), begin.end() - 1);
  for (std::int32_t v = 0; v < n; ++v) neighbour[cursor[v]++] = v;
  for (std::int32_t c = 0; c < topology.num_corners(); ++c) {
    const std::int32_t f = c / 3, k = c % 3, v = topology.corner_row[c];
    if (v < 0) continue;
    for (const int other : {Next(k), Prev(k)}) {
      const std::int32_t u = topology.corner_row[3 * f + other];
      neighbour[cursor[v]++] = u < 0 ? v : u;
    }
  }
  matrix_.row_begin.reserve(n + 1);
  for (std::int32_t v = 0; v < n; ++v) {
    const auto first = neighbour.begin() + begin[v], last = neighbour.begin() + begin[v + 1];
    std::sort(first, last);
    matrix_.column.insert(matrix_.column.end(), first, std::unique(first, last));
    matrix_.row_begin.push_back(static_cast<std::int32_t>(matrix_.column.size()));
  }
  matrix_.value.resize(4 * matrix_.column.size());
  for (std::int32_t f = 0; f < topology.num_faces(); ++f) {
    for (int i = 0; i < 3; ++i) {
      for (int j = 0; j < 3; ++j) {
        const std::int32_t row = topology.corner_row[3 * f + i], column = topology.corner_row[3 * f + j];
        if (row < 0 || column < 0) {
          block_[f][3 * i + j] = -1;
          continue;
        }
        const auto first = matrix_.column.begin() + matrix_.row_begin[row];
        const auto last = matrix_.column.begin() + matrix_.row_begin[row + 1];
        block_[f][3 * i + j] =
            static_cast<std::int32_t>(std::lower_bound(first, last, column) - matrix_.column.begin());
      }
    }
  }
}

const BlockMatrix<double>& ReducedMatrix::Assemble(const ReducedSystem& system) {
  std::fill(matrix_.value.begin(), matrix_.value.end(), 0.0);
  for (std::int32_t f = 0; f < topology_.num_faces(); ++f) {
    const Eigen::Matrix<double, 6, 6> face = system.FaceBlock(f);
    for (int i = 0; i < 3; ++i) {
      for (int j = 0; j < 3; ++j) {
        const std::int32_t k = block_[f][3 * i + j];
        if (k < 0) continue;
        double* block = &matrix_.value[4 * static_cast<std::int64_t>(k)];
        block[0] += face(2 * i, 2 * j);
        block[1] += face(2 * i, 2 * j + 1);
        block[2] += face(2 * i + 1, 2 * j);
        block[3] += face(2 * i + 1, 2 * j + 1);
      }
    }
  }
  for (std::int32_t v = topology_.num_interior; v < topology_.num_rows; ++v) {
    // The absent wheel row of a boundary vertex: anything positive on the diagonal.
    const auto first = matrix_.column.begin() + matrix_.row_begin[v],
               last = matrix_.column.begin() + matrix_.row_begin[v + 1];
    double* diagonal = &matrix_.value[4 * (std::lower_bound(first, last, v) - matrix_.column.begin())];
    diagonal[3] = diagonal[0];
  }
  return matrix_;
}

}  // namespace planish
