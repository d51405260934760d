#include "tests/core/kkt.h"

#include <cmath>
#include <vector>

#include "Eigen/SparseLU"
#include "core/abf/line_search.h"
#include "core/base/portable_math.h"

namespace planish {
namespace {

using Entries = std::vector<Eigen::Triplet<double, int>>;

// An angle in the wheel of a vertex.
struct Spoke {
  std::int32_t angle;
  double sign;  // +1 after the vertex (beta), -1 before it (gamma)
};

std::vector<std::vector<Spoke>> Wheels(const Topology& topology) {
  std::vector<std::vector<Spoke>> wheels(topology.num_interior);
  for (std::int32_t c = 0; c < topology.num_corners(); ++c) {
    const std::int32_t v = topology.corner_row[c], f = c / 3, k = c % 3;
    if (v < 0 || v >= topology.num_interior) continue;
    wheels[v].push_back({3 * f + Next(k), 1});
    wheels[v].push_back({3 * f + Prev(k), -1});
  }
  return wheels;
}

// d^2 R / dx_i dx_j / R for R = P/Q: c_i c_j, and on the diagonal c_i' too.
double LogSecondDerivative(const Spoke& i, const Spoke& j, const Eigen::VectorXd& x, const Eigen::VectorXd& cot) {
  double second = i.sign * cot[i.angle] * j.sign * cot[j.angle];
  if (i.angle == j.angle) {
    const double sine = std::sin(x[i.angle]);
    second -= i.sign / (sine * sine);
  }
  return second;
}

}  // namespace

Eigen::VectorXd EvaluateWheelProducts(const Topology& topology, const Eigen::VectorXd& x) {
  Eigen::VectorXd product = Eigen::VectorXd::Ones(topology.num_interior);
  for (std::int32_t c = 0; c < topology.num_corners(); ++c) {
    const std::int32_t f = c / 3, k = c % 3;
    if (const std::int32_t v = topology.corner_row[c]; topology.has_wheel(v)) {
      product[v] *= portable::Sin(x[3 * f + Next(k)]) / portable::Sin(x[3 * f + Prev(k)]);
    }
  }
  return product.array() - 1;
}

SparseMatrix ConstraintJacobian(const Topology& topology, const Eigen::VectorXd& x, WheelForm form) {
  const Eigen::VectorXd cot = Cotangents(x);
  // d(P/Q) = P/Q (d log P - d log Q) and d(P - Q) = P d log P - Q d log Q: eq. 6 with its entries scaled.
  Eigen::VectorXd scale_after = Eigen::VectorXd::Ones(topology.num_rows), scale_before = scale_after;
  if (form == WheelForm::kProduct) {
    scale_after.head(topology.num_interior).array() += EvaluateWheelProducts(topology, x).array();
    scale_before = scale_after;
  } else if (form == WheelForm::kDifference) {
    for (std::int32_t c = 0; c < topology.num_corners(); ++c) {
      const std::int32_t f = c / 3, k = c % 3;
      if (const std::int32_t v = topology.corner_row[c]; v >= 0) {
        scale_after[v] *= portable::Sin(x[3 * f + Next(k)]);
        scale_before[v] *= portable::Sin(x[3 * f + Prev(k)]);
      }
    }
  }
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
    entries.emplace_back(wheel_row, after, scale_after[v] * cot[after]);
    entries.emplace_back(wheel_row, before, -scale_before[v] * cot[before]);
  }
  SparseMatrix jacobian(topology.num_faces() + 2 * topology.num_rows, topology.num_corners());
  jacobian.setFromTriplets(entries.begin(), entries.end());
  return jacobian;
}

ConstraintValues EvaluateConstraints(const Topology& topology, const Eigen::VectorXd& x) {
  return EvaluateConstraints(topology, x, Sines(x));
}

Eigen::VectorXd LagrangianHessian(const Topology& topology, const Objective& objective, const Eigen::VectorXd& x,
                                  const Multipliers& mu) {
  return LagrangianHessian(topology, objective.Curvature(x), Sines(x), mu);
}

WheelSines EvaluateWheelSines(const Topology& topology, const Eigen::VectorXd& x) {
  WheelSines sines{Eigen::VectorXd::Ones(topology.num_interior), Eigen::VectorXd::Ones(topology.num_interior)};
  const std::vector<std::vector<Spoke>> wheels = Wheels(topology);
  for (std::int32_t v = 0; v < topology.num_interior; ++v) {
    for (const Spoke& spoke : wheels[v]) {
      (spoke.sign > 0 ? sines.after : sines.before)[v] *= std::sin(x[spoke.angle]);
    }
  }
  return sines;
}

ConstraintValues EvaluateConstraints(const Topology& topology, const Eigen::VectorXd& x, WheelForm form) {
  ConstraintValues h = EvaluateConstraints(topology, x);
  if (form == WheelForm::kLogarithm) return h;
  const WheelSines sines = EvaluateWheelSines(topology, x);
  for (std::int32_t v = 0; v < topology.num_interior; ++v) {
    h.pair[2 * v + 1] = sines.after[v] - sines.before[v];
    if (form == WheelForm::kProduct) h.pair[2 * v + 1] /= sines.before[v];
  }
  return h;
}

SparseMatrix LagrangianHessianMatrix(const Topology& topology, const Objective& objective, const Eigen::VectorXd& x,
                                     const Multipliers& mu, WheelForm form) {
  const Eigen::VectorXd diagonal =
      form == WheelForm::kLogarithm ? LagrangianHessian(topology, objective, x, mu) : objective.Curvature(x);
  Entries entries;
  for (std::int32_t i = 0; i < topology.num_corners(); ++i) entries.emplace_back(i, i, diagonal[i]);
  if (form != WheelForm::kLogarithm) {
    const Eigen::VectorXd cot = Cotangents(x);
    const WheelSines sines = EvaluateWheelSines(topology, x);
    const std::vector<std::vector<Spoke>> wheels = Wheels(topology);
    for (std::int32_t v = 0; v < topology.num_interior; ++v) {
      const double m = mu.pair[2 * v + 1];
      for (const Spoke& i : wheels[v]) {
        for (const Spoke& j : wheels[v]) {
          if (form == WheelForm::kProduct) {
            const double factor = m * sines.after[v] / sines.before[v];
            entries.emplace_back(i.angle, j.angle, factor * LogSecondDerivative(i, j, x, cot));
          } else if (i.sign == j.sign) {
            // Q is a product of the same kind as P: the sign belongs to the term, not to the cotangents.
            const double factor = i.sign > 0 ? m * sines.after[v] : -m * sines.before[v];
            entries.emplace_back(i.angle, j.angle, factor * LogSecondDerivative({i.angle, 1}, {j.angle, 1}, x, cot));
          }
        }
      }
    }
  }
  SparseMatrix hessian(topology.num_corners(), topology.num_corners());
  hessian.setFromTriplets(entries.begin(), entries.end());
  return hessian;
}

SparseMatrix KktMatrix(const SparseMatrix& hessian, const SparseMatrix& jacobian) {
  const int n = static_cast<int>(hessian.cols());
  Entries entries;
  entries.reserve(hessian.nonZeros() + 2 * jacobian.nonZeros());
  for (int column = 0; column < n; ++column) {
    for (SparseMatrix::InnerIterator it(hessian, column); it; ++it) {
      entries.emplace_back(static_cast<int>(it.row()), column, it.value());
    }
    for (SparseMatrix::InnerIterator it(jacobian, column); it; ++it) {
      const int row = n + static_cast<int>(it.row());
      entries.emplace_back(row, column, it.value());
      entries.emplace_back(column, row, it.value());
    }
  }
  SparseMatrix kkt(n + jacobian.rows(), n + jacobian.rows());
  kkt.setFromTriplets(entries.begin(), entries.end());
  return kkt;
}

std::int64_t CountKktNonzeros(const Topology& topology, WheelForm form) {
  std::vector<std::int64_t> valence(topology.num_interior, 0);
  std::int64_t corners = 0, coupled_edges = 0;
  for (std::int32_t c = 0; c < topology.num_corners(); ++c) {
    const std::int32_t v = topology.corner_row[c];
    if (v >= 0 && v < topology.num_interior) {
      ++corners;
      ++valence[v];
    }
    // The edge that corner c faces, seen from one of its two sides.
    const std::int32_t f = c / 3, k = c % 3;
    const std::int32_t a = topology.corner_row[3 * f + Next(k)], b = topology.corner_row[3 * f + Prev(k)];
    const auto interior = [&](std::int32_t row) { return row >= 0 && row < topology.num_interior; };
    if (topology.opposite[c] > c && interior(a) && interior(b)) ++coupled_edges;
  }
  std::int64_t count = 9 * std::int64_t{topology.num_faces()} + 6 * corners;
  for (const std::int64_t d : valence) {
    if (form == WheelForm::kDifference) count += 2 * d * (d - 1);
    if (form == WheelForm::kProduct) count += 2 * d * (2 * d - 1);
  }
  return form == WheelForm::kProduct ? count - 2 * coupled_edges : count;
}

absl::StatusOr<KktSolution> SolveByKkt(const Topology& topology, const TargetAngles& target,
                                       const KktOptions& options) {
  const Objective objective(target);
  const Eigen::Index angles = topology.num_corners(), faces = topology.num_faces(), pairs = 2 * topology.num_rows;
  KktSolution solution;
  solution.x = target.angle;
  solution.mu = Multipliers::Zero(topology);
  while (true) {
    const SparseMatrix jacobian = ConstraintJacobian(topology, solution.x, options.form);
    const ConstraintValues h = EvaluateConstraints(topology, solution.x, options.form);
    Eigen::VectorXd mu(faces + pairs);
    mu << solution.mu.triangle, solution.mu.pair;
    const Eigen::VectorXd gradient = objective.Gradient(solution.x) + jacobian.transpose() * mu;
    solution.residual = MeasureResidual(objective.Curvature(solution.x), h, gradient);
    solution.converged = solution.residual.Max() <= options.tolerance;
    if (solution.converged || solution.newton_iterations == options.max_newton_iterations) return solution;

    const SparseMatrix hessian = LagrangianHessianMatrix(topology, objective, solution.x, solution.mu, options.form);
    const Eigen::SparseLU<SparseMatrix> factorization(KktMatrix(hessian, jacobian));
    if (factorization.info() != Eigen::Success) {
      return absl::FailedPreconditionError("the matrix of eq. 5 is singular");
    }
    Eigen::VectorXd right(angles + faces + pairs);
    right << -gradient, -h.triangle, -h.pair;
    const Eigen::VectorXd step = factorization.solve(right);
    const Eigen::VectorXd dx = step.head(angles);
    const double alpha = LargestStepLength(solution.x, dx);
    solution.x += alpha * dx;
    solution.mu.triangle += alpha * step.segment(angles, faces);
    solution.mu.pair += alpha * step.tail(pairs);
    ++solution.newton_iterations;
  }
}

}  // namespace planish
