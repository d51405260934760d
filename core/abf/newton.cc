#include "core/abf/newton.h"

#include <algorithm>
#include <cmath>
#include <limits>
#include <utility>

#include "absl/strings/str_cat.h"
#include "absl/strings/str_format.h"
#include "core/base/status_macros.h"
#include "core/linalg/vector_ops.h"

namespace planish {
namespace {

constexpr double kLeastForcingTerm = 1e-10;

// Relative tolerance of a linear solve by its residual (the forcing term of an inexact Newton method), which is all
// that solves without a good preconditioner have: proportional to the residual of Newton's method, so that this stays
// quadratic, but no smaller than the last step needs to end below the tolerance.
double ForcingTerm(double residual, double tolerance) {
  constexpr double kLargest = 1e-4;  // while Newton has far to go: rough steps cost more steps
  constexpr double kLargestAtEnd = 1e-2;
  const double on_the_way = std::min(1e-2 * residual, kLargest);
  const double last = std::min(0.3 * tolerance / residual, kLargestAtEnd);
  return std::max({on_the_way, last, kLeastForcingTerm});
}

// The same by the error and by what is left of each constraint, with a good one. What the solve leaves of the
// constraints, to first order, is its residual: a part of what they are now, or so little that the step may be the last
// one. (A gradient is not left: that is recovered exactly.)
std::vector<RoughTolerance> RoughForcing(const Residual& residual, double tolerance) {
  constexpr double kLargest = 1e-2, kOfResidual = 0.1, kOfConstraints = 0.1;
  constexpr double kLargestAtEnd = 0.1, kOfTolerance = 0.3;
  const double constraints = std::max({residual.triangle, residual.vertex, residual.wheel});
  return {{.energy = std::min(kOfResidual * residual.Max(), kLargest), .residual = kOfConstraints * constraints},
          {.energy = kLargestAtEnd, .residual = kOfTolerance * tolerance}};
}

// The barrier that remains where f has no minimum with positive angles. On the sphere through a 3-edge hole it costs
// 0.2 % of the energy, and the least angle stays at 0.3 degrees.
constexpr double kLeastBarrier = 1e-2;
// Angles so much smaller than their targets are on their way to 0, and so are those that stay a little larger for some
// steps, unless these lead quickly to a solution. On discs where f has a minimum the smallest ratio on the way there is
// 0.003, on most of them no less than 0.025.
constexpr double kCollapsed = 1e-3, kNarrow = 1e-2;
constexpr int kNarrowStepsAllowed = 2;
constexpr double kQuickly = 1.0 / 3;  // of the residual before
// The same, as a part of the smallest ratio with the least barrier, once that is known.
constexpr double kStillThere = 0.25;
// Residual to which the stronger barriers on the way there are solved.
constexpr double kRoughTolerance = 1e-2;

// Relative residual at which MINRES on an indefinite system that has used up its iterations still gives a good step.
constexpr double kGoodEnough = 1e-3;

// Residual from which on HessianType::kAuto trusts the exact Hessian where it is not positive. Further away it leads
// astray (22 steps instead of 10 on boot_seam); nearer, the convexified one converges linearly only.
constexpr double kNearSolution = 3e-2;
// Down to this residual the convexified one goes on for as long as each step gains a digit with it: its linear solves
// take half the iterations.
constexpr double kVeryNearSolution = 1e-3;
constexpr double kDigit = 0.1;

// After a stop: steps that may be taken to where angles are flat enough, iterations of one linear solve and of all: as
// many as take a part of a second, whatever the size, but some at least.
constexpr std::int64_t kLeastHurriedSteps = 4, kHurriedStepFaces = 400'000;
constexpr std::int64_t kLeastHurriedIterations = 50, kHurriedIterationFaces = 8'000'000;
constexpr double kHurriedTolerance = 1e-4, kAnyResidual = std::numeric_limits<double>::infinity();

}  // namespace

Newton::Point Newton::PointAt(Eigen::VectorXd x) const {
  Point point;
  point.sine = Sines(x, team_);
  point.h = EvaluateConstraints(topology_, x, point.sine, team_);
  point.energy = objective_.Energy(x);
  point.x = std::move(x);
  return point;
}

void Newton::Evaluate() {
  if (at_.sine.size() == 0) at_.sine = Sines(at_.x, team_);
  cot_ = Cotangents(at_.x, team_);
  curvature_ = bounds_.Curvature(at_.x);
  gradient_ = LagrangianGradient(topology_, objective_, at_.x, cot_, mu_, team_);
  summary_.residual = MeasureResidual(curvature_, at_.h, gradient_, team_);
  summary_.energy = at_.energy;
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

absl::StatusOr<LinearSummary> Newton::Solve(const Eigen::VectorXd& gradient, const ConstraintValues& h,
                                            NewtonStep* step) {
  LinearSolveOptions linear;
  if (options_.linear_tolerance > 0) {
    linear.relative_tolerance = options_.linear_tolerance;
  } else if (exact_steps_) {
    linear.relative_tolerance = kLeastForcingTerm;
  } else {
    linear.relative_tolerance = ForcingTerm(summary_.residual.Max(), options_.tolerance);
    linear.rough = RoughForcing(summary_.residual, options_.tolerance);
  }
  linear.interrupter = control_.interrupter;
  const bool hurried = IsInterrupted(control_.stop);
  if (hurried) {
    linear.relative_tolerance = std::max(linear.relative_tolerance, kHurriedTolerance);
    if (!linear.rough.empty()) linear.rough.push_back({.energy = kHurriedTolerance, .residual = kAnyResidual});
    linear.max_iterations = MostHurriedIterations();
  } else {
    linear.stop = control_.stop;
  }
  linear.on_progress = [this](std::int64_t iterations, double residual) { Report(residual, iterations); };
  const LinearSummary solved = steps_.Solve(gradient, h, linear, step);
  summary_.linear_iterations += solved.iterations;
  if (hurried) hurried_iterations_ += solved.iterations;
  if (solved.termination == LinearTermination::kInterrupted) {
    if (IsInterrupted(control_.interrupter)) return absl::CancelledError("cancelled");
    cut_short_ = true;
  } else if (hurried && solved.termination == LinearTermination::kIterationLimit) {
    cut_short_ = true;
  }
  return solved;
}

absl::StatusOr<bool> Newton::ComputeStep(const Eigen::VectorXd& hessian, const Eigen::VectorXd& convex, bool indefinite,
                                         NewtonStep* step, double* slope) {
  PLANISH_RETURN_IF_ERROR(steps_.Prepare(hessian, convex, cot_, indefinite, weak_faces_, control_.interrupter));
  PLANISH_ASSIGN_OR_RETURN(const LinearSummary solved, Solve(gradient_, at_.h, step));
  if (!step->x.allFinite()) return false;
  if (indefinite && solved.termination != LinearTermination::kConverged && !(solved.true_residual <= kGoodEnough)) {
    return false;
  }
  merit_.UpdatePenalties(mu_, step->mu);
  const MeritFunction::Derivative derivative = merit_.Slope(at_.x, at_.h, step->x);
  *slope = derivative.slope;
  if (derivative.slope <= derivative.noise) return true;
  // The slope is that of a step which meets the linearized constraints; where they hold already, what the linear solver
  // has left of them counts for more.
  Eigen::VectorXd left;
  ApplyPairRows(topology_, cot_, step->x, &left, team_);
  Assign(team_, left + at_.h.pair, &left);
  return derivative.slope <= derivative.noise + merit_.PairPenalty(left);
}

absl::StatusOr<bool> Newton::SearchLine(const NewtonStep& step, double slope) {
  constexpr int kMaxHalvings = 30;
  constexpr double kSufficientDecrease = 1e-4;
  const double before = merit_.Value(at_.x, at_.energy, at_.h);
  const double rounding = 1e-12 * std::abs(before);  // merit values closer than this cannot be told apart
  // The point alpha along a step, and whether it is low enough.
  Point trial;
  const auto lowers_merit = [&](const Eigen::VectorXd& x, double alpha) {
    Eigen::VectorXd moved;
    Assign(team_, at_.x + alpha * x, &moved);
    trial = PointAt(std::move(moved));
    return merit_.Value(trial.x, trial.energy, trial.h) <=
           before + kSufficientDecrease * alpha * std::min(0.0, slope) + rounding;
  };
  double alpha = LargestStep(at_.x, step.x, team_);
  bool found = false;
  if (alpha < 1 && lowers_merit(HeldStep(at_.x, step.x, team_), 1)) {
    // A few angles on their way to 0 need not hold back all others.
    found = true;
    alpha = 1;
  }
  found = found || lowers_merit(step.x, alpha);
  if (!found && alpha == 1) {
    // The curvature of the constraints can make the merit function refuse a good full step (Maratos). A second-order
    // correction goes back to where the constraints hold: the least step d with B d = -h(x + step).
    NewtonStep correction;
    PLANISH_RETURN_IF_ERROR(Solve(Eigen::VectorXd::Zero(step.x.size()), trial.h, &correction).status());
    correction.x += step.x;
    found = correction.x.allFinite() && LargestStep(at_.x, correction.x, team_) == 1 && lowers_merit(correction.x, 1);
  }
  for (int i = 0; !found && i < kMaxHalvings; ++i) {
    alpha /= 2;
    found = lowers_merit(step.x, alpha);
  }
  step_length_ = alpha;
  if (!found) return false;
  bounds_.Follow(at_.x, trial.x, alpha);
  at_ = std::move(trial);
  Assign(team_, mu_.triangle + alpha * step.mu.triangle, &mu_.triangle);
  Assign(team_, mu_.pair + alpha * step.mu.pair, &mu_.pair);
  return true;
}

absl::StatusOr<bool> Newton::TakeStep() {
  Eigen::VectorXd convex = LagrangianHessian(topology_, curvature_, at_.sine, mu_, team_);
  Eigen::VectorXd hessian;  // where it is not convex itself
  const double residual = summary_.residual.Max();
  const double before = std::exchange(last_residual_, residual);
  const bool gains = residual > kVeryNearSolution && residual <= kDigit * before;
  const bool near = residual <= kNearSolution && !gains;
  const bool try_exact =
      options_.hessian == HessianType::kExact || (options_.hessian == HessianType::kAuto && near && indefinite_pays_);
  if (try_exact) hessian = convex;
  weak_faces_ = WeakFaces(curvature_, convex, team_);
  const bool changed = Convexify(curvature_, steps_.RequiredConvexification(), &convex, team_) > 0;

  Eigen::VectorXd absolute;
  if (changed && try_exact) absolute = AbsoluteHessian(curvature_, hessian, team_);
  if (!changed) hessian.resize(0);
  curvature_.resize(0);
  if (IsInterrupted(control_.interrupter)) return absl::CancelledError("cancelled");
  at_.sine.resize(0);

  NewtonStep step;
  double slope = 0;
  bool found = false;
  if (changed && try_exact) {
    PLANISH_ASSIGN_OR_RETURN(const bool downhill, ComputeStep(hessian, absolute, /*indefinite=*/true, &step, &slope));
    if (downhill) {
      PLANISH_ASSIGN_OR_RETURN(found, SearchLine(step, slope));
    }
    if (found) {
      ++summary_.indefinite_iterations;
    } else {
      indefinite_pays_ = false;
    }
  }
  if (!found) {
    if (changed) ++summary_.convexified_iterations;
    PLANISH_ASSIGN_OR_RETURN(const bool downhill, ComputeStep(convex, convex, /*indefinite=*/false, &step, &slope));
    if (!downhill) return false;
    PLANISH_ASSIGN_OR_RETURN(found, SearchLine(step, slope));
    if (!found) return false;
  }
  ++summary_.newton_iterations;
  return true;
}

void Newton::Start() {
  at_ = PointAt(StartingAngles(target_, team_));
  mu_ = Multipliers::Zero(topology_);
  Forget();
}

void Newton::Forget() {
  bounds_.set_z({});
  collapsed_ = kCollapsed;
  narrow_ = kNarrow;
  merit_.Reset();
  whole_step_ = false;
  last_residual_ = 0;
  short_steps_ = narrow_steps_ = 0;
  exact_steps_ = false;
}

bool Newton::AnglesCollapse() {
  if (objective_.barrier() != 0) return false;
  const double ratio = Smallest(team_, at_.x.cwiseQuotient(target_.angle));
  if (ratio < collapsed_) return true;
  if (ratio >= narrow_) {
    narrow_steps_ = 0;
  } else if (summary_.residual.Max() > kQuickly * last_residual_) {
    ++narrow_steps_;
  }
  return narrow_steps_ > kNarrowStepsAllowed;
}

std::int64_t Newton::MostHurriedIterations() const {
  return std::max(kLeastHurriedIterations, kHurriedIterationFaces / topology_.num_faces());
}

bool Newton::IsFlat() const {
  const Residual& r = summary_.residual;
  // Where the surface bends little, the constraints hold well before the first step and the map would still fold.
  return whole_step_ && std::max({r.triangle, r.vertex, r.wheel}) <= control_.flat_enough;
}

bool Newton::EndsEarly() {
  if (!IsInterrupted(control_.stop)) return false;
  if (IsFlat()) return true;
  if (hurried_iterations_ >= kLeastHurriedSteps * MostHurriedIterations()) return true;
  return hurried_steps_++ >= std::max(kLeastHurriedSteps, kHurriedStepFaces / topology_.num_faces());
}

absl::StatusOr<Newton::Ending> Newton::Iterate(double tolerance) {
  // Steps that angles near 0 cut this short are going nowhere: a single one without a barrier, a run of them with one.
  constexpr double kCutStep = 0.3, kShortStep = 0.1;
  constexpr int kShortStepsAllowed = 2;
  constexpr double kTinyStep = 1e-3;
  bool moved = false;
  while (true) {
    Evaluate();
    Report(0, 0);
    if (IsInterrupted(control_.interrupter)) return absl::CancelledError("cancelled");
    if (summary_.residual.Max() <= tolerance) return Ending::kConverged;
    if (summary_.newton_iterations >= options_.max_newton_iterations) return Ending::kIterationLimit;
    if (EndsEarly()) return Ending::kStopped;
    if (moved && AnglesCollapse()) return Ending::kStuck;
    cut_short_ = false;
    const absl::StatusOr<bool> taken = TakeStep();
    if (taken.status().code() == absl::StatusCode::kFailedPrecondition) return Ending::kStuck;  // numerically singular
    PLANISH_RETURN_IF_ERROR(taken.status());
    moved = *taken;
    whole_step_ = moved && step_length_ == 1 && !cut_short_;
    if (cut_short_ && !moved) continue;  // which says nothing about whole solves
    // Where the constraints hold already, what a rough linear solve has left of them can keep the merit function from
    // ever going down.
    if (step_length_ < kTinyStep && !exact_steps_) {
      exact_steps_ = true;
      continue;
    }
    if (moved && objective_.barrier() == 0 && step_length_ < kCutStep) return Ending::kStuck;
    short_steps_ = step_length_ < kShortStep ? short_steps_ + 1 : 0;
    if (short_steps_ > kShortStepsAllowed) return Ending::kStuck;
    if (!moved && std::exchange(exact_steps_, true)) return Ending::kStuck;
  }
}

absl::StatusOr<Newton::Ending> Newton::GoOnWithABarrier() {
  Forget();
  objective_.set_barrier(kLeastBarrier);
  PLANISH_ASSIGN_OR_RETURN(Ending ending, Iterate(options_.tolerance));
  if (ending == Ending::kStuck) {
    // Again, with stronger ones before it.
    Start();
    for (const double tau : {1.0, 0.1, kLeastBarrier}) {
      objective_.set_barrier(tau);
      PLANISH_ASSIGN_OR_RETURN(ending, Iterate(tau > kLeastBarrier ? kRoughTolerance : options_.tolerance));
      if (ending == Ending::kStopped) break;
      short_steps_ = 0;
    }
  }
  if (ending != Ending::kConverged) return ending;
  // Now without it.
  const Point kept = at_;
  const Multipliers kept_mu = mu_;
  objective_.set_barrier(0);
  collapsed_ = narrow_ = std::min(kNarrow, kStillThere * Smallest(team_, at_.x.cwiseQuotient(target_.angle)));
  PLANISH_ASSIGN_OR_RETURN(ending, Iterate(options_.tolerance));
  if (ending == Ending::kConverged) return ending;
  // f has no minimum with positive angles nearby: the minimum with the barrier stands.
  at_ = kept;
  mu_ = kept_mu;
  objective_.set_barrier(kLeastBarrier);
  Evaluate();
  return ending == Ending::kStopped ? ending : Ending::kConverged;
}

absl::StatusOr<FlattenSummary> Newton::Run() {
  Start();
  if (IsInterrupted(control_.interrupter)) return absl::CancelledError("cancelled");
  PLANISH_ASSIGN_OR_RETURN(Ending ending, Iterate(options_.tolerance));
  if (ending == Ending::kStuck) {
    PLANISH_ASSIGN_OR_RETURN(ending, GoOnWithABarrier());
  }
  return Finish(ending);
}

absl::StatusOr<FlattenSummary> Newton::RunFrom(NewtonIterate start) {
  Forget();
  at_ = PointAt(std::move(start.x));
  mu_ = std::move(start.mu);
  objective_.set_barrier(start.barrier);
  bounds_.set_z(std::move(start.z));
  if (IsInterrupted(control_.interrupter)) return absl::CancelledError("cancelled");
  PLANISH_ASSIGN_OR_RETURN(const Ending ending, Iterate(options_.tolerance));
  return Finish(ending);
}

FlattenSummary Newton::Finish(Ending ending) {
  summary_.solver = options_.solver;
  summary_.system = options_.system;
  summary_.barrier = objective_.barrier();
  summary_.hessian = options_.hessian;
  if (summary_.hessian == HessianType::kAuto) {
    summary_.hessian = summary_.indefinite_iterations > 0 ? HessianType::kExact : HessianType::kConvex;
  }
  summary_.preconditioner = steps_.preconditioner();
  summary_.preconditioner_changed = summary_.preconditioner != options_.preconditioner;
  summary_.converged = ending == Ending::kConverged;
  summary_.stopped = ending == Ending::kStopped || (!summary_.converged && hurried_steps_ > 0);
  std::string why = ending == Ending::kConverged ? "converged"
                    : ending == Ending::kStopped ? "stopped"
                    : ending == Ending::kStuck   ? "no further progress"
                                                 : "iteration limit reached";
  if (summary_.barrier > 0) absl::StrAppend(&why, absl::StrFormat(" with a barrier of %g", summary_.barrier));
  Stop(why);
  return summary_;
}

}  // namespace planish
