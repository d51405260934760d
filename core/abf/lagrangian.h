// The Lagrangian L = f(x) + mu^t h(x) (section 6 of the paper; f is any Objective): gradient, Hessian, and the
// convexified Hessian.
#pragma once

#include <cstdint>
#include <vector>

#include "Eigen/Core"
#include "core/abf/constraints.h"
#include "core/abf/flatten.h"
#include "core/abf/objective.h"
#include "core/abf/tuning.h"

namespace planish {

// mu, in the order of ConstraintValues.
struct Multipliers {
  Eigen::VectorXd triangle;  // F
  Eigen::VectorXd pair;      // 2 num_rows

  static Multipliers Zero(const Topology& topology) {
    return {Eigen::VectorXd::Zero(topology.num_faces()), Eigen::VectorXd::Zero(2 * topology.num_rows)};
  }
};

// grad_x L = grad f + B^t mu, with the cotangents of x.
Eigen::VectorXd LagrangianGradient(const Topology& topology, const Objective& objective, const Eigen::VectorXd& x,
                                   const Eigen::VectorXd& cot, const Multipliers& mu, ThreadTeam& team = Alone());

// The diagonal of hess_xx L: A_i = f''(x_i) - m_i / sin^2 x_i, where m_i is the difference of the two wheel multipliers
// that x_i has in eq. 6. `curvature` is f''(x), `sine` the sines of x.
Eigen::VectorXd LagrangianHessian(const Topology& topology, const Eigen::VectorXd& curvature,
                                  const Eigen::VectorXd& sine, const Multipliers& mu, ThreadTeam& team = Alone());

// e(a) = a0 a1 + a1 a2 + a2 a0: up to a constant factor, the determinant of diag(a) on the plane of angle changes of
// one face that sum to zero. That plane is where the face's part of a Newton step lies.
inline double PlaneDeterminant(const double* a) {
  return a[0] * a[1] + a[1] * a[2] + a[2] * a[0];
}

// How to convexify a Hessian.
enum class Convexification {
  // Each face's 3x3 block becomes positive definite on the plane of angle changes that sum to zero (all that the
  // reduced system needs): a face whose smallest eigenvalue relative to diag(f'') is below
  // ConvexityTuning::min_curvature is moved towards diag(f'') just far enough to reach it.
  kByFace,
  // Each entry becomes at least min_curvature times f''(x_i), which the full system needs.
  kByAngle,
};

// Convexifies `hessian` in place; `curvature` is the diagonal f''. Returns the number of faces changed. With kByFace,
// `weak` gets the faces whose smallest eigenvalue was below ConvexityTuning::weak_curvature, ascending.
std::int64_t Convexify(const Eigen::VectorXd& curvature, Convexification kind, Eigen::VectorXd* hessian,
                       ThreadTeam& team = Alone(), std::vector<std::int32_t>* weak = nullptr,
                       const ConvexityTuning& tuning = {});

// The absolute value of the Hessian on the plane, relative to diag(f''): for faces that kByFace would change, negative
// eigenvalues change their sign, and those below ConvexityTuning::min_magnitude are raised to it. Used to precondition
// indefinite systems (Vecharynski and Knyazev 2013, "Absolute value preconditioning for symmetric indefinite linear
// systems"): the eigenvalues end up near 1, and one for each such face near -1.
Eigen::VectorXd AbsoluteHessian(const Eigen::VectorXd& curvature, const Eigen::VectorXd& hessian,
                                ThreadTeam& team = Alone(), const ConvexityTuning& tuning = {});

// The largest entries of h, and of the gradient divided by `curvature`, the diagonal f'' (Residual in flatten.h).
Residual MeasureResidual(const Eigen::VectorXd& curvature, const ConstraintValues& h, const Eigen::VectorXd& gradient,
                         ThreadTeam& team = Alone());

}  // namespace planish
