// Solves eq. 5, the linear system of a Newton step, by the chosen solver, system and preconditioner.
#pragma once

#include <cstdint>
#include <memory>
#include <vector>

#include "absl/status/statusor.h"
#include "core/abf/constraints.h"
#include "core/abf/flatten.h"
#include "core/abf/full_system.h"
#include "core/abf/lagrangian.h"
#include "core/abf/reduced_system.h"
#include "core/linalg/linear_solver.h"
#include "core/linalg/multigrid.h"

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
  StepSolver(const Topology& topology, SolverType solver, SystemType system, PreconditionerType preconditioner,
             ThreadTeam& team = Alone());

  // Takes up the Hessian and the cotangents of a new iterate. `convex` is the Hessian that preconditioners are made
  // from, positive in the sense of RequiredConvexification(); it may be `hessian` itself. If `indefinite`, `hessian` is
  // not positive and MINRES solves, whatever the solver is otherwise. All three vectors must last as long as Solve() is
  // called. `weak_faces` are those where multigrid needs help (WeakFaces). CANCELLED: interrupted.
  absl::Status Prepare(const Eigen::VectorXd& hessian, const Eigen::VectorXd& convex, const Eigen::VectorXd& cot,
                       bool indefinite = false, std::vector<std::int32_t> weak_faces = {},
                       const Interrupter* interrupter = nullptr);

  // Whether MINRES on an indefinite system must stay within a few times the iterations of a positive one.
  void set_limit_indefinite(bool limit) { limit_indefinite_ = limit; }

  // Eq. 5 for the gradient and constraint values of the iterate:
  //   A dx + B^t dmu = -gradient,  B dx = -h.
  // Preconditioners are watched. One that was made for an earlier Hessian is made anew after a solve that took some
  // iterations more than the first one with it, a factorization in the middle of the solve if it takes many more. If
  // multigrid cannot be built or the solver does not converge with it within kMaxMultigridIterations, this solve and
  // all later ones use Cholesky.
  LinearSummary Solve(const Eigen::VectorXd& gradient, const ConstraintValues& h, const LinearSolveOptions& options,
                      NewtonStep* step);

  // The preconditioner in use: as asked for, or kCholesky once multigrid has failed (see Solve).
  PreconditionerType preconditioner() const { return preconditioner_type_; }

  // What the system needs of a convexified Hessian.
  Convexification RequiredConvexification() const {
    return system_type_ == SystemType::kFull ? Convexification::kByAngle : Convexification::kByFace;
  }

 private:
  // Whether the preconditioner is to be made anew, or for the first time.
  bool IsWornOut(std::int64_t tolerated) const;
  // What is to be made of the matrix of the reduced system.
  absl::Status PrepareReduced(const Interrupter* interrupter);
  // Multigrid, or what needs S in double. Both make the preconditioner from S of the convex Hessian, unless the one in
  // use is good enough, and leave S of the Hessian to `reduced_`.
  absl::Status PrepareMultigrid(const Interrupter* interrupter);
  // The rows of the vertices of weak faces, ascending; none if there are too many to be solved for by themselves.
  std::vector<std::int32_t> WeakRows() const;
  absl::Status PrepareExact();
  // From multigrid to Cholesky, for good.
  void TurnToCholesky();
  LinearSummary SolveOnce(const Eigen::VectorXd& gradient, const ConstraintValues& h, const LinearSolveOptions& options,
                          NewtonStep* step);

  const Topology& topology_;
  ThreadTeam& team_;
  const SolverType solver_type_;
  const SystemType system_type_;
  PreconditionerType preconditioner_type_;
  std::unique_ptr<LinearSolver> solver_;
  const std::unique_ptr<LinearSolver> minres_ = MakeMinresSolver();
  bool indefinite_ = false, limit_indefinite_ = true;
  std::unique_ptr<FullSystem> full_;
  std::unique_ptr<ReducedSystem> reduced_;
  // S: rounded with multigrid, which is of float itself; else exact.
  std::unique_ptr<ReducedMatrix<float>> rounded_matrix_;
  std::unique_ptr<ReducedMatrix<double>> matrix_;
  std::vector<std::int32_t> weak_faces_;
  const Eigen::VectorXd *hessian_ = nullptr, *convex_ = nullptr, *cot_ = nullptr;  // of Prepare()
  SparseCholesky factorization_;
  Multigrid multigrid_;
  bool multigrid_closed_ = false;  // its numbers stand on an unfolding of angles that have met the constraints, nearly
  std::unique_ptr<Preconditioner> preconditioner_;
  // Of the factorization or the numbers of the multigrid in use: the solves with them, -1 if there are none yet, and
  // the iterations of the first and the latest of these.
  int uses_ = -1;
  std::int64_t first_iterations_ = 0, last_iterations_ = 0;
};

}  // namespace planish
