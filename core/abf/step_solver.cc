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
      solver_type_(solver),
      system_type_(system),
      preconditioner_type_(preconditioner),
      solver_(solver == SolverType::kMinres  ? MakeMinresSolver()
              : solver == SolverType::kUzawa ? MakeUzawaSolver()
                                             : MakeDirectSolver()) {
  multigrid_ = std::make_unique<Multigrid>(tuning.multigrid);
}

absl::Status StepSolver::Prepare(const Eigen::VectorXd& hessian, const Eigen::VectorXd& convex,
                                 const Eigen::VectorXd& cot, bool indefinite, std::vector<std::int32_t> weak_faces,
                                 const Interrupter* interrupter) {
  iterate_ = {&hessian, &convex, &cot, indefinite, std::move(weak_faces)};
  if (system_type_ == SystemType::kFull) {
    iterate_.full = std::make_unique<FullSystem>(topology_, hessian, cot);
  } else {
    if (IsInterrupted(interrupter)) return absl::CancelledError("cancelled");
    iterate_.reduced = std::make_unique<ReducedSystem>(topology_, hessian, cot, team_);
    PLANISH_RETURN_IF_ERROR(PrepareReduced(interrupter));
  }
  if (preconditioner_type_ == PreconditionerType::kJacobi) {
    preconditioner_ =
        JacobiPreconditioner(iterate_.full ? iterate_.full->SchurDiagonal() : iterate_.reduced->SchurDiagonal());
  } else if (preconditioner_type_ == PreconditionerType::kNone) {
    preconditioner_ = IdentityPreconditioner();
  }
  return absl::OkStatus();
}

absl::Status StepSolver::PrepareReduced(const Interrupter* interrupter) {
  if (preconditioner_type_ == PreconditionerType::kAmg) {
    const absl::Status status = PrepareMultigrid(interrupter);
    if (status.ok() || absl::IsCancelled(status)) return status;
    PLANISH_RETURN_IF_ERROR(TurnToCholesky(std::string(status.message())));
  }
  return PrepareExact();
}

absl::Status StepSolver::TurnToCholesky(const std::string& why) {
  multigrid_failure_ = why;
  if (topology_.num_faces() > kMostFallbackFaces) {
    return MakeError(absl::StatusCode::kInternal, "SOLVER_FAILED",
                     absl::StrFormat("%s; a Cholesky factorization in its place is for charts of at most %d triangles, "
                                     "this one has %d: cut the mesh into charts (--seams=auto), or ask for the "
                                     "factorization and its memory (--preconditioner=cholesky)",
                                     why, kMostFallbackFaces, topology_.num_faces()));
  }
  preconditioner_type_ = PreconditionerType::kCholesky;
  wear_.solves = -1;
  multigrid_s_.reset();
  multigrid_ = std::make_unique<Multigrid>(tuning_.multigrid);  // its memory is Cholesky's now
  factorization_.set_max_bytes(kFallbackBytesPerFace * topology_.num_faces());
  return absl::OkStatus();
}

absl::Status StepSolver::PrepareExact() {
  if (!exact_s_) exact_s_ = std::make_unique<ReducedMatrix<double>>(topology_, team_);
  const BlockMatrix<double>& s = exact_s_->Assemble(*iterate_.convex, *iterate_.cot);
  if (preconditioner_type_ == PreconditionerType::kCholesky) {
    if (wear_.IsOut(tuning_.step.worn_out_factorization) || solver_type_ == SolverType::kDirect) {
      const absl::Status factorized = factorization_.Factorize(s);
      if (absl::IsResourceExhausted(factorized)) {
        return MakeError(absl::StatusCode::kInternal, "SOLVER_FAILED",
                         absl::StrCat(multigrid_failure_, multigrid_failure_.empty() ? "" : "; ", factorized.message(),
                                      ": cut the mesh into charts (--seams=auto)"));
      }
      PLANISH_RETURN_IF_ERROR(factorized);
      wear_.solves = 0;
    }
    preconditioner_ = [this](const Eigen::VectorXd& r, Eigen::VectorXd* z) { factorization_.Solve(r, z); };
  }
  if (iterate_.hessian != iterate_.convex) exact_s_->Assemble(*iterate_.hessian, *iterate_.cot);
  iterate_.reduced->set_matrix(&s);
  return absl::OkStatus();
}

absl::Status StepSolver::PrepareMultigrid(const Interrupter* interrupter) {
  if (!multigrid_s_) multigrid_s_ = std::make_unique<ReducedMatrix<float>>(topology_, team_);
  if (IsInterrupted(interrupter)) return absl::CancelledError("cancelled");
  // The first numbers stand on an unfolding with angles that do not close up.
  const bool first = wear_.solves < 0;
  const bool renew = first || !is_closed_ || iterate_.is_indefinite || wear_.IsOut(tuning_.step.worn_out_multigrid);
  std::vector<std::complex<double>> z;
  const BlockMatrix<float>& s = multigrid_s_->Assemble(*iterate_.convex, *iterate_.cot, [&] {
    if (renew) z = UnfoldRows(topology_, *iterate_.cot);
  });
  if (IsInterrupted(interrupter)) return absl::CancelledError("cancelled");
  if (renew) {
    if (std::all_of(z.begin(), z.end(), [](std::complex<double> place) { return place == 0.0; })) {
      left_out_ = "coarse spaces hold the constants alone: unfolding the triangles overflows";
    }
    PLANISH_RETURN_IF_ERROR(first ? multigrid_->Build(s, z, topology_.num_interior, team_, interrupter)
                                  : multigrid_->Refresh(s, z, interrupter));
    is_closed_ = !first;
    wear_.solves = 0;
  }
  preconditioner_ = MultigridPreconditioner(multigrid_.get());
  SolveWeakRowsExactly(s);
  if (iterate_.hessian != iterate_.convex) multigrid_s_->Assemble(*iterate_.hessian, *iterate_.cot);
  iterate_.reduced->set_matrix(&s);
  return absl::OkStatus();
}

void StepSolver::SolveWeakRowsExactly(const BlockMatrix<float>& s) {
  std::vector<std::int32_t> rows = RowsOfFaces(topology_, iterate_.weak_faces);
  if (rows.empty()) return;
  constexpr char kWithout[] = "no exact solves on the vertices of weak faces: ";
  if (static_cast<std::int64_t>(rows.size()) * tuning_.step.rows_per_weak_row > topology_.num_rows) {
    left_out_ = absl::StrFormat("%sthere are %d of %d, more than one in %d", kWithout, rows.size(), topology_.num_rows,
                                tuning_.step.rows_per_weak_row);
    return;
  }
  const std::int64_t max_bytes = std::max(kLeastPatchBytes, kPatchBytesPerFace * topology_.num_faces());
  if (auto patched = PatchedPreconditioner(preconditioner_, s, std::move(rows), max_bytes); patched.ok()) {
    preconditioner_ = *std::move(patched);
  } else {
    left_out_ = absl::StrCat(kWithout, patched.status().message());  // multigrid alone is as good as there is
  }
}

absl::StatusOr<LinearSummary> StepSolver::Solve(const Eigen::VectorXd& gradient, const ConstraintValues& h,
                                                const LinearSolveOptions& options, NewtonStep* step) {
  const StepTuning& tuning = tuning_.step;
  LinearSolveOptions watched = options;
  watched.tuning = tuning_.linear;
  if (preconditioner_type_ != PreconditionerType::kAmg && preconditioner_type_ != PreconditionerType::kCholesky) {
    watched.rough.clear();
  }
  // MINRES on an indefinite system may need many iterations with any preconditioner; that says nothing about multigrid.
  const bool multigrid = preconditioner_type_ == PreconditionerType::kAmg && !iterate_.is_indefinite;
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
  if (preconditioner_type_ == PreconditionerType::kCholesky && solver_type_ != SolverType::kDirect &&
      wear_.solves > 0) {
    watched.max_iterations = std::min(most, wear_.first_iterations + tuning.useless_factorization);
  }
  LinearSummary summary = SolveOnce(gradient, h, watched, step);
  // With a new preconditioner. Where S is singular in double precision, what was found stands.
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
  if (system_type_ == SystemType::kFull) {
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
    step->x.resize(0);  // room for the solver
    summary = SolveSchur(solver, *iterate_.reduced, preconditioner_, rhs, options, &step->mu.pair);
    iterate_.reduced->Recover(gradient, h.triangle, step->mu.pair, &step->x, &step->mu.triangle);
  }
  if (iterate_.is_indefinite) return summary;  // says nothing about how well the preconditioner has kept
  wear_.last_iterations = summary.iterations;
  if (wear_.solves++ == 0) wear_.first_iterations = summary.iterations;
  return summary;
}

}  // namespace planish
