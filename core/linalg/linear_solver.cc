#include "core/linalg/linear_solver.h"

#include <algorithm>
#include <utility>

#include "core/linalg/vector_ops.h"

namespace planish {
namespace {

// A solver's own residual and the true one differ by rounding; beyond this factor the convergence was not real.
constexpr double kResidualSlack = 100;
// Where M is rounded, rougher solves than this do not notice; finer ones are refined against the exact M.
constexpr double kUnroundedTolerance = 1e-5;
constexpr int kMaxRefinements = 10;
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

bool IsMet(const std::vector<RoughTolerance>& rough, double energy, const Eigen::VectorXd& residual, ThreadTeam& team) {
  double allowed = -1;
  for (const RoughTolerance& tolerance : rough) {
    if (energy <= tolerance.energy) allowed = std::max(allowed, tolerance.residual);
  }
  return allowed >= 0 && Largest(team, residual.cwiseAbs()) <= allowed;
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
  if (summary.true_residual > 0) return summary;

  const bool refine = system.rounds_schur() && options.relative_tolerance < kUnroundedTolerance;
  Eigen::VectorXd residual, correction;
  const auto measure = [&] {
    if (refine) {
      system.ApplyExactSchur(*lambda, &residual);
    } else {
      system.ApplySchur(*lambda, &residual);
    }
    Assign(system.team(), rhs - residual, &residual);
    return Norm(system.team(), residual) / initial;
  };
  summary.true_residual = measure();
  const double wanted = std::max(2 * options.relative_tolerance, kResidualFloor);
  for (int i = 0; refine && i < kMaxRefinements && summary.termination == LinearTermination::kConverged &&
                  summary.true_residual > wanted;
       ++i) {
    LinearSolveOptions rest = options;
    rest.relative_tolerance = std::min(options.relative_tolerance / summary.true_residual, 0.5);
    rest.max_iterations -= summary.iterations;
    if (options.on_progress) {
      rest.on_progress = [&](std::int64_t iterations, double relative) {
        if (iterations > 0) options.on_progress(summary.iterations + iterations, relative * summary.true_residual);
      };
    }
    correction = Eigen::VectorXd::Zero(rhs.size());
    const LinearSummary refined = SolveImpl(system, preconditioner, residual, rest, &correction);
    Assign(system.team(), *lambda + correction, lambda);
    summary.iterations += refined.iterations;
    summary.termination = refined.termination;
    const double before = std::exchange(summary.true_residual, measure());
    if (!(summary.true_residual < before / 2)) break;
  }
  const double promised = std::max(kResidualSlack * options.relative_tolerance, kResidualFloor);
  if (summary.termination == LinearTermination::kConverged && !(summary.true_residual <= promised)) {
    summary.termination = LinearTermination::kStagnated;
  }
  return summary;
}

}  // namespace planish
