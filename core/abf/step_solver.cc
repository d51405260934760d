#include "core/abf/step_solver.h"

#include <algorithm>
#include <complex>
#include <utility>
#include <vector>

#include "core/abf/unfolding.h"
#include "core/base/status_macros.h"
#include "core/linalg/patch_preconditioner.h"
#include "core/linalg/vector_ops.h"

namespace planish {
namespace {

// A preconditioner is kept as long as the last solve with it took at most this many iterations more than the first:
// about what a new factorization, or new numbers for the multigrid, cost.
constexpr std::int64_t kWornOutFactorization = 10;
constexpr std::int64_t kWornOutMultigrid = 5;
// A factorization that serves an indefinite system or a barrier can be far worse, and is given up in the middle of a
// solve after this many iterations more.
constexpr std::int64_t kUselessFactorization = 20;

constexpr std::int64_t kMaxMultigridIterations = 300;
// Weak faces are few, or the convexified Hessian is no better than a guess.
constexpr std::int64_t kLeastRowsPerWeakRow = 16;

// MINRES on an indefinite system gives up after this many iterations, or this many times those of the last positive
// one.
constexpr std::int64_t kMaxIndefiniteIterations = 100;
constexpr std::int64_t kIndefiniteFactor = 5;

std::unique_ptr<LinearSolver> MakeSolver(SolverType type) {
  switch (type) {
    case SolverType::kMinres:
      return MakeMinresSolver();
    case SolverType::kUzawa:
      return MakeUzawaSolver();
    default:
      return MakeDirectSolver();
  }
}

}  // namespace

StepSolver::StepSolver(const Topology& topology, SolverType solver, SystemType system,
                       PreconditionerType preconditioner, ThreadTeam& team)
    : topology_(topology),
      team_(team),
      solver_type_(solver),
      system_type_(system),
      preconditioner_type_(preconditioner),
      solver_(MakeSolver(solver)) {}

absl::Status StepSolver::Prepare(const Eigen::VectorXd& hessian, const Eigen::VectorXd& convex,
                                 const Eigen::VectorXd& cot, bool indefinite, std::vector<std::int32_t> weak_faces,
                                 const Interrupter* interrupter) {
  indefinite_ = indefinite;
  const SaddlePointOperator* system;
  if (system_type_ == SystemType::kFull) {
    full_ = std::make_unique<FullSystem>(topology_, hessian, cot);
    system = full_.get();
  } else {
    if (IsInterrupted(interrupter)) return absl::CancelledError("cancelled");
    weak_faces_ = std::move(weak_faces);
    hessian_ = &hessian;
    convex_ = &convex;
    cot_ = &cot;
    reduced_ = std::make_unique<ReducedSystem>(topology_, hessian, cot, team_);
    PLANISH_RETURN_IF_ERROR(PrepareReduced(interrupter));
    system = reduced_.get();
  }
  if (preconditioner_type_ == PreconditionerType::kJacobi) {
    preconditioner_ = std::make_unique<JacobiPreconditioner>(system->SchurDiagonal());
  } else if (preconditioner_type_ == PreconditionerType::kNone) {
    preconditioner_ = std::make_unique<IdentityPreconditioner>();
  }
  return absl::OkStatus();
}

absl::Status StepSolver::PrepareReduced(const Interrupter* interrupter) {
  if (preconditioner_type_ == PreconditionerType::kAmg) {
    const absl::Status status = PrepareMultigrid(interrupter);
    if (status.ok() || absl::IsCancelled(status)) return status;
    TurnToCholesky();
  }
  return PrepareExact();
}

bool StepSolver::IsWornOut(std::int64_t tolerated) const {
  return uses_ < 0 || (uses_ > 0 && last_iterations_ > first_iterations_ + tolerated);
}

void StepSolver::TurnToCholesky() {
  preconditioner_type_ = PreconditionerType::kCholesky;
  uses_ = -1;
  rounded_matrix_.reset();
}

absl::Status StepSolver::PrepareExact() {
  if (!matrix_) matrix_ = std::make_unique<ReducedMatrix<double>>(topology_, team_);
  const BlockMatrix<double>& s = matrix_->Assemble(*convex_, *cot_);
  if (preconditioner_type_ == PreconditionerType::kCholesky) {
    if (IsWornOut(kWornOutFactorization) || solver_type_ == SolverType::kDirect) {
      PLANISH_RETURN_IF_ERROR(factorization_.Factorize(LowerTriangle(s), /*block_size=*/2));
      uses_ = 0;
    }
    preconditioner_ = std::make_unique<CholeskyPreconditioner>(&factorization_);
  }
  if (hessian_ != convex_) matrix_->Assemble(*hessian_, *cot_);
  reduced_->set_matrix(&s);
  return absl::OkStatus();
}

absl::Status StepSolver::PrepareMultigrid(const Interrupter* interrupter) {
  if (!rounded_matrix_) rounded_matrix_ = std::make_unique<ReducedMatrix<float>>(topology_, team_);
  if (IsInterrupted(interrupter)) return absl::CancelledError("cancelled");
  // The first numbers stand on an unfolding with angles that do not close up.
  const bool first = uses_ < 0;
  const bool renew = first || !multigrid_closed_ || indefinite_ || IsWornOut(kWornOutMultigrid);
  std::vector<std::complex<double>> z;
  const BlockMatrix<float>& s = rounded_matrix_->Assemble(*convex_, *cot_, [&] {
    if (renew) z = UnfoldRows(topology_, *cot_);
  });
  if (IsInterrupted(interrupter)) return absl::CancelledError("cancelled");
  if (renew) {
    PLANISH_RETURN_IF_ERROR(first ? multigrid_.Build(s, z, topology_.num_interior, team_, interrupter)
                                  : multigrid_.Refresh(s, z, interrupter));
    multigrid_closed_ = !first;
    uses_ = 0;
  }
  preconditioner_ = std::make_unique<MultigridPreconditioner>(&multigrid_);
  if (std::vector<std::int32_t> rows = WeakRows(); !rows.empty()) {
    auto patched = std::make_unique<PatchPreconditioner>(std::move(preconditioner_));
    // Where these rows have no factor in double precision multigrid is as good as there is.
    patched->SetPatch(s, std::move(rows)).IgnoreError();
    preconditioner_ = std::move(patched);
  }
  if (hessian_ != convex_) rounded_matrix_->Assemble(*hessian_, *cot_);
  reduced_->set_matrix(&s);
  return absl::OkStatus();
}

std::vector<std::int32_t> StepSolver::WeakRows() const {
  std::vector<std::int32_t> rows;
  for (const std::int32_t f : weak_faces_) {
    for (int k = 0; k < 3; ++k) {
      if (const std::int32_t v = topology_.corner_row[3 * f + k]; v >= 0) rows.push_back(v);
    }
  }
  std::sort(rows.begin(), rows.end());
  rows.erase(std::unique(rows.begin(), rows.end()), rows.end());
  if (static_cast<std::int64_t>(rows.size()) * kLeastRowsPerWeakRow > topology_.num_rows) return {};
  return rows;
}

LinearSummary StepSolver::Solve(const Eigen::VectorXd& gradient, const ConstraintValues& h,
                                const LinearSolveOptions& options, NewtonStep* step) {
  LinearSolveOptions watched = options;
  if (preconditioner_type_ != PreconditionerType::kAmg && preconditioner_type_ != PreconditionerType::kCholesky) {
    watched.rough.clear();
  }
  // MINRES on an indefinite system may need many iterations with any preconditioner; that says nothing about multigrid.
  const bool multigrid = preconditioner_type_ == PreconditionerType::kAmg && !indefinite_;
  if (indefinite_ && limit_indefinite_) {
    watched.max_iterations = std::max(kMaxIndefiniteIterations, kIndefiniteFactor * last_iterations_);
  }
  if (multigrid) watched.max_iterations = std::min(options.max_iterations, kMaxMultigridIterations);
  const std::int64_t most = watched.max_iterations;
  if (preconditioner_type_ == PreconditionerType::kCholesky && solver_type_ != SolverType::kDirect && uses_ > 0) {
    watched.max_iterations = std::min(most, first_iterations_ + kUselessFactorization);
  }
  LinearSummary summary = SolveOnce(gradient, h, watched, step);
  if (summary.termination == LinearTermination::kIterationLimit && summary.iterations < most) {
    last_iterations_ = summary.iterations;
    if (PrepareReduced(options.interrupter).ok()) {
      const std::int64_t wasted = summary.iterations;
      watched.max_iterations = most;
      summary = SolveOnce(gradient, h, watched, step);
      summary.iterations += wasted;
    }
  }
  const bool failed = summary.termination != LinearTermination::kConverged &&
                      summary.termination != LinearTermination::kInterrupted &&
                      summary.iterations < options.max_iterations;
  if (multigrid && failed) {
    TurnToCholesky();
    if (PrepareExact().ok()) {
      const std::int64_t wasted = summary.iterations;
      summary = SolveOnce(gradient, h, options, step);
      summary.iterations += wasted;
    }
  }
  return summary;
}

LinearSummary StepSolver::SolveOnce(const Eigen::VectorXd& gradient, const ConstraintValues& h,
                                    const LinearSolveOptions& options, NewtonStep* step) {
  const LinearSolver& solver = indefinite_ ? *minres_ : *solver_;
  LinearSummary summary;
  if (system_type_ == SystemType::kFull) {
    SaddlePointSolution solution;
    Eigen::VectorXd g(h.triangle.size() + h.pair.size());
    g << -h.triangle, -h.pair;
    summary = solver.Solve(*full_, *preconditioner_, -gradient, g, options, &solution);
    step->x = std::move(solution.x);
    step->mu.triangle = solution.lambda.head(h.triangle.size());
    step->mu.pair = solution.lambda.tail(h.pair.size());
  } else {
    Eigen::VectorXd rhs;
    reduced_->Recover(gradient, h.triangle, Eigen::VectorXd::Zero(h.pair.size()), &step->x, nullptr);
    reduced_->ApplyB(step->x, &rhs);
    Assign(team_, rhs + h.pair, &rhs);
    step->x.resize(0);  // room for the solver
    summary = solver.SolveSchur(*reduced_, *preconditioner_, rhs, options, &step->mu.pair);
    reduced_->Recover(gradient, h.triangle, step->mu.pair, &step->x, &step->mu.triangle);
  }
  if (indefinite_) return summary;  // says nothing about how well the preconditioner has kept
  last_iterations_ = summary.iterations;
  if (uses_++ == 0) first_iterations_ = summary.iterations;
  return summary;
}

}  // namespace planish
