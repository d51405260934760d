#include "core/abf/step_solver.h"

#include "absl/strings/str_cat.h"
#include "core/base/status_macros.h"

namespace planish {
namespace {

// An old factorization is kept as preconditioner while the last solve with it took no more iterations than this: about
// what a new one costs.
constexpr std::int64_t kWornOutIterations = 12;

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
                                 const Eigen::VectorXd& cot) {
  const SaddlePointOperator* system;
  if (system_type_ == SystemType::kFull) {
    full_ = std::make_unique<FullSystem>(topology_, hessian, cot);
    system = full_.get();
  } else {
    reduced_ = std::make_unique<ReducedSystem>(topology_, hessian, cot);
    system = reduced_.get();
  }
  switch (preconditioner_type_) {
    case PreconditionerType::kJacobi:
      preconditioner_ = std::make_unique<JacobiPreconditioner>(system->SchurDiagonal());
      break;
    case PreconditionerType::kCholesky: {
      const bool worn_out = iterations_since_factorization_ > kWornOutIterations;
      if (!factorized_ || worn_out || solver_type_ == SolverType::kDirect) {
        PLANISH_RETURN_IF_ERROR(FactorizeReduced(convex, cot));
      }
      preconditioner_ = std::make_unique<CholeskyPreconditioner>(&factorization_);
      break;
    }
    default:
      preconditioner_ = std::make_unique<IdentityPreconditioner>();
  }
  return absl::OkStatus();
}

absl::Status StepSolver::FactorizeReduced(const Eigen::VectorXd& convex, const Eigen::VectorXd& cot) {
  if (!matrix_) matrix_ = std::make_unique<ReducedMatrix>(topology_);
  PLANISH_RETURN_IF_ERROR(
      factorization_.Factorize(matrix_->Assemble(ReducedSystem(topology_, convex, cot)), /*block_size=*/2));
  factorized_ = true;
  iterations_since_factorization_ = 0;
  return absl::OkStatus();
}

LinearSummary StepSolver::Solve(const Eigen::VectorXd& gradient, const ConstraintValues& h,
                                const LinearSolveOptions& options, NewtonStep* step) {
  SaddlePointSolution solution;
  LinearSummary summary;
  if (system_type_ == SystemType::kFull) {
    Eigen::VectorXd g(h.triangle.size() + h.pair.size());
    g << -h.triangle, -h.pair;
    summary = solver_->Solve(*full_, *preconditioner_, -gradient, g, options, &solution);
    step->x = std::move(solution.x);
    step->mu.triangle = solution.lambda.head(h.triangle.size());
    step->mu.pair = solution.lambda.tail(h.pair.size());
  } else {
    const Eigen::VectorXd g1 = -h.triangle;
    const Eigen::VectorXd particular = reduced_->ParticularSolution(g1);
    Eigen::VectorXd g2;
    reduced_->ApplyB(particular, &g2);
    g2 = -h.pair - g2;
    summary = solver_->Solve(*reduced_, *preconditioner_, -gradient, g2, options, &solution);
    step->x = particular + solution.x;
    Eigen::VectorXd transposed;
    reduced_->ApplyBTransposed(solution.lambda, &transposed);
    step->mu.triangle = reduced_->TriangleMultipliers(-gradient - transposed, g1);
    step->mu.pair = std::move(solution.lambda);
  }
  iterations_since_factorization_ = summary.iterations;
  return summary;
}

}  // namespace planish
