#include "core/linalg/linear_solver.h"

#include "core/linalg/vector_ops.h"

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

void SaddlePointOperator::ApplySchur(const Eigen::VectorXd& lambda, Eigen::VectorXd* y) const {
  ApplyBTransposed(lambda, &p_);
  ApplyInverseA(p_, &h_);
  ApplyB(h_, y);
}

LinearSummary LinearSolver::Solve(const SaddlePointOperator& system, const Preconditioner& preconditioner,
                                  const Eigen::VectorXd& f, const Eigen::VectorXd& g, const LinearSolveOptions& options,
                                  SaddlePointSolution* solution) const {
  Eigen::VectorXd rhs;
  system.ApplyInverseA(f, &solution->x);
  system.ApplyB(solution->x, &rhs);
  Assign(system.team(), rhs - g, &rhs);
  const LinearSummary summary = SolveSchur(system, preconditioner, rhs, options, &solution->lambda);
  Eigen::VectorXd transposed;
  system.ApplyBTransposed(solution->lambda, &transposed);
  Assign(system.team(), f - transposed, &transposed);
  system.ApplyInverseA(transposed, &solution->x);
  return summary;
}

LinearSummary LinearSolver::SolveSchur(const SaddlePointOperator& system, const Preconditioner& preconditioner,
                                       const Eigen::VectorXd& rhs, const LinearSolveOptions& options,
                                       Eigen::VectorXd* lambda) const {
  *lambda = Eigen::VectorXd::Zero(system.num_multipliers());
  const double initial = Norm(system.team(), rhs);
  if (initial == 0) return {};

  LinearSummary summary = SolveImpl(system, preconditioner, rhs, options, lambda);

  Eigen::VectorXd residual;
  system.ApplySchur(*lambda, &residual);
  Assign(system.team(), rhs - residual, &residual);
  summary.true_residual = Norm(system.team(), residual) / initial;
  const double promised = std::max(kResidualSlack * options.relative_tolerance, kResidualFloor);
  if (summary.termination == LinearTermination::kConverged && !(summary.true_residual <= promised)) {
    summary.termination = LinearTermination::kStagnated;
  }
  return summary;
}

}  // namespace planish
