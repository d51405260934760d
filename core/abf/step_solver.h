// Solves eq. 5, the linear system of a Newton step, with the chosen solver, system and preconditioner.
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

// The linear algebra of one run of Newton's method. Everything that depends only on the connectivity (pattern,
// ordering, symbolic factorization, aggregates) is computed once. Not thread-safe.
class StepSolver {
 public:
  // None of the types may be kAuto; the combination must be valid (FlattenOptions::Validate).
  StepSolver(const Topology& topology, SolverType solver, SystemType system, PreconditionerType preconditioner,
             ThreadTeam& team = Alone(), const FlattenTuning& tuning = {});

  // Sets up the system of a new iterate. Preconditioners are built from `convex`, a Hessian that is positive in the
  // sense of RequiredConvexification(); it may be `hessian` itself. If `indefinite`, `hessian` is not positive and
  // MINRES solves, whatever the chosen solver. The three vectors must outlive all calls of Solve() for this iterate.
  // `weak_faces` are those of Convexify(), where multigrid needs help. CANCELLED: interrupted. INTERNAL, SOLVER_FAILED:
  // as in Solve(). FAILED_PRECONDITION: the system is singular in double precision.
  absl::Status Prepare(const Eigen::VectorXd& hessian, const Eigen::VectorXd& convex, const Eigen::VectorXd& cot,
                       bool indefinite = false, std::vector<std::int32_t> weak_faces = {},
                       const Interrupter* interrupter = nullptr);

  // Whether MINRES on an indefinite system gives up early (StepTuning::max_indefinite_iterations). Default: yes.
  void set_limit_indefinite(bool limit) { limit_indefinite_ = limit; }

  // Eq. 5 for the gradient and constraint values of the iterate:
  //   A dx + B^t dmu = -gradient,  B dx = -h.
  // A preconditioner built for an earlier Hessian is rebuilt after a solve that took too many iterations more than the
  // first one with it; a factorization is also rebuilt in the middle of a solve (StepTuning). If multigrid cannot be
  // built, or the solver does not converge with it within StepTuning::max_multigrid_iterations, this solve and all
  // later ones use a Cholesky factorization, and preconditioner() says so. Charts of more than kMostFallbackFaces get
  // StepTuning::max_iterations_without_fallback instead, and no factorization. INTERNAL, SOLVER_FAILED: multigrid
  // failed, and the factorization failed too or is not allowed; the message has the reasons and what the caller can do.
  absl::StatusOr<LinearSummary> Solve(const Eigen::VectorXd& gradient, const ConstraintValues& h,
                                      const LinearSolveOptions& options, NewtonStep* step);

  // The preconditioner in use: the requested one, or kCholesky once multigrid has failed.
  PreconditionerType preconditioner() const { return types_.preconditioner; }
  // Why multigrid failed; empty if it has not.
  const std::string& multigrid_failure() const { return by_multigrid_.failure; }
  // The part of multigrid that the latest incomplete Prepare() left out, and why: exact solves on the rows of weak
  // faces (linalg/patch_preconditioner.h), or coarse spaces from an unfolding. Empty if no Prepare() left anything out.
  const std::string& left_out() const { return by_multigrid_.left_out; }

  // For tests of failed solves: `solver` replaces all others, also MINRES for indefinite systems.
  void set_solver(LinearSolver solver) { solver_ = minres_ = std::move(solver); }

  // How a Hessian must be convexified for the system.
  Convexification RequiredConvexification() const {
    return types_.system == SystemType::kFull ? Convexification::kByAngle : Convexification::kByFace;
  }

 private:
  // The arguments of Prepare(), and the system made from them: `full` or `reduced`.
  struct Iterate {
    const Eigen::VectorXd *hessian = nullptr, *convex = nullptr, *cot = nullptr;
    bool is_indefinite = false;
    std::vector<std::int32_t> weak_faces = {};
    std::unique_ptr<FullSystem> full = {};
    std::unique_ptr<ReducedSystem> reduced = {};
  };
  // The number of solves and iterations with the factorization or multigrid in use.
  struct Wear {
    int solves = -1;                                         // -1 before it is built
    std::int64_t first_iterations = 0, last_iterations = 0;  // of the first and the latest of these solves

    // Whether the factorization or multigrid must be built: for the first time, or because the last solve took more
    // than `tolerated_iterations` more iterations than the first.
    bool IsOut(std::int64_t tolerated_iterations) const {
      return solves < 0 || (solves > 0 && last_iterations > first_iterations + tolerated_iterations);
    }
  };

  // Assembles the matrix of the reduced system and makes the preconditioner.
  absl::Status PrepareReduced(const Interrupter* interrupter);
  // PrepareReduced() with S in float for multigrid, or in double for everything else. Builds the preconditioner from S
  // of the convex Hessian, unless the one in use is good enough; the system then gets S of the Hessian.
  absl::Status PrepareMultigrid(const Interrupter* interrupter);
  absl::Status PrepareExact();
  // Adds exact solves on the rows of the vertices of weak faces to the preconditioner, unless there are no such rows,
  // or too many (StepTuning::rows_per_weak_row). `s` is the matrix that multigrid was built for.
  void SolveWeakRowsExactly(const BlockMatrix<float>& s);
  // Replaces multigrid, which failed for the reason `why`, by a Cholesky factorization for all later solves; or returns
  // the error of Solve().
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
  LinearSolver solver_, minres_ = MakeMinresSolver();  // the chosen one; the one for indefinite systems
  bool limit_indefinite_ = true;
  Iterate iterate_;
  // Objects that are kept from step to step to build preconditioners, and S itself: in float for multigrid, which works
  // in float, in double for everything else.
  struct {
    std::unique_ptr<ReducedMatrix<float>> s;
    std::unique_ptr<Multigrid> multigrid;
    bool is_closed = false;  // built after the first step, from an unfolding that nearly closes up
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
