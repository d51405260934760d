#include "core/abf/constraints.h"

#include <cmath>
#include <numbers>
#include <vector>

namespace planish {

ConstraintValues EvaluateConstraints(const Topology& topology, const Eigen::VectorXd& x) {
  ConstraintValues h;
  h.triangle.resize(topology.num_faces());
  h.pair = Eigen::VectorXd::Zero(2 * topology.num_rows);
  for (std::int32_t v = 0; v < topology.num_rows; ++v) {
    h.pair[2 * v] = topology.has_wheel(v) ? -2 * std::numbers::pi : -std::numbers::pi;
  }
  for (std::int32_t f = 0; f < topology.num_faces(); ++f) {
    const double* angle = &x[3 * f];
    const std::int32_t* vertex = &topology.corner_row[3 * f];
    h.triangle[f] = angle[0] + angle[1] + angle[2] - std::numbers::pi;
    const double log_sin[3] = {std::log(std::sin(angle[0])), std::log(std::sin(angle[1])),
                               std::log(std::sin(angle[2]))};
    for (int k = 0; k < 3; ++k) {
      if (vertex[k] < 0) continue;
      h.pair[2 * vertex[k]] += angle[k];
      if (topology.has_wheel(vertex[k])) h.pair[2 * vertex[k] + 1] += log_sin[Next(k)] - log_sin[Prev(k)];
    }
  }
  return h;
}

Eigen::VectorXd EvaluateWheelProducts(const Topology& topology, const Eigen::VectorXd& x) {
  Eigen::VectorXd product = Eigen::VectorXd::Ones(topology.num_interior);
  for (std::int32_t c = 0; c < topology.num_corners(); ++c) {
    const std::int32_t f = c / 3, k = c % 3;
    if (const std::int32_t v = topology.corner_row[c]; topology.has_wheel(v)) {
      product[v] *= std::sin(x[3 * f + Next(k)]) / std::sin(x[3 * f + Prev(k)]);
    }
  }
  return product.array() - 1;
}

void ApplyPairRows(const Topology& topology, const Eigen::VectorXd& cot, const Eigen::VectorXd& x, Eigen::VectorXd* y) {
  y->setZero(2 * topology.num_rows);
  for (std::int32_t f = 0; f < topology.num_faces(); ++f) {
    const double* angle = &x[3 * f];
    const std::int32_t* vertex = &topology.corner_row[3 * f];
    const double wheel[3] = {cot[3 * f] * angle[0], cot[3 * f + 1] * angle[1], cot[3 * f + 2] * angle[2]};
    for (int k = 0; k < 3; ++k) {
      if (vertex[k] < 0) continue;
      (*y)[2 * vertex[k]] += angle[k];
      if (topology.has_wheel(vertex[k])) (*y)[2 * vertex[k] + 1] += wheel[Next(k)] - wheel[Prev(k)];
    }
  }
}

void AddPairRowsTransposed(const Topology& topology, const Eigen::VectorXd& cot,
                           const Eigen::Ref<const Eigen::VectorXd>& pair, Eigen::VectorXd* x) {
  for (std::int32_t f = 0; f < topology.num_faces(); ++f) {
    const std::int32_t* vertex = &topology.corner_row[3 * f];
    double wheel[3];
    for (int k = 0; k < 3; ++k) {
      wheel[k] = topology.has_wheel(vertex[k]) ? pair[2 * vertex[k] + 1] : 0;
      if (vertex[k] >= 0) (*x)[3 * f + k] += pair[2 * vertex[k]];
    }
    // Angle k comes after the vertex at Prev(k) and before the vertex at Next(k).
    for (int k = 0; k < 3; ++k) (*x)[3 * f + k] += cot[3 * f + k] * (wheel[Prev(k)] - wheel[Next(k)]);
  }
}

Eigen::VectorXd Cotangents(const Eigen::VectorXd& x) {
  return x.unaryExpr([](double angle) { return 1 / std::tan(angle); });
}

SparseMatrix ConstraintJacobian(const Topology& topology, const Eigen::VectorXd& x, WheelForm form) {
  const Eigen::VectorXd cot = Cotangents(x);
  // d(product - 1) = product d(log product), so eq. 3 is eq. 6 with its rows scaled.
  const Eigen::VectorXd scale = form == WheelForm::kProduct
                                    ? Eigen::VectorXd(EvaluateWheelProducts(topology, x).array() + 1)
                                    : Eigen::VectorXd::Ones(topology.num_interior);
  std::vector<Eigen::Triplet<double, int>> entries;
  for (std::int32_t c = 0; c < topology.num_corners(); ++c) {
    const std::int32_t f = c / 3, k = c % 3;
    entries.emplace_back(f, c, 1.0);
    const std::int32_t v = topology.corner_row[c];
    if (v < 0) continue;
    const std::int32_t vertex_row = topology.num_faces() + 2 * v, wheel_row = vertex_row + 1;
    const std::int32_t after = 3 * f + Next(k), before = 3 * f + Prev(k);
    entries.emplace_back(vertex_row, c, 1.0);
    if (!topology.has_wheel(v)) continue;
    entries.emplace_back(wheel_row, after, scale[v] * cot[after]);
    entries.emplace_back(wheel_row, before, -scale[v] * cot[before]);
  }
  SparseMatrix jacobian(topology.num_faces() + 2 * topology.num_rows, topology.num_corners());
  jacobian.setFromTriplets(entries.begin(), entries.end());
  return jacobian;
}

}  // namespace planish
