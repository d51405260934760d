// Solves eq. 5, the linear system of a Newton step, by the chosen solver, system and preconditioner.
#pragma once

#include <memory>

#include "absl/status/statusor.h"
#include "core/abf/constraints.h"
#include "core/abf/flatten.h"
#include "core/abf/full_system.h"
#include "core/abf/lagrangian.h"
#include "core/abf/reduced_system.h"
#include "core/linalg/linear_solver.h"

namespace planish {

struct NewtonStep {
  Eigen::VectorXd x;  // delta x
  Multipliers mu;     // delta mu
};

// One Flatten() call's linear algebra. What depends on the connectivity alone (pattern, ordering, symbolic
// factorization) is made once.
class StepSolver {
 public:
  // None of the types may be kAuto; the combination must be valid (FlattenOptions::Validate).
  StepSolver(const Topology& topology, SolverType solver, SystemType system, PreconditionerType preconditioner);

  // Takes up the Hessian and the cotangents of a new iterate. `convex` is the Hessian that preconditioners are made
  // from, positive in the sense of RequiredConvexification(); it may be `hessian` itself.
  absl::Status Prepare(const Eigen::VectorXd& hessian, const Eigen::VectorXd& convex, const Eigen::VectorXd& cot);

  // Eq. 5 for the gradient and constraint values of the iterate:
  //   A dx + B^t dmu = -gradient,  B dx = -h.
  LinearSummary Solve(const Eigen::VectorXd& gradient, const ConstraintValues& h, const LinearSolveOptions& options,
                      NewtonStep* step);

  // What the system needs of a convexified Hessian.
  Convexification RequiredConvexification() const {
    return system_type_ == SystemType::kFull ? Convexification::kByAngle : Convexification::kByFace;
  }

 private:
  absl::Status FactorizeReduced(const Eigen::VectorXd& convex, const Eigen::VectorXd& cot);

  const Topology& topology_;
  const SolverType solver_type_;
  const SystemType system_type_;
  const PreconditionerType preconditioner_type_;
  std::unique_ptr<LinearSolver> solver_;
  std::unique_ptr<FullSystem> full_;
  std::unique_ptr<ReducedSystem> reduced_;
  std::unique_ptr<ReducedMatrix> matrix_;
  SparseCholesky factorization_;
  bool factorized_ = false;
  std::int64_t iterations_since_factorization_ = 0;
  std::unique_ptr<Preconditioner> preconditioner_;
};

}  // namespace planish
