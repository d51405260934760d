#include <cmath>

#include "core/linalg/linear_solver.h"

namespace planish {
namespace {

// Iterative refinement from lambda = 0 with the factorization as the inverse of M.
class DirectSolver final : public LinearSolver {
  LinearSummary SolveImpl(const SaddlePointOperator& system, const Preconditioner& preconditioner,
                          const Eigen::VectorXd& rhs, const LinearSolveOptions& options,
                          Eigen::VectorXd* lambda) const override {
    LinearSummary summary;
    Eigen::VectorXd residual, correction;
    double first = 0;
    while (true) {
      system.ApplySchur(*lambda, &residual);
      residual = rhs - residual;
      const double norm = residual.norm();
      if (summary.iterations == 0) first = norm;
      if (!std::isfinite(norm)) {
        summary.termination = LinearTermination::kStagnated;
        break;
      }
      if (norm <= options.relative_tolerance * first) break;
      if (summary.iterations >= options.tuning.max_direct_refinements) {
        summary.termination = LinearTermination::kStagnated;
        break;
      }
      if (IsInterrupted(options.cancel) || IsInterrupted(options.stop)) {
        summary.termination = LinearTermination::kInterrupted;
        break;
      }
      preconditioner.Apply(residual, &correction);
      *lambda += correction;
      ++summary.iterations;
    }
    return summary;
  }
};

}  // namespace

std::unique_ptr<LinearSolver> MakeDirectSolver() {
  return std::make_unique<DirectSolver>();
}

}  // namespace planish
