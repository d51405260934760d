#include "core/abf/lagrangian.h"

#include <algorithm>
#include <cmath>

#include "core/abf/plane.h"

namespace planish {

Eigen::VectorXd LagrangianGradient(const Topology& topology, const Objective& objective, const Eigen::VectorXd& x,
                                   const Eigen::VectorXd& cot, const Multipliers& mu) {
  Eigen::VectorXd gradient = objective.Gradient(x);
  for (std::int32_t c = 0; c < topology.num_corners(); ++c) gradient[c] += mu.triangle[c / 3];
  AddPairRowsTransposed(topology, cot, mu.pair, &gradient);
  return gradient;
}

Eigen::VectorXd LagrangianHessian(const Topology& topology, const Objective& objective, const Eigen::VectorXd& x,
                                  const Multipliers& mu) {
  Eigen::VectorXd hessian = objective.Curvature(x);
  for (std::int32_t f = 0; f < topology.num_faces(); ++f) {
    double wheel[3];
    for (int k = 0; k < 3; ++k) {
      const std::int32_t v = topology.corner_row[3 * f + k];
      wheel[k] = topology.has_wheel(v) ? mu.pair[2 * v + 1] : 0;
    }
    for (int k = 0; k < 3; ++k) {
      const double sine = std::sin(x[3 * f + k]);
      hessian[3 * f + k] -= (wheel[Prev(k)] - wheel[Next(k)]) / (sine * sine);
    }
  }
  return hessian;
}

namespace {

// The polarization of e (plane.h): e(a - t b) = e(a) - t m(a, b) + t^2 e(b).
double PlanePolarization(const double* a, const double* b) {
  return a[0] * (b[1] + b[2]) + a[1] * (b[2] + b[0]) + a[2] * (b[0] + b[1]);
}

// Smallest t with e(a - t b) = 0: the smallest eigenvalue of a relative to b on the plane. b is positive.
double SmallestPlaneEigenvalue(const double* a, const double* b) {
  const double ea = PlaneDeterminant(a), eb = PlaneDeterminant(b), m = PlanePolarization(a, b);
  const double root = std::sqrt(std::max(0.0, m * m - 4 * ea * eb));
  return m > 0 ? 2 * ea / (m + root) : (m - root) / (2 * eb);
}

}  // namespace

std::int64_t Convexify(const Eigen::VectorXd& curvature, Convexification kind, Eigen::VectorXd* hessian) {
  if (kind == Convexification::kNone) return 0;
  std::int64_t changed = 0;
  for (Eigen::Index f = 0; f < curvature.size() / 3; ++f) {
    double* a = &(*hessian)[3 * f];
    const double* b = &curvature[3 * f];
    bool change = false;
    if (kind == Convexification::kByFace) {
      const double smallest = SmallestPlaneEigenvalue(a, b);
      if (smallest < kMinCurvature) {
        const double t = (kMinCurvature - smallest) / (1 - smallest);
        for (int k = 0; k < 3; ++k) a[k] += t * (b[k] - a[k]);
        change = true;
      }
    } else {
      for (int k = 0; k < 3; ++k) {
        if (a[k] < kMinCurvature * b[k]) {
          a[k] = kMinCurvature * b[k];
          change = true;
        }
      }
    }
    if (change) ++changed;
  }
  return changed;
}

Residual MeasureResidual(const Eigen::VectorXd& curvature, const ConstraintValues& h, const Eigen::VectorXd& gradient) {
  Residual residual;
  residual.triangle = h.triangle.cwiseAbs().maxCoeff();
  for (Eigen::Index i = 0; i < h.pair.size(); i += 2) {
    residual.vertex = std::max(residual.vertex, std::abs(h.pair[i]));
    residual.wheel = std::max(residual.wheel, std::abs(h.pair[i + 1]));
  }
  residual.gradient = (gradient.array() / curvature.array()).abs().maxCoeff();
  return residual;
}

}  // namespace planish
