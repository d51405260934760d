#include "core/linalg/linear_solver.h"

#include <algorithm>
#include <cmath>
#include <utility>

#include "absl/strings/str_format.h"
#include "core/linalg/vector_ops.h"

namespace planish {

const char* Name(LinearTermination termination) {
  constexpr const char* kNames[] = {"converged", "iteration limit", "indefinite system", "stagnation", "interrupted"};
  return kNames[static_cast<int>(termination)];
}

std::string Describe(const LinearSummary& summary) {
  return absl::StrFormat("%s after %d iteration%s, residual %.1e of the right-hand side", Name(summary.termination),
                         summary.iterations, summary.iterations == 1 ? "" : "s", summary.true_residual);
}

bool GoesOn(double residual, bool is_good_enough, const LinearSolveOptions& options, LinearSummary* summary) {
  if (!std::isfinite(residual)) {
    summary->termination = LinearTermination::kStagnated;
  } else if (is_good_enough) {
    summary->termination = LinearTermination::kConverged;
  } else if (summary->iterations >= options.max_iterations) {
    summary->termination = LinearTermination::kIterationLimit;
  } else {
    if (summary->iterations % kProgressInterval == 0 && options.on_progress) {
      options.on_progress(summary->iterations, residual);
    }
    if (!IsInterrupted(options.cancel) && !IsInterrupted(options.stop)) return true;
    summary->termination = LinearTermination::kInterrupted;
  }
  return false;
}

bool IsMet(const std::vector<RoughTolerance>& rough, double energy, const Eigen::VectorXd& residual, ThreadTeam& team) {
  double largest = -1, sum = -1;  // computed once, on demand
  for (const RoughTolerance& tolerance : rough) {
    if (!(energy <= tolerance.energy)) continue;
    if (largest < 0) largest = Largest(team, residual.cwiseAbs());
    if (!(largest <= tolerance.residual)) continue;
    if (std::isinf(tolerance.residual_sum)) return true;
    if (sum < 0) sum = Sum(team, residual.cwiseAbs());
    if (sum <= tolerance.residual_sum) return true;
  }
  return false;
}

void SaddlePointOperator::ApplySchur(const Eigen::VectorXd& lambda, Eigen::VectorXd* y) const {
  ApplyBTransposed(lambda, &p_);
  ApplyInverseA(p_, &h_);
  ApplyB(h_, y);
}

LinearSummary SolveSystem(const LinearSolver& solver, const SaddlePointOperator& system,
                          const Preconditioner& preconditioner, const Eigen::VectorXd& f, const Eigen::VectorXd& g,
                          const LinearSolveOptions& options, SaddlePointSolution* solution) {
  Eigen::VectorXd rhs;
  system.ApplyInverseA(f, &solution->x);
  system.ApplyB(solution->x, &rhs);
  Assign(system.team(), rhs - g, &rhs);
  const LinearSummary summary = SolveSchur(solver, system, preconditioner, rhs, options, &solution->lambda);
  Eigen::VectorXd transposed;
  system.ApplyBTransposed(solution->lambda, &transposed);
  Assign(system.team(), f - transposed, &transposed);
  system.ApplyInverseA(transposed, &solution->x);
  return summary;
}

LinearSummary SolveSchur(const LinearSolver& solver, const SaddlePointOperator& system,
                         const Preconditioner& preconditioner, const Eigen::VectorXd& rhs,
                         const LinearSolveOptions& options, Eigen::VectorXd* lambda) {
  ThreadTeam& team = system.team();
  const LinearTuning& tuning = options.tuning;
  *lambda = Eigen::VectorXd::Zero(system.num_multipliers());
  const double initial = Norm(team, rhs);
  if (initial == 0) return {};

  LinearSummary summary = solver(system, preconditioner, rhs, options, lambda);

  const bool rough = !options.rough.empty();
  const bool refine = !rough && system.rounds_schur() && options.relative_tolerance < tuning.refined_tolerance;
  Eigen::VectorXd residual;
  const auto measure = [&] {
    if (refine) {
      system.ApplyExactSchur(*lambda, &residual);
    } else {
      system.ApplySchur(*lambda, &residual);
    }
    Assign(team, rhs - residual, &residual);
    return Norm(team, residual) / initial;
  };
  summary.true_residual = measure();
  // Iterative refinement with the exact M: solves for the residual until that is small enough.
  const double wanted = std::max(tuning.refined_slack * options.relative_tolerance, tuning.residual_floor);
  for (std::int64_t i = 0; refine && i < tuning.max_refinements &&
                           summary.termination == LinearTermination::kConverged && summary.true_residual > wanted;
       ++i) {
    LinearSolveOptions rest = options;
    rest.relative_tolerance = std::min(options.relative_tolerance / summary.true_residual, 0.5);
    rest.max_iterations -= summary.iterations;
    if (options.on_progress) {
      rest.on_progress = [&](std::int64_t iterations, double relative) {
        if (iterations > 0) options.on_progress(summary.iterations + iterations, relative * summary.true_residual);
      };
    }
    Eigen::VectorXd correction = Eigen::VectorXd::Zero(lambda->size());
    const LinearSummary refined = solver(system, preconditioner, residual, rest, &correction);
    Assign(team, *lambda + correction, lambda);
    summary.iterations += refined.iterations;
    summary.termination = refined.termination;
    const double before = std::exchange(summary.true_residual, measure());
    if (!(summary.true_residual < before / 2)) break;
  }
  if (summary.termination != LinearTermination::kConverged) return summary;

  bool real;
  if (rough) {
    std::vector<RoughTolerance> promised = options.rough;
    for (RoughTolerance& tolerance : promised) {
      tolerance.residual = tuning.rough_slack * tolerance.residual + tuning.residual_floor * initial;
      tolerance.residual_sum = tuning.rough_slack * tolerance.residual_sum +
                               tuning.residual_floor * initial * static_cast<double>(rhs.size());
    }
    const double taken = Dot(team, *lambda, rhs) + Dot(team, *lambda, residual);
    real = std::isfinite(summary.true_residual) && IsMet(promised, summary.energy, residual, team) &&
           (std::isnan(summary.energy_taken) ||
            std::abs(taken - summary.energy_taken) <= tuning.energy_slack * std::abs(taken));
  } else {
    real = summary.true_residual <= std::max(tuning.residual_slack * options.relative_tolerance, tuning.residual_floor);
  }
  if (!real) summary.termination = LinearTermination::kStagnated;
  return summary;
}

LinearSolver MakeDirectSolver() {
  return [](const SaddlePointOperator& system, const Preconditioner& preconditioner, const Eigen::VectorXd& rhs,
            const LinearSolveOptions& options, Eigen::VectorXd* lambda) {
    LinearSolveOptions limited = options;
    limited.max_iterations = options.tuning.max_direct_refinements;
    LinearSummary summary;
    Eigen::VectorXd residual = rhs, correction;
    const double first = rhs.norm();
    for (double norm = first; GoesOn(norm / first, norm <= options.relative_tolerance * first, limited, &summary);
         norm = residual.norm()) {
      preconditioner(residual, &correction);
      *lambda += correction;
      system.ApplySchur(*lambda, &residual);
      residual = rhs - residual;
      ++summary.iterations;
    }
    if (summary.termination == LinearTermination::kIterationLimit) summary.termination = LinearTermination::kStagnated;
    return summary;
  };
}

}  // namespace planish
