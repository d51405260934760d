#include "core/abf/step_solver.h"

#include <algorithm>
#include <complex>

#include "absl/strings/str_cat.h"
#include "absl/strings/str_format.h"
#include "core/abf/layout.h"
#include "core/base/error.h"
#include "core/base/status_macros.h"
#include "core/linalg/patch_preconditioner.h"
#include "core/linalg/vector_ops.h"

namespace planish {

StepSolver::StepSolver(const Topology& topology, SolverType solver, SystemType system,
                       PreconditionerType preconditioner, ThreadTeam& team, const FlattenTuning& tuning)
    : topology_(topology),
      team_(team),
      tuning_(tuning),
      types_{solver, system, preconditioner},
      solver_(solver == SolverType::kMinres  ? MakeMinresSolver()
              : solver == SolverType::kUzawa ? MakeUzawaSolver()
                                             : MakeDirectSolver()) {
  by_multigrid_.multigrid = std::make_unique<Multigrid>(tuning.multigrid);
}

absl::Status StepSolver::Prepare(const Eigen::VectorXd& hessian, const Eigen::VectorXd& convex,
                                 const Eigen::VectorXd& cot, bool indefinite, std::vector<std::int32_t> weak_faces,
                                 const Interrupter* interrupter) {
  iterate_ = {&hessian, &convex, &cot, indefinite, std::move(weak_faces)};
  if (types_.system == SystemType::kFull) {
    iterate_.full = std::make_unique<FullSystem>(topology_, hessian, cot);
  } else {
    if (IsInterrupted(interrupter)) return absl::CancelledError("cancelled");
    iterate_.reduced = std::make_unique<ReducedSystem>(topology_, hessian, cot, team_);
    PLANISH_RETURN_IF_ERROR(PrepareReduced(interrupter));
  }
  if (types_.preconditioner == PreconditionerType::kJacobi) {
    preconditioner_ =
        JacobiPreconditioner(iterate_.full ? iterate_.full->SchurDiagonal() : iterate_.reduced->SchurDiagonal());
  } else if (types_.preconditioner == PreconditionerType::kNone) {
    preconditioner_ = IdentityPreconditioner();
  }
  return absl::OkStatus();
}

absl::Status StepSolver::PrepareReduced(const Interrupter* interrupter) {
  if (types_.preconditioner == PreconditionerType::kAmg) {
    const absl::Status status = PrepareMultigrid(interrupter);
    if (status.ok() || absl::IsCancelled(status)) return status;
    PLANISH_RETURN_IF_ERROR(TurnToCholesky(std::string(status.message())));
  }
  return PrepareExact();
}

absl::Status StepSolver::TurnToCholesky(const std::string& why) {
  by_multigrid_.failure = why;
  if (topology_.num_faces() > kMostFallbackFaces) {
    return MakeError(absl::StatusCode::kInternal, "SOLVER_FAILED",
                     absl::StrFormat("%s; a Cholesky factorization in its place is for charts of at most %d triangles, "
                                     "this one has %d: cut the mesh into charts (--seams=auto), or ask for the "
                                     "factorization and its memory (--preconditioner=cholesky)",
                                     why, kMostFallbackFaces, topology_.num_faces()));
  }
  types_.preconditioner = PreconditionerType::kCholesky;
  wear_.solves = -1;
  by_multigrid_.s.reset();
  by_multigrid_.multigrid = std::make_unique<Multigrid>(tuning_.multigrid);  // frees its memory for the factorization
  by_factorization_.factorization.set_max_bytes(kFallbackBytesPerFace * topology_.num_faces());
  return absl::OkStatus();
}

absl::Status StepSolver::PrepareExact() {
  if (!by_factorization_.s) by_factorization_.s = std::make_unique<ReducedMatrix<double>>(topology_, team_);
  const BlockMatrix<double>& s = by_factorization_.s->Assemble(*iterate_.convex, *iterate_.cot);
  if (types_.preconditioner == PreconditionerType::kCholesky) {
    if (wear_.IsOut(tuning_.step.worn_out_factorization) || types_.solver == SolverType::kDirect) {
      const absl::Status factorized = by_factorization_.factorization.Factorize(s);
      if (absl::IsResourceExhausted(factorized)) {
        return MakeError(absl::StatusCode::kInternal, "SOLVER_FAILED",
                         absl::StrCat(by_multigrid_.failure, by_multigrid_.failure.empty() ? "" : "; ",
                                      factorized.message(), ": cut the mesh into charts (--seams=auto)"));
      }
      PLANISH_RETURN_IF_ERROR(factorized);
      wear_.solves = 0;
    }
    preconditioner_ = [this](const Eigen::VectorXd& r, Eigen::VectorXd* z) {
      by_factorization_.factorization.Solve(r, z);
    };
  }
  if (iterate_.hessian != iterate_.convex) by_factorization_.s->Assemble(*iterate_.hessian, *iterate_.cot);
  iterate_.reduced->set_matrix(&s);
  return absl::OkStatus();
}

absl::Status StepSolver::PrepareMultigrid(const Interrupter* interrupter) {
  if (!by_multigrid_.s) by_multigrid_.s = std::make_unique<ReducedMatrix<float>>(topology_, team_);
  if (IsInterrupted(interrupter)) return absl::CancelledError("cancelled");
  // The first multigrid is made from an unfolding with angles that do not close up, so the next step renews it.
  const bool first = wear_.solves < 0;
  const bool renew =
      first || !by_multigrid_.is_closed || iterate_.is_indefinite || wear_.IsOut(tuning_.step.worn_out_multigrid);
  std::vector<std::complex<double>> z;
  const BlockMatrix<float>& s = by_multigrid_.s->Assemble(*iterate_.convex, *iterate_.cot, [&] {
    if (renew) z = UnfoldRows(topology_, *iterate_.cot);
  });
  if (IsInterrupted(interrupter)) return absl::CancelledError("cancelled");
  if (renew) {
    if (std::all_of(z.begin(), z.end(), [](std::complex<double> place) { return place == 0.0; })) {
      by_multigrid_.left_out = "coarse spaces hold the constants alone: unfolding the triangles overflows";
    }
    PLANISH_RETURN_IF_ERROR(first ? by_multigrid_.multigrid->Build(s, z, topology_.num_interior, team_, interrupter)
                                  : by_multigrid_.multigrid->Refresh(s, z, interrupter));
    by_multigrid_.is_closed = !first;
    wear_.solves = 0;
  }
  preconditioner_ = MultigridPreconditioner(by_multigrid_.multigrid.get());
  SolveWeakRowsExactly(s);
  if (iterate_.hessian != iterate_.convex) by_multigrid_.s->Assemble(*iterate_.hessian, *iterate_.cot);
  iterate_.reduced->set_matrix(&s);
  return absl::OkStatus();
}

void StepSolver::SolveWeakRowsExactly(const BlockMatrix<float>& s) {
  std::vector<std::int32_t> rows = RowsOfFaces(topology_, iterate_.weak_faces);
  if (rows.empty()) return;
  constexpr char kWithout[] = "no exact solves on the vertices of weak faces: ";
  if (static_cast<std::int64_t>(rows.size()) * tuning_.step.rows_per_weak_row > topology_.num_rows) {
    by_multigrid_.left_out = absl::StrFormat("%sthere are %d of %d, more than one in %d", kWithout, rows.size(),
                                             topology_.num_rows, tuning_.step.rows_per_weak_row);
    return;
  }
  const std::int64_t max_bytes = std::max(kLeastPatchBytes, kPatchBytesPerFace * topology_.num_faces());
  if (auto patched = PatchedPreconditioner(preconditioner_, s, std::move(rows), max_bytes); patched.ok()) {
    preconditioner_ = *std::move(patched);
  } else {
    by_multigrid_.left_out = absl::StrCat(kWithout, patched.status().message());  // multigrid alone has to do
  }
}

absl::StatusOr<LinearSummary> StepSolver::Solve(const Eigen::VectorXd& gradient, const ConstraintValues& h,
                                                const LinearSolveOptions& options, NewtonStep* step) {
  const StepTuning& tuning = tuning_.step;
  LinearSolveOptions watched = options;
  watched.tuning = tuning_.linear;
  const bool is_quick =
      types_.preconditioner == PreconditionerType::kAmg || types_.preconditioner == PreconditionerType::kCholesky;
  if (types_.solver == SolverType::kDirect || !is_quick) watched.rough.clear();
  // MINRES on an indefinite system may need many iterations with any preconditioner, so that says nothing about
  // multigrid.
  const bool multigrid = types_.preconditioner == PreconditionerType::kAmg && !iterate_.is_indefinite;
  if (iterate_.is_indefinite && limit_indefinite_) {
    watched.max_iterations =
        std::max(tuning.max_indefinite_iterations, tuning.indefinite_factor * wear_.last_iterations);
  }
  if (multigrid) {
    const bool may_fall_back = topology_.num_faces() <= kMostFallbackFaces;
    watched.max_iterations = std::min(options.max_iterations, may_fall_back ? tuning.max_multigrid_iterations
                                                                            : tuning.max_iterations_without_fallback);
  }
  const std::int64_t most = watched.max_iterations;
  if (types_.preconditioner == PreconditionerType::kCholesky && types_.solver != SolverType::kDirect &&
      wear_.solves > 0) {
    watched.max_iterations = std::min(most, wear_.first_iterations + tuning.useless_factorization);
  }
  LinearSummary summary = SolveOnce(gradient, h, watched, step);
  // Solves again with a new preconditioner. If S is singular in double precision, keeps the last solution.
  const auto solve_again = [&](const absl::Status& prepared, std::int64_t max_iterations) {
    if (!prepared.ok()) return absl::IsFailedPrecondition(prepared) ? absl::OkStatus() : prepared;
    const std::int64_t wasted = summary.iterations;
    watched.max_iterations = max_iterations;
    summary = SolveOnce(gradient, h, watched, step);
    summary.iterations += wasted;
    return absl::OkStatus();
  };
  if (summary.termination == LinearTermination::kIterationLimit && summary.iterations < most) {
    wear_.last_iterations = summary.iterations;
    PLANISH_RETURN_IF_ERROR(solve_again(PrepareReduced(options.cancel), most));
  }
  const bool failed = summary.termination != LinearTermination::kConverged &&
                      summary.termination != LinearTermination::kInterrupted &&
                      summary.iterations < options.max_iterations;
  if (multigrid && failed) {
    PLANISH_RETURN_IF_ERROR(TurnToCholesky(absl::StrCat("multigrid: ", Describe(summary))));
    PLANISH_RETURN_IF_ERROR(solve_again(PrepareExact(), options.max_iterations));
  }
  return summary;
}

LinearSummary StepSolver::SolveOnce(const Eigen::VectorXd& gradient, const ConstraintValues& h,
                                    const LinearSolveOptions& options, NewtonStep* step) {
  const LinearSolver& solver = iterate_.is_indefinite ? minres_ : solver_;
  LinearSummary summary;
  if (types_.system == SystemType::kFull) {
    SaddlePointSolution solution;
    Eigen::VectorXd g(h.triangle.size() + h.pair.size());
    g << -h.triangle, -h.pair;
    summary = SolveSystem(solver, *iterate_.full, preconditioner_, -gradient, g, options, &solution);
    step->x = std::move(solution.x);
    step->mu.triangle = solution.lambda.head(h.triangle.size());
    step->mu.pair = solution.lambda.tail(h.pair.size());
  } else {
    Eigen::VectorXd rhs;
    iterate_.reduced->Recover(gradient, h.triangle, Eigen::VectorXd::Zero(h.pair.size()), &step->x, nullptr);
    iterate_.reduced->ApplyB(step->x, &rhs);
    Assign(team_, rhs + h.pair, &rhs);
    step->x.resize(0);  // frees memory for the solver
    summary = SolveSchur(solver, *iterate_.reduced, preconditioner_, rhs, options, &step->mu.pair);
    iterate_.reduced->Recover(gradient, h.triangle, step->mu.pair, &step->x, &step->mu.triangle);
  }
  if (iterate_.is_indefinite) return summary;  // says nothing about the wear of the preconditioner
  wear_.last_iterations = summary.iterations;
  if (wear_.solves++ == 0) wear_.first_iterations = summary.iterations;
  return summary;
}

}  // namespace planish
