#include "core/abf/reduced_system.h"

#include <algorithm>
#include <utility>

namespace planish {
namespace {

double PlaneDeterminant(const double* a) {
  return a[0] * a[1] + a[1] * a[2] + a[2] * a[0];
}

}  // namespace

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
      if (const std::int32_t v = topology_.corner_interior[3 * f + k]; v >= 0) {
        diagonal.segment<2>(2 * v) += block.diagonal().segment<2>(2 * k);
      }
    }
  }
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
  return j * p * j.transpose();
}

ReducedMatrix::ReducedMatrix(const Topology& topology) : topology_(topology), block_begin_(topology.faces.size()) {
  const std::int32_t n = topology.num_interior;
  // Lower neighbours of each interior vertex (itself first), sorted.
  std::vector<std::vector<std::int32_t>> below(n);
  for (std::int32_t v = 0; v < n; ++v) below[v].push_back(v);
  for (std::int32_t f = 0; f < topology.num_faces(); ++f) {
    for (int k = 0; k < 3; ++k) {
      const auto [low, high] =
          std::minmax({topology.corner_interior[3 * f + k], topology.corner_interior[3 * f + Next(k)]});
      if (low >= 0) below[low].push_back(high);
    }
  }
  std::vector<int> column_begin(2 * n + 1, 0), rows;
  std::vector<double> values;
  for (std::int32_t v = 0; v < n; ++v) {
    std::sort(below[v].begin(), below[v].end());
    below[v].erase(std::unique(below[v].begin(), below[v].end()), below[v].end());
    // The first column holds whole blocks, the second lacks the entry above the diagonal.
    for (const std::int32_t u : below[v]) rows.insert(rows.end(), {2 * u, 2 * u + 1});
    column_begin[2 * v + 1] = static_cast<int>(rows.size());
    rows.push_back(2 * v + 1);
    for (const std::int32_t u : below[v]) {
      if (u != v) rows.insert(rows.end(), {2 * u, 2 * u + 1});
    }
    column_begin[2 * v + 2] = static_cast<int>(rows.size());
  }
  values.assign(rows.size(), 0.0);
  matrix_ = Eigen::Map<const SparseMatrix>(2 * n, 2 * n, static_cast<Eigen::Index>(rows.size()), column_begin.data(),
                                           rows.data(), values.data());
  second_column_step_.resize(n);
  for (std::int32_t v = 0; v < n; ++v) {
    second_column_step_[v] = static_cast<std::int32_t>(2 * below[v].size()) - 1;
  }
  for (std::int32_t f = 0; f < topology.num_faces(); ++f) {
    for (int i = 0; i < 3; ++i) {
      for (int j = 0; j < 3; ++j) {
        const std::int32_t row = topology.corner_interior[3 * f + i], column = topology.corner_interior[3 * f + j];
        std::int32_t begin = -1;
        if (column >= 0 && row >= column) {
          const auto& list = below[column];
          begin = column_begin[2 * column] +
                  2 * static_cast<std::int32_t>(std::lower_bound(list.begin(), list.end(), row) - list.begin());
        }
        block_begin_[f][3 * i + j] = begin;
      }
    }
  }
}

const SparseMatrix& ReducedMatrix::Assemble(const ReducedSystem& system) {
  double* values = matrix_.valuePtr();
  std::fill(values, values + matrix_.nonZeros(), 0.0);
  for (std::int32_t f = 0; f < topology_.num_faces(); ++f) {
    const Eigen::Matrix<double, 6, 6> block = system.FaceBlock(f);
    for (int i = 0; i < 3; ++i) {
      for (int j = 0; j < 3; ++j) {
        const std::int32_t begin = block_begin_[f][3 * i + j];
        if (begin < 0) continue;
        const std::int32_t second = begin + second_column_step_[topology_.corner_interior[3 * f + j]];
        values[begin] += block(2 * i, 2 * j);
        values[begin + 1] += block(2 * i + 1, 2 * j);
        if (i != j) values[second] += block(2 * i, 2 * j + 1);
        values[second + 1] += block(2 * i + 1, 2 * j + 1);
      }
    }
  }
  return matrix_;
}

}  // namespace planish
