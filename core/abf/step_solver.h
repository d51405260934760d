// Eq. 5, the linear system of a Newton step, solved by the chosen solver, system and preconditioner.
#pragma once

#include <cstdint>
#include <memory>
#include <string>
#include <utility>
#include <vector>

#include "absl/status/statusor.h"
#include "core/abf/constraints.h"
#include "core/abf/flatten.h"
#include "core/abf/lagrangian.h"
#include "core/abf/systems.h"
#include "core/abf/tuning.h"
#include "core/linalg/linear_solver.h"
#include "core/linalg/multigrid.h"
#include "core/linalg/sparse_cholesky.h"

namespace planish {

struct NewtonStep {
  Eigen::VectorXd x;  // delta x
  Multipliers mu;     // delta mu
};

// The linear algebra of one run of Newton's method. What depends on the connectivity alone (pattern, ordering, symbolic
// factorization, aggregates) is made once. Not thread-safe.
class StepSolver {
 public:
  // None of the types may be kAuto; the combination must be valid (FlattenOptions::Validate).
  StepSolver(const Topology& topology, SolverType solver, SystemType system, PreconditionerType preconditioner,
             ThreadTeam& team = Alone(), const FlattenTuning& tuning = {});

  // Sets up the system of a new iterate. Preconditioners are made from `convex`, a Hessian that is positive in the
  // sense of RequiredConvexification(); `convex` may be `hessian` itself. If `indefinite`, `hessian` is not positive
  // and MINRES solves, whatever the solver is otherwise. The three vectors must outlive all calls of Solve() for this
  // iterate. `weak_faces` are those of Convexify(); multigrid needs help there. CANCELLED: interrupted. INTERNAL,
  // SOLVER_FAILED: as in Solve(). FAILED_PRECONDITION: the system is singular in double precision.
  absl::Status Prepare(const Eigen::VectorXd& hessian, const Eigen::VectorXd& convex, const Eigen::VectorXd& cot,
                       bool indefinite = false, std::vector<std::int32_t> weak_faces = {},
                       const Interrupter* interrupter = nullptr);

  // Whether MINRES on an indefinite system gives up early (StepTuning::max_indefinite_iterations). Default: yes.
  void set_limit_indefinite(bool limit) { limit_indefinite_ = limit; }

  // Eq. 5 for the gradient and constraint values of the iterate:
  //   A dx + B^t dmu = -gradient,  B dx = -h.
  // A preconditioner made for an earlier Hessian is made anew after a solve that took too many iterations more than the
  // first one with it; a factorization is also made anew in the middle of a solve (StepTuning). Where multigrid cannot
  // be built, or the solver does not converge with it within StepTuning::max_multigrid_iterations, this solve and all
  // later ones use a Cholesky factorization, and preconditioner() says so. Charts of more than kMostFallbackFaces have
  // StepTuning::max_iterations_without_fallback instead, and no factorization. INTERNAL, SOLVER_FAILED: multigrid
  // failed, and the factorization failed too or is not allowed; the message has the reasons and what the caller can do.
  absl::StatusOr<LinearSummary> Solve(const Eigen::VectorXd& gradient, const ConstraintValues& h,
                                      const LinearSolveOptions& options, NewtonStep* step);

  // The preconditioner in use: the one asked for, or kCholesky once multigrid has failed.
  PreconditionerType preconditioner() const { return types_.preconditioner; }
  // Why multigrid failed; empty if it has not.
  const std::string& multigrid_failure() const { return by_multigrid_.failure; }
  // What multigrid had to do without in some Prepare(), and why, for the latest one; empty if it had everything:
  // exact solves on the rows of weak faces (linalg/patch_preconditioner.h), or coarse spaces from an unfolding.
  const std::string& left_out() const { return by_multigrid_.left_out; }

  // For tests of failed solves: `solver` takes the place of all others, MINRES for indefinite systems included.
  void set_solver(LinearSolver solver) { solver_ = minres_ = std::move(solver); }

  // How a Hessian must be convexified for the system.
  Convexification RequiredConvexification() const {
    return types_.system == SystemType::kFull ? Convexification::kByAngle : Convexification::kByFace;
  }

 private:
  // What Prepare() was given, and the system that it made of that: one of the two.
  struct Iterate {
    const Eigen::VectorXd *hessian = nullptr, *convex = nullptr, *cot = nullptr;
    bool is_indefinite = false;
    std::vector<std::int32_t> weak_faces = {};
    std::unique_ptr<FullSystem> full = {};
    std::unique_ptr<ReducedSystem> reduced = {};
  };
  // How the factorization or the multigrid in use has served.
  struct Wear {
    int solves = -1;                                         // with it; -1 before there is one
    std::int64_t first_iterations = 0, last_iterations = 0;  // of the first and the latest of these solves

    // Whether it must be made, for the first time or because the last solve took more than so many iterations more than
    // the first.
    bool IsOut(std::int64_t tolerated_iterations) const {
      return solves < 0 || (solves > 0 && last_iterations > first_iterations + tolerated_iterations);
    }
  };

  // Assembles the matrix of the reduced system and makes the preconditioner.
  absl::Status PrepareReduced(const Interrupter* interrupter);
  // PrepareReduced() with S in float for multigrid, or in double for everything else. The preconditioner is made from S
  // of the convex Hessian, unless the one in use is good enough; then the system gets S of the Hessian.
  absl::Status PrepareMultigrid(const Interrupter* interrupter);
  absl::Status PrepareExact();
  // Adds exact solves on the rows of the vertices of weak faces to the preconditioner, unless there are none, or too
  // many (StepTuning::rows_per_weak_row). `s` is the matrix that multigrid was made for.
  void SolveWeakRowsExactly(const BlockMatrix<float>& s);
  // Replaces multigrid, which failed for the reason `why`, by a Cholesky factorization for good; or the error of
  // Solve().
  absl::Status TurnToCholesky(const std::string& why);
  LinearSummary SolveOnce(const Eigen::VectorXd& gradient, const ConstraintValues& h, const LinearSolveOptions& options,
                          NewtonStep* step);

  const Topology& topology_;
  ThreadTeam& team_;
  const FlattenTuning tuning_;
  struct {
    SolverType solver;
    SystemType system;
    PreconditionerType preconditioner;  // kCholesky once multigrid has failed
  } types_;
  LinearSolver solver_, minres_ = MakeMinresSolver();  // the chosen one; of indefinite systems
  bool limit_indefinite_ = true;
  Iterate iterate_;
  // What is kept from step to step to make preconditioners of, and S: in float for multigrid, which works in float
  // itself, in double for all others.
  struct {
    std::unique_ptr<ReducedMatrix<float>> s;
    std::unique_ptr<Multigrid> multigrid;
    bool is_closed = false;  // its numbers were made after the first step, from an unfolding that nearly closes up
    std::string failure, left_out;
  } by_multigrid_;
  struct {
    std::unique_ptr<ReducedMatrix<double>> s;
    SparseCholesky factorization;
  } by_factorization_;
  Preconditioner preconditioner_;
  Wear wear_;
};

}  // namespace planish
