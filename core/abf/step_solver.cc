#include "core/abf/step_solver.h"

#include <algorithm>

#include "core/base/status_macros.h"

namespace planish {
namespace {

// A factorization or hierarchy is kept as long as the last solve with it took at most this many iterations more than
// the first: about what a new one costs.
constexpr std::int64_t kWornOutIterations = 10;

constexpr std::int64_t kMaxMultigridIterations = 300;

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
                       PreconditionerType preconditioner)
    : topology_(topology),
      solver_type_(solver),
      system_type_(system),
      preconditioner_type_(preconditioner),
      solver_(MakeSolver(solver)) {}

absl::Status StepSolver::Prepare(const Eigen::VectorXd& hessian, const Eigen::VectorXd& convex,
                                 const Eigen::VectorXd& cot, bool indefinite) {
  indefinite_ = indefinite;
  const SaddlePointOperator* system;
  if (system_type_ == SystemType::kFull) {
    full_ = std::make_unique<FullSystem>(topology_, hessian, cot);
    system = full_.get();
  } else {
    reduced_ = std::make_unique<ReducedSystem>(topology_, hessian, cot);
    system = reduced_.get();
  }
  convex_ = system_type_ == SystemType::kReduced ? std::make_unique<ReducedSystem>(topology_, convex, cot) : nullptr;
  switch (preconditioner_type_) {
    case PreconditionerType::kJacobi:
      preconditioner_ = std::make_unique<JacobiPreconditioner>(system->SchurDiagonal());
      return absl::OkStatus();
    case PreconditionerType::kCholesky:
      return PrepareCholesky();
    case PreconditionerType::kAmg:
      if (const absl::Status status = PrepareMultigrid(); status.ok()) return status;
      preconditioner_type_ = PreconditionerType::kCholesky;
      kept_ = false;
      return PrepareCholesky();
    default:
      preconditioner_ = std::make_unique<IdentityPreconditioner>();
      return absl::OkStatus();
  }
}

bool StepSolver::IsWornOut() const {
  return !kept_ || last_iterations_ > first_iterations_ + kWornOutIterations;
}

const BlockMatrix<double>& StepSolver::AssembleConvex() {
  if (!matrix_) matrix_ = std::make_unique<ReducedMatrix>(topology_);
  return matrix_->Assemble(*convex_);
}

absl::Status StepSolver::PrepareCholesky() {
  if (IsWornOut() || solver_type_ == SolverType::kDirect) {
    PLANISH_RETURN_IF_ERROR(factorization_.Factorize(LowerTriangle(AssembleConvex()), /*block_size=*/2));
    kept_ = true;
    first_iterations_ = -1;
  }
  preconditioner_ = std::make_unique<CholeskyPreconditioner>(&factorization_);
  return absl::OkStatus();
}

absl::Status StepSolver::PrepareMultigrid() {
  if (IsWornOut()) {
    const BlockMatrix<double>& s = AssembleConvex();
    PLANISH_RETURN_IF_ERROR(kept_ ? multigrid_.Refresh(s) : multigrid_.Build(s));
    kept_ = true;
    first_iterations_ = -1;
  }
  preconditioner_ = std::make_unique<MultigridPreconditioner>(&multigrid_);
  return absl::OkStatus();
}

LinearSummary StepSolver::Solve(const Eigen::VectorXd& gradient, const ConstraintValues& h,
                                const LinearSolveOptions& options, NewtonStep* step) {
  LinearSolveOptions watched = options;
  // MINRES on an indefinite system may need many iterations with any preconditioner; that says nothing about multigrid.
  const bool multigrid = preconditioner_type_ == PreconditionerType::kAmg && !indefinite_;
  if (indefinite_ && limit_indefinite_) {
    watched.max_iterations = std::max(kMaxIndefiniteIterations, kIndefiniteFactor * last_iterations_);
  }
  if (multigrid) watched.max_iterations = std::min(options.max_iterations, kMaxMultigridIterations);
  LinearSummary summary = SolveOnce(gradient, h, watched, step);
  const bool failed = summary.termination != LinearTermination::kConverged &&
                      summary.termination != LinearTermination::kInterrupted &&
                      summary.iterations < options.max_iterations;
  if (multigrid && failed) {
    preconditioner_type_ = PreconditionerType::kCholesky;
    kept_ = false;
    if (PrepareCholesky().ok()) {
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
  SaddlePointSolution solution;
  LinearSummary summary;
  if (system_type_ == SystemType::kFull) {
    Eigen::VectorXd g(h.triangle.size() + h.pair.size());
    g << -h.triangle, -h.pair;
    summary = solver.Solve(*full_, *preconditioner_, -gradient, g, options, &solution);
    step->x = std::move(solution.x);
    step->mu.triangle = solution.lambda.head(h.triangle.size());
    step->mu.pair = solution.lambda.tail(h.pair.size());
  } else {
    const Eigen::VectorXd g1 = -h.triangle;
    const Eigen::VectorXd particular = reduced_->ParticularSolution(g1);
    Eigen::VectorXd g2;
    reduced_->ApplyB(particular, &g2);
    g2 = -h.pair - g2;
    summary = solver.Solve(*reduced_, *preconditioner_, -gradient, g2, options, &solution);
    step->x = particular + solution.x;
    Eigen::VectorXd transposed;
    reduced_->ApplyBTransposed(solution.lambda, &transposed);
    step->mu.triangle = reduced_->TriangleMultipliers(-gradient - transposed, g1);
    step->mu.pair = std::move(solution.lambda);
  }
  if (indefinite_) return summary;  // says nothing about how well the preconditioner has kept
  last_iterations_ = summary.iterations;
  if (first_iterations_ < 0) first_iterations_ = summary.iterations;
  return summary;
}

}  // namespace planish
