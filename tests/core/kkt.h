// Eq. 5 of the paper as one matrix, for any form of the wheel condition: what the solvers of this library avoid, kept
// for comparison.
//
//   K = [ hess_xx L   B^t ]        L = f(x) + mu^t h(x),  h: eq. 1, eq. 2 and the wheel condition in the form asked for
//       [ B            0  ]
//
// With eq. 6 hess_xx L is diagonal. With the products of eq. 3 the angles of a wheel are coupled, all with all. The
// forms have the same zeros, so the minimum is the same; figure 2 of the paper counts what the coupling costs.
//
// Everything here takes matrices as they are, without care for memory: for small meshes, without boundary rows
// (topology.num_rows == topology.num_interior).
#pragma once

#include <cstdint>

#include "Eigen/SparseCore"
#include "absl/status/statusor.h"
#include "core/abf/constraints.h"
#include "core/abf/lagrangian.h"
#include "core/abf/objective.h"

namespace planish {

// Column-compressed, 32-bit indices.
using SparseMatrix = Eigen::SparseMatrix<double, Eigen::ColMajor, int>;

// Three forms of the wheel condition. P_v is the product of sin(beta) and Q_v that of sin(gamma) over the faces at v.
enum class WheelForm {
  kLogarithm,   // eq. 6: log P_v - log Q_v
  kProduct,     // eq. 3: P_v / Q_v - 1
  kDifference,  // eq. 3 times Q_v: P_v - Q_v, as the original ABF (reference [17] of the paper) has it
};

// B as a matrix, (F + 2 num_rows) x 3F; the solvers never form B.
SparseMatrix ConstraintJacobian(const Topology& topology, const Eigen::VectorXd& x, WheelForm form);

// Eq. 3, one value per interior vertex: product of sin(beta) / sin(gamma), minus 1.
Eigen::VectorXd EvaluateWheelProducts(const Topology& topology, const Eigen::VectorXd& x);

// core/abf's functions of these names, for angles whose sines are not at hand.
ConstraintValues EvaluateConstraints(const Topology& topology, const Eigen::VectorXd& x);
Eigen::VectorXd LagrangianHessian(const Topology& topology, const Objective& objective, const Eigen::VectorXd& x,
                                  const Multipliers& mu);

// P_v and Q_v, the products of sin(beta) and of sin(gamma) over the faces at interior vertex v.
struct WheelSines {
  Eigen::VectorXd after, before;
};
WheelSines EvaluateWheelSines(const Topology& topology, const Eigen::VectorXd& x);

// h(x) with the wheel condition as `form` has it; entry 2 v + 1 of `pair` is that of interior vertex v.
ConstraintValues EvaluateConstraints(const Topology& topology, const Eigen::VectorXd& x, WheelForm form);

// hess_xx L, 3F x 3F, both triangles. With c_i = +-cot x_i (plus where x_i comes after v, minus before), wheel v adds
//   kProduct     mu_v P/Q (c_i c_j - delta_ij s_i / sin^2 x_i),  s_i the sign of c_i,   for all i, j of the wheel
//   kDifference  mu_v P (cot_i cot_j - delta_ij / sin^2 x_i)                            for i, j both after v
//               -mu_v Q (cot_i cot_j - delta_ij / sin^2 x_i)                            for i, j both before v
//   kLogarithm   LagrangianHessian()
// Entries are stored wherever the structure has one, whatever their value.
SparseMatrix LagrangianHessianMatrix(const Topology& topology, const Objective& objective, const Eigen::VectorXd& x,
                                     const Multipliers& mu, WheelForm form);

// K from its blocks; the zero block has no entries.
SparseMatrix KktMatrix(const SparseMatrix& hessian, const SparseMatrix& jacobian);

// Structural nonzeros of K from the valences alone; both triangles. With C the number of corners at interior vertices:
//   kLogarithm   9F + 6C: the diagonal, and twice the 3F of eq. 1, C of eq. 2 and 2C of eq. 6
//   kDifference  that and 2 d (d - 1) for every wheel of valence d
//   kProduct     that and 2 d (2d - 1) for every wheel, less 2 for every edge that joins two interior vertices, whose
//                two opposite angles are coupled by both wheels
//
// Figure 2 of the paper (F = 1796: 100,044 against 47,607) counts like this: 9F + 6C is 47,604 for C = 5,240, and the
// difference of 52,437 is 60.0 = 2 * 6 * 5 for each of some 874 interior vertices. So its figure 2(a) is kDifference;
// kProduct, eq. 3 as printed, would give about 158,000. (Neither number can be quite that of a mesh: a symmetric matrix
// with its 5,388 diagonal entries and no others there has an even number.)
std::int64_t CountKktNonzeros(const Topology& topology, WheelForm form);

struct KktOptions {
  WheelForm form = WheelForm::kLogarithm;
  double tolerance = 1e-12;         // largest entry of h and of the gradient, each scaled as in Residual
  int max_newton_iterations = 100;  // at least 1
};

struct KktSolution {
  Eigen::VectorXd x;
  Multipliers mu;  // of the form asked for: that of kDifference is that of the others divided by Q_v
  bool converged = false;
  int newton_iterations = 0;
  Residual residual;
};

// Plain Newton on L from x = a and mu = 0: each step solves eq. 5 with a sparse LU factorization of K and is cut short
// only where an angle would leave (0, pi). No line search, no convexification.
// FAILED_PRECONDITION if K is singular.
absl::StatusOr<KktSolution> SolveByKkt(const Topology& topology, const TargetAngles& target, const KktOptions& options);

}  // namespace planish
