// Solvers of the saddle-point system (eq. 7) behind one interface.
#pragma once

#include <cstdint>
#include <functional>
#include <limits>
#include <string>
#include <vector>

#include "Eigen/Core"
#include "core/base/interrupter.h"
#include "core/linalg/preconditioner.h"
#include "core/linalg/saddle_point.h"
#include "core/linalg/tuning.h"

namespace planish {

enum class LinearTermination {
  kConverged,       // the true residual meets the tolerance, or one of the rough tolerances
  kIterationLimit,  // LinearSolveOptions::max_iterations
  kIndefinite,   // found a direction without positive curvature: M is not positive definite, which this solver requires
  kStagnated,    // the solver claimed convergence but the true residual contradicts it, or numbers were not finite
  kInterrupted,  // by LinearSolveOptions::cancel or stop
};
const char* Name(LinearTermination termination);

// When a solve is good enough for a step of an inexact Newton method. The Euclidean norm of the residual does not
// measure that: where the scale of a map spans many orders of magnitude, a few rows dominate the norm.
struct RoughTolerance {
  // In (0, 1), relative to lambda = 0: the error in the norm of M, which conjugate directions minimize (Uzawa), or the
  // residual in the norm of K^-1 (preconditioner.h), which MINRES minimizes. With K = M both are the same.
  double energy = 0;
  // The largest entry of B A^-1 f - g - M lambda, and the sum of the magnitudes of all entries.
  double residual = 0;
  double residual_sum = std::numeric_limits<double>::infinity();
};

// Options of one linear solve.
struct LinearSolveOptions {
  // Stop at |B A^-1 f - g - M lambda| <= relative_tolerance |B A^-1 f - g| (Euclidean norms; MINRES takes the norm of
  // the preconditioner while it iterates). In (0, 1).
  double relative_tolerance = 1e-10;
  // If not empty, replaces relative_tolerance: stop when one of these is met in all parts. Only for iterative solvers
  // with a preconditioner near M^-1: Uzawa's estimate of its error assumes fast and steady convergence.
  std::vector<RoughTolerance> rough;
  std::int64_t max_iterations = 100000;
  // Either ends the solve as kInterrupted; the caller checks them to find out which.
  const Interrupter* cancel = nullptr;
  const Interrupter* stop = nullptr;
  // Called every kProgressInterval iterations with the count and the relative residual.
  std::function<void(std::int64_t, double)> on_progress;
  LinearTuning tuning = {};
};

// Iterations between two calls of on_progress. The interrupters are read in every iteration.
constexpr std::int64_t kProgressInterval = 32;

// Whether one of the tolerances is met in all parts, by `energy` and by the entries of `residual`.
bool IsMet(const std::vector<RoughTolerance>& rough, double energy, const Eigen::VectorXd& residual, ThreadTeam& team);

struct LinearSummary {
  LinearTermination termination = LinearTermination::kConverged;
  std::int64_t iterations = 0;
  // The residual |B A^-1 f - g - M lambda| / |B A^-1 f - g|, recomputed from lambda after every solve, whatever the
  // solver claims. If the system has M rounded to float, rough solves and tolerances from
  // LinearTuning::refined_tolerance up are solved and measured with the rounded M; smaller tolerances are refined with
  // the exact M until this residual meets the tolerance, up to a factor of LinearTuning::refined_slack.
  double true_residual = 0;
  // After a rough solve: the solver's estimate of RoughTolerance::energy. It cannot be recomputed without M^-1;
  // `energy_taken`, on which Uzawa's estimate rests, can.
  double energy = 1;
  // After a solve by conjugate directions: the solver's claim of how much the energy of the error, e^t M e with e =
  // M^-1 rhs - lambda, has fallen since lambda = 0. The true value is lambda^t (rhs + residual). NaN: no claim.
  double energy_taken = std::numeric_limits<double>::quiet_NaN();
};

// Whether a solver should make another iteration. If not, summary->termination says why. `residual` is relative;
// `is_good_enough` says whether the solver's own measure meets the tolerance. Calls on_progress.
bool GoesOn(double residual, bool is_good_enough, const LinearSolveOptions& options, LinearSummary* summary);

// One sentence: "iteration limit after 300 iterations, residual 1.2e-03 of the right-hand side".
std::string Describe(const LinearSummary& summary);

struct SaddlePointSolution {
  Eigen::VectorXd x;
  Eigen::VectorXd lambda;
};

// A solver of M lambda = rhs, from lambda = 0; rhs is not zero. Sets `energy` if options.rough is not empty.
// SolveSchur() checks its claims: it recomputes the residual and the true value of `energy_taken`.
using LinearSolver = std::function<LinearSummary(const SaddlePointOperator& system,
                                                 const Preconditioner& preconditioner, const Eigen::VectorXd& rhs,
                                                 const LinearSolveOptions& options, Eigen::VectorXd* lambda)>;

// Solves M lambda = rhs from lambda = 0. Whatever the termination, lambda is the solver's last iterate. A right-hand
// side of zero and a system without multipliers converge in no iterations. A claimed convergence that the true residual
// contradicts becomes kStagnated (LinearTuning).
LinearSummary SolveSchur(const LinearSolver& solver, const SaddlePointOperator& system,
                         const Preconditioner& preconditioner, const Eigen::VectorXd& rhs,
                         const LinearSolveOptions& options, Eigen::VectorXd* lambda);

// SolveSchur() for the whole system: x = A^-1 (f - B^t lambda).
LinearSummary SolveSystem(const LinearSolver& solver, const SaddlePointOperator& system,
                          const Preconditioner& preconditioner, const Eigen::VectorXd& f, const Eigen::VectorXd& g,
                          const LinearSolveOptions& options, SaddlePointSolution* solution);

// First approach (section 7.1): MINRES on M lambda = B A^-1 f - g. M may be indefinite or singular.
LinearSolver MakeMinresSolver();

// Second approach (section 7.2): the modified Uzawa algorithm with conjugate directions. M must be positive definite.
LinearSolver MakeUzawaSolver();

// Iterative refinement. The preconditioner must be a factorization of M, which must be positive definite. The solver
// applies it to the residual until the tolerance is met, at most LinearTuning::max_direct_refinements times; after
// that, the solve counts as kStagnated.
LinearSolver MakeDirectSolver();

}  // namespace planish
