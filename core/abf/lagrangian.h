// The Lagrangian L = f(x) + mu^t h(x) (section 6 of the paper): gradient, Hessian, and the Hessian made positive.
#pragma once

#include <cstdint>

#include "Eigen/Core"
#include "core/abf/constraints.h"
#include "core/abf/flatten.h"
#include "core/abf/target_angles.h"

namespace planish {

// mu, in the order of ConstraintValues.
struct Multipliers {
  Eigen::VectorXd triangle;  // F
  Eigen::VectorXd pair;      // 2 num_interior

  static Multipliers Zero(const Topology& topology) {
    return {Eigen::VectorXd::Zero(topology.num_faces()), Eigen::VectorXd::Zero(2 * topology.num_interior)};
  }
};

// grad_x L = 2 w (x - a) + B^t mu, with the cotangents of x.
Eigen::VectorXd LagrangianGradient(const Topology& topology, const TargetAngles& target, const Eigen::VectorXd& x,
                                   const Eigen::VectorXd& cot, const Multipliers& mu);

// The diagonal of hess_xx L: A_i = 2 w_i - m_i / sin^2 x_i, where m_i is the difference of the two wheel multipliers
// that x_i has in eq. 6.
Eigen::VectorXd LagrangianHessian(const Topology& topology, const TargetAngles& target, const Eigen::VectorXd& x,
                                  const Multipliers& mu);

// How a Hessian is made positive.
enum class Convexification {
  kNone,
  // Each face's 3x3 block positive definite on the plane of angle changes that sum to zero (all the reduced system
  // needs): a face whose smallest eigenvalue relative to diag(2 w) lies below kMinCurvature moves towards diag(2 w)
  // just as far as brings it there.
  kByFace,
  // Each entry at least kMinCurvature 2 w_i, which the full system needs.
  kByAngle,
};
inline constexpr double kMinCurvature = 0.02;

// Changes `hessian` in place. Returns the number of faces changed.
std::int64_t Convexify(const Topology& topology, const TargetAngles& target, Convexification kind,
                       Eigen::VectorXd* hessian);

// Largest entries of h and of the scaled gradient (Residual in flatten.h).
Residual MeasureResidual(const TargetAngles& target, const ConstraintValues& h, const Eigen::VectorXd& gradient);

}  // namespace planish
