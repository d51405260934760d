// Solvers of the saddle-point system (eq. 7), all behind one interface.
#pragma once

#include <cstdint>
#include <functional>
#include <memory>
#include <vector>

#include "Eigen/Core"
#include "core/base/interrupter.h"
#include "core/linalg/preconditioner.h"
#include "core/linalg/saddle_point.h"

namespace planish {

enum class LinearTermination {
  kConverged,       // the true residual meets the tolerance, or the solve is as good as a rough one has to be
  kIterationLimit,  //
  kIndefinite,      // a direction of no or negative curvature: M is not positive definite, and this solver needs it
  kStagnated,       // the solver believed in convergence, the true residual does not; or non-finite numbers appeared
  kInterrupted,
};
const char* Name(LinearTermination termination);

// When a solve serves a step of an inexact Newton method. The Euclidean norm does not tell: where the scale of a map
// spans many orders of magnitude a few rows are all it sees.
struct RoughTolerance {
  // Over that of lambda = 0, in (0, 1): of the error in the norm of M, which conjugate directions minimize (Uzawa), or
  // of the residual in the norm of the preconditioner's inverse, which MINRES minimizes. They are the same for an exact
  // one.
  double energy = 0;
  // Of the greatest entry of B A^-1 f - g - M lambda.
  double residual = 0;
};

// One call.
struct LinearSolveOptions {
  // Stop at |B A^-1 f - g - M lambda| <= relative_tolerance |B A^-1 f - g| (Euclidean norms; the norm of the
  // preconditioner while iterating). In (0, 1).
  double relative_tolerance = 1e-10;
  // In its place, if there are any, for iterative solvers with a preconditioner that is near to M^-1 (Uzawa's estimate
  // of its error is for convergence that is fast and even): stop when one of these is met in both parts.
  std::vector<RoughTolerance> rough;
  std::int64_t max_iterations = 100000;
  const Interrupter* interrupter = nullptr;
  const Interrupter* stop = nullptr;  // ends the solve in the same way; there are two so that callers can tell
  // Called every kProgressInterval iterations with the count and the relative residual.
  std::function<void(std::int64_t, double)> on_progress;
};

// Iterations between two calls of on_progress. The interrupters are looked at in each iteration.
constexpr std::int64_t kProgressInterval = 32;

// Whether one of the tolerances is met: by `energy`, what is left of that, and by `residual`.
bool IsMet(const std::vector<RoughTolerance>& rough, double energy, const Eigen::VectorXd& residual, ThreadTeam& team);

struct LinearSummary {
  LinearTermination termination = LinearTermination::kConverged;
  std::int64_t iterations = 0;
  // |B A^-1 f - g - M lambda| / |B A^-1 f - g|, recomputed from lambda for every solver alike; after a rough solve, the
  // solver's own. A system that has M rounded to float is solved, and measured, as rounded where the tolerance is rough
  // or 1e-5 or more; with smaller ones the solution is refined against the exact M until that residual meets the
  // tolerance, to a factor of 2.
  double true_residual = 0;
};

struct SaddlePointSolution {
  Eigen::VectorXd x;
  Eigen::VectorXd lambda;
};

class LinearSolver {
 public:
  virtual ~LinearSolver() = default;

  // Solves from lambda = 0. Whatever the termination, the solution is the best the solver has, with
  // x = A^-1 (f - B^t lambda). A system without multipliers converges in no iterations.
  LinearSummary Solve(const SaddlePointOperator& system, const Preconditioner& preconditioner, const Eigen::VectorXd& f,
                      const Eigen::VectorXd& g, const LinearSolveOptions& options, SaddlePointSolution* solution) const;

  // The same for the Schur complement by itself: M lambda = rhs, from lambda = 0.
  LinearSummary SolveSchur(const SaddlePointOperator& system, const Preconditioner& preconditioner,
                           const Eigen::VectorXd& rhs, const LinearSolveOptions& options,
                           Eigen::VectorXd* lambda) const;

 private:
  // rhs is not zero. Sets true_residual where it went by `options.rough`.
  virtual LinearSummary SolveImpl(const SaddlePointOperator& system, const Preconditioner& preconditioner,
                                  const Eigen::VectorXd& rhs, const LinearSolveOptions& options,
                                  Eigen::VectorXd* lambda) const = 0;
};

// First approach (section 7.1): MINRES on M lambda = B A^-1 f - g. M may be indefinite or singular.
std::unique_ptr<LinearSolver> MakeMinresSolver();

// Second approach (section 7.2): the modified Uzawa algorithm with conjugate directions. M must be positive definite.
std::unique_ptr<LinearSolver> MakeUzawaSolver();

// Takes the preconditioner for the inverse of M (a factorization) and refines once. M must be positive definite.
std::unique_ptr<LinearSolver> MakeDirectSolver();

}  // namespace planish
