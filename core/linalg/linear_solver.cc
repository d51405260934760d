#include "core/linalg/linear_solver.h"

namespace planish {
namespace {

// A solver's own residual and the true one differ by rounding; beyond this factor the convergence was not real.
constexpr double kResidualSlack = 100;
// Double precision cannot promise less than this, relative to the right-hand side.
constexpr double kResidualFloor = 1e-12;

}  // namespace

const char* Name(LinearTermination termination) {
  switch (termination) {
    case LinearTermination::kConverged:
      return "converged";
    case LinearTermination::kIterationLimit:
      return "iteration limit";
    case LinearTermination::kIndefinite:
      return "indefinite system";
    case LinearTermination::kStagnated:
      return "stagnation";
    case LinearTermination::kInterrupted:
      return "interrupted";
  }
  return "?";
}

LinearSummary LinearSolver::Solve(const SaddlePointOperator& system, const Preconditioner& preconditioner,
                                  const Eigen::VectorXd& f, const Eigen::VectorXd& g, const LinearSolveOptions& options,
                                  SaddlePointSolution* solution) const {
  solution->lambda = Eigen::VectorXd::Zero(system.num_multipliers());
  system.ApplyInverseA(f, &solution->x);
  if (system.num_multipliers() == 0) return {};

  Eigen::VectorXd residual;
  system.ApplyB(solution->x, &residual);
  residual -= g;
  const double initial = residual.norm();
  if (initial == 0) return {};

  LinearSummary summary = SolveImpl(system, preconditioner, f, g, options, solution);

  Eigen::VectorXd transposed;
  system.ApplyBTransposed(solution->lambda, &transposed);
  transposed = f - transposed;
  system.ApplyInverseA(transposed, &solution->x);
  system.ApplyB(solution->x, &residual);
  residual -= g;
  summary.true_residual = residual.norm() / initial;
  const double promised = std::max(kResidualSlack * options.relative_tolerance, kResidualFloor);
  if (summary.termination == LinearTermination::kConverged && !(summary.true_residual <= promised)) {
    summary.termination = LinearTermination::kStagnated;
  }
  return summary;
}

}  // namespace planish
