#include "core/abf/flatten.h"

#include <algorithm>
#include <cmath>
#include <utility>

#include "absl/strings/str_cat.h"
#include "absl/strings/str_format.h"
#include "core/abf/line_search.h"
#include "core/abf/step_solver.h"
#include "core/base/error.h"
#include "core/base/status_macros.h"

namespace planish {
namespace {

// kAuto resolved: Uzawa on the reduced system with a Cholesky factorization that is kept over Newton steps as long as
// it preconditions well, which measured fastest on every shared disc; the full system knows nothing better than Jacobi.
FlattenOptions Resolve(FlattenOptions options) {
  if (options.system == SystemType::kAuto) options.system = SystemType::kReduced;
  if (options.solver == SolverType::kAuto) {
    options.solver = options.hessian == HessianType::kExact ? SolverType::kMinres : SolverType::kUzawa;
  }
  if (options.preconditioner == PreconditionerType::kAuto) {
    options.preconditioner =
        options.system == SystemType::kFull ? PreconditionerType::kJacobi : PreconditionerType::kCholesky;
  }
  return options;
}

// Relative tolerance of the linear solve: proportional to the residual, so that Newton stays quadratic.
double ForcingTerm(double residual) {
  return std::clamp(1e-2 * residual, 1e-10, 1e-4);
}

// Newton's method for one mesh: x and mu, and what is known at them.
class Newton {
 public:
  Newton(const Topology& topology, const TargetAngles& target, const FlattenOptions& options,
         const FlattenControl& control)
      : topology_(topology),
        target_(target),
        options_(options),
        control_(control),
        steps_(topology, options.solver, options.system, options.preconditioner) {}

  absl::StatusOr<Flattening> Run();

 private:
  enum class StepOutcome { kTaken, kNoProgress };

  // Everything that depends on x and mu.
  void Evaluate();
  absl::StatusOr<StepOutcome> TakeStep();
  // Solves eq. 5 with `hessian`; true if the step leads downhill on the merit function.
  absl::StatusOr<bool> ComputeStep(const Eigen::VectorXd& hessian, const Eigen::VectorXd& convex, NewtonStep* step);
  // The fraction of `step` to take; 0 if none lowers the merit function.
  double SearchLine(const NewtonStep& step) const;
  void Report(double linear_residual, std::int64_t linear_iterations) const;
  void Stop(const std::string& why);

  const Topology& topology_;
  const TargetAngles& target_;
  const FlattenOptions& options_;
  const FlattenControl& control_;
  StepSolver steps_;

  Eigen::VectorXd x_;
  Multipliers mu_;
  Eigen::VectorXd cot_, gradient_;
  ConstraintValues h_;
  MeritFunction merit_;
  double step_length_ = 0;
  FlattenSummary summary_;
};

void Newton::Evaluate() {
  cot_ = Cotangents(x_);
  h_ = EvaluateConstraints(topology_, x_);
  gradient_ = LagrangianGradient(topology_, target_, x_, cot_, mu_);
  summary_.residual = MeasureResidual(target_, h_, gradient_);
  summary_.energy = target_.Energy(x_);
}

void Newton::Report(double linear_residual, std::int64_t linear_iterations) const {
  if (!control_.on_progress) return;
  FlattenProgress progress;
  progress.newton_iteration = summary_.newton_iterations;
  progress.linear_iterations = summary_.linear_iterations + linear_iterations;
  progress.linear_residual = linear_residual;
  progress.residual = summary_.residual;
  progress.energy = summary_.energy;
  progress.step_length = step_length_;
  control_.on_progress(progress);
}

void Newton::Stop(const std::string& why) {
  const Residual& r = summary_.residual;
  summary_.stop_message = absl::StrFormat(
      "%s after %d Newton steps: triangle %.1e, vertex %.1e, wheel %.1e, gradient %.1e rad, tolerance %.1e", why,
      summary_.newton_iterations, r.triangle, r.vertex, r.wheel, r.gradient, options_.tolerance);
}

absl::StatusOr<bool> Newton::ComputeStep(const Eigen::VectorXd& hessian, const Eigen::VectorXd& convex,
                                         NewtonStep* step) {
  PLANISH_RETURN_IF_ERROR(steps_.Prepare(hessian, convex, cot_));
  LinearSolveOptions linear;
  linear.relative_tolerance = ForcingTerm(summary_.residual.Max());
  linear.interrupter = control_.interrupter;
  linear.on_progress = [this](std::int64_t iterations, double residual) { Report(residual, iterations); };
  const LinearSummary solved = steps_.Solve(gradient_, h_, linear, step);
  summary_.linear_iterations += solved.iterations;
  if (solved.termination == LinearTermination::kInterrupted) return absl::CancelledError("cancelled");
  if (!step->x.allFinite()) return false;
  merit_.UpdatePenalties(mu_, step->mu);
  return merit_.Slope(target_, x_, h_, step->x) < 0;
}

double Newton::SearchLine(const NewtonStep& step) const {
  constexpr double kSufficientDecrease = 1e-4;
  constexpr int kMaxHalvings = 30;
  const double slope = merit_.Slope(target_, x_, h_, step.x);
  const double before = merit_.Value(target_, x_, h_);
  const double rounding = 1e-12 * std::abs(before);  // merit values closer than this cannot be told apart
  double alpha = LargestStep(x_, step.x);
  for (int i = 0; i < kMaxHalvings; ++i, alpha /= 2) {
    const Eigen::VectorXd trial = x_ + alpha * step.x;
    const double after = merit_.Value(target_, trial, EvaluateConstraints(topology_, trial));
    if (after <= before + kSufficientDecrease * alpha * slope + rounding) return alpha;
  }
  return 0;
}

absl::StatusOr<Newton::StepOutcome> Newton::TakeStep() {
  const Eigen::VectorXd hessian = LagrangianHessian(topology_, target_, x_, mu_);
  Eigen::VectorXd convex = hessian;
  const bool changed = Convexify(topology_, target_, steps_.RequiredConvexification(), &convex) > 0;

  NewtonStep step;
  bool downhill = false;
  if (options_.hessian == HessianType::kExact) {
    PLANISH_ASSIGN_OR_RETURN(downhill, ComputeStep(hessian, convex, &step));
  }
  if (!downhill) {
    if (changed) ++summary_.convexified_iterations;
    PLANISH_ASSIGN_OR_RETURN(downhill, ComputeStep(convex, convex, &step));
  }
  const double alpha = downhill ? SearchLine(step) : 0;
  if (alpha == 0) return StepOutcome::kNoProgress;
  x_ += alpha * step.x;
  mu_.triangle += alpha * step.mu.triangle;
  mu_.pair += alpha * step.mu.pair;
  step_length_ = alpha;
  ++summary_.newton_iterations;
  return StepOutcome::kTaken;
}

absl::StatusOr<Flattening> Newton::Run() {
  summary_.solver = options_.solver;
  summary_.system = options_.system;
  summary_.preconditioner = options_.preconditioner;
  summary_.hessian = options_.hessian;
  x_ = target_.angle;
  mu_ = Multipliers::Zero(topology_);
  while (true) {
    Evaluate();
    Report(0, 0);
    if (IsInterrupted(control_.interrupter)) return absl::CancelledError("cancelled");
    if (summary_.residual.Max() <= options_.tolerance) {
      summary_.converged = true;
      Stop("converged");
      break;
    }
    if (summary_.newton_iterations >= options_.max_newton_iterations) {
      Stop("iteration limit reached");
      break;
    }
    const absl::StatusOr<StepOutcome> outcome = TakeStep();
    if (outcome.status().code() == absl::StatusCode::kFailedPrecondition) {
      Stop(absl::StrCat("no step (", std::string(outcome.status().message()), ")"));
      break;
    }
    PLANISH_RETURN_IF_ERROR(outcome.status());
    if (*outcome == StepOutcome::kNoProgress) {
      Stop("no further progress");
      break;
    }
  }
  return Flattening{std::move(x_), std::move(summary_)};
}

}  // namespace

absl::StatusOr<Flattening> FlattenAngles(const Topology& topology, const TargetAngles& target,
                                         const FlattenOptions& options, const FlattenControl& control) {
  PLANISH_RETURN_IF_ERROR(options.Validate());
  const FlattenOptions resolved = Resolve(options);
  return Newton(topology, target, resolved, control).Run();
}

}  // namespace planish
