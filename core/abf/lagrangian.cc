#include "core/abf/lagrangian.h"

#include <algorithm>
#include <cmath>

#include "Eigen/Cholesky"
#include "Eigen/Eigenvalues"
#include "Eigen/LU"
#include "core/linalg/vector_ops.h"

namespace planish {

Eigen::VectorXd LagrangianGradient(const Topology& topology, const Objective& objective, const Eigen::VectorXd& x,
                                   const Eigen::VectorXd& cot, const Multipliers& mu, ThreadTeam& team) {
  Eigen::VectorXd gradient = objective.Gradient(x);
  team.ForEach(topology.num_faces(), [&](std::int64_t f) {
    for (int k = 0; k < 3; ++k) gradient[3 * f + k] += mu.triangle[f];
  });
  AddPairRowsTransposed(topology, cot, mu.pair, &gradient, team);
  return gradient;
}

Eigen::VectorXd LagrangianHessian(const Topology& topology, const Eigen::VectorXd& curvature,
                                  const Eigen::VectorXd& sine, const Multipliers& mu, ThreadTeam& team) {
  Eigen::VectorXd hessian(curvature.size());
  team.ForEach(topology.num_faces(), [&](std::int64_t f) {
    const std::array<double, 3> wheel = WheelDifferences(topology, f, mu.pair);
    for (int k = 0; k < 3; ++k) {
      const double s = sine[3 * f + k];
      hessian[3 * f + k] = curvature[3 * f + k] - wheel[k] / (s * s);
    }
  });
  return hessian;
}

namespace {

// Smallest t with e(a - t b) = e(a) - t m + t^2 e(b) = 0 (e in lagrangian.h): the smallest eigenvalue of a relative to
// b on the plane. b is positive.
double SmallestPlaneEigenvalue(const double* a, const double* b) {
  const double ea = PlaneDeterminant(a), eb = PlaneDeterminant(b);
  const double m = a[0] * (b[1] + b[2]) + a[1] * (b[2] + b[0]) + a[2] * (b[0] + b[1]);
  const double root = std::sqrt(std::max(0.0, m * m - 4 * ea * eb));
  return m > 0 ? 2 * ea / (m + root) : (m - root) / (2 * eb);
}

}  // namespace

std::int64_t Convexify(const Eigen::VectorXd& curvature, Convexification kind, Eigen::VectorXd* hessian,
                       ThreadTeam& team, std::vector<std::int32_t>* weak, const ConvexityTuning& tuning) {
  if (weak != nullptr) weak->clear();
  const std::int64_t n = curvature.size() / 3;
  struct Part {
    std::int64_t changed = 0;
    std::vector<std::int32_t> weak;
  };
  const auto convexify = [&](std::int64_t begin, std::int64_t end) {
    Part part;
    for (std::int64_t f = begin; f < end; ++f) {
      double* a = &(*hessian)[3 * f];
      const double* b = &curvature[3 * f];
      bool change = false;
      if (kind == Convexification::kByFace) {
        const double smallest = SmallestPlaneEigenvalue(a, b);
        if (smallest < tuning.weak_curvature) part.weak.push_back(static_cast<std::int32_t>(f));
        change = !(smallest >= tuning.min_curvature);
        if (change) {
          const double t = (tuning.min_curvature - smallest) / (1 - smallest);
          for (int k = 0; k < 3; ++k) a[k] += t * (b[k] - a[k]);
        }
      } else {
        for (int k = 0; k < 3; ++k) {
          if (a[k] >= tuning.min_curvature * b[k]) continue;
          a[k] = tuning.min_curvature * b[k];
          change = true;
        }
      }
      part.changed += change;
    }
    return part;
  };
  std::int64_t changed = 0;
  for (const Part& part : team.Collect<Part>(n, ThreadTeam::kChunk, convexify)) {
    changed += part.changed;
    if (weak != nullptr) weak->insert(weak->end(), part.weak.begin(), part.weak.end());
  }
  return changed;
}

Eigen::VectorXd AbsoluteHessian(const Eigen::VectorXd& curvature, const Eigen::VectorXd& hessian, ThreadTeam& team,
                                const ConvexityTuning& tuning) {
  // diag(a) on the plane in the coordinates (u, v) of (u, v, -u - v).
  const auto on_plane = [](const double* a) {
    Eigen::Matrix2d plane;
    plane << a[0] + a[2], a[2], a[2], a[1] + a[2];
    return plane;
  };
  Eigen::VectorXd absolute = hessian;
  team.ForEach(hessian.size() / 3, [&](std::int64_t f) {
    double* a = &absolute[3 * f];
    const double* b = &curvature[3 * f];
    if (SmallestPlaneEigenvalue(a, b) >= tuning.min_curvature) return;
    const Eigen::Matrix2d root = Eigen::LLT<Eigen::Matrix2d>(on_plane(b)).matrixL();
    const Eigen::Matrix2d inverse = root.inverse();
    Eigen::SelfAdjointEigenSolver<Eigen::Matrix2d> eigen;
    eigen.computeDirect(inverse * on_plane(a) * inverse.transpose());
    const Eigen::Vector2d values = eigen.eigenvalues().cwiseAbs().cwiseMax(tuning.min_magnitude);
    const Eigen::Matrix2d vectors = root * eigen.eigenvectors();
    const Eigen::Matrix2d plane = vectors * values.asDiagonal() * vectors.transpose();
    a[0] = plane(0, 0) - plane(0, 1);
    a[1] = plane(1, 1) - plane(0, 1);
    a[2] = plane(0, 1);
  });
  return absolute;
}

Residual MeasureResidual(const Eigen::VectorXd& curvature, const ConstraintValues& h, const Eigen::VectorXd& gradient,
                         ThreadTeam& team) {
  Residual residual;
  residual.triangle = Largest(team, h.triangle.cwiseAbs());
  const Eigen::Index pairs = h.pair.size() / 2;
  using EveryOther = Eigen::Map<const Eigen::VectorXd, 0, Eigen::InnerStride<2>>;
  if (pairs > 0) {
    residual.vertex = Largest(team, EveryOther(h.pair.data(), pairs).cwiseAbs());
    residual.wheel = Largest(team, EveryOther(h.pair.data() + 1, pairs).cwiseAbs());
  }
  residual.gradient = Largest(team, gradient.cwiseQuotient(curvature).cwiseAbs());
  return residual;
}

}  // namespace planish
