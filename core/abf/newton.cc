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

// Relative tolerance of the residual of a linear solve, for solvers without a good preconditioner.
double ForcingTerm(double residual, double tolerance, const ForcingTuning& tuning) {
  const double on_the_way = std::min(tuning.of_residual * residual, tuning.max_term);
  const double last = std::min(tuning.of_tolerance * tolerance / residual, tuning.max_last_term);
  return std::max({on_the_way, last, tuning.min_term});
}

// Forcing terms for solvers with a good preconditioner: limits of the error, and of the violation that remains in each
// constraint after the step. To first order, that violation is the residual of the linear solve. (The gradient
// vanishes: x and the multipliers of the triangles are recovered exactly.)
std::vector<RoughTolerance> RoughForcing(const Residual& residual, double violations, double tolerance,
                                         const ForcingTuning& tuning) {
  const double constraints = std::max({residual.triangle, residual.vertex, residual.wheel});
  return {{.energy = std::min(tuning.error_of_residual * residual.Max(), tuning.max_error),
           .residual = tuning.constraints_left * constraints,
           .residual_sum = tuning.violations_left * violations},
          {.energy = tuning.max_last_error, .residual = tuning.tolerance_left * tolerance}};
}

constexpr double kAnyResidual = std::numeric_limits<double>::infinity();

}  // namespace

Newton::Point Newton::PointAt(Eigen::VectorXd x) const {
  Point point;
  point.sine = Sines(x, team());
  point.h = EvaluateConstraints(topology_, x, point.sine, team());
  point.energy = objective_.Energy(x);
  point.x = std::move(x);
  return point;
}

void Newton::Evaluate() {
  if (at_.sine.size() == 0) at_.sine = Sines(at_.x, team());
  at_.cot = Cotangents(at_.x, team());
  at_.curvature = bounds_.Curvature(at_.x);
  at_.gradient = LagrangianGradient(topology_, objective_, at_.x, at_.cot, at_.mu, team());
  summary_.residual = MeasureResidual(at_.curvature, at_.h, at_.gradient, team());
  summary_.energy = at_.energy;
}

void Newton::Report(double linear_residual, std::int64_t linear_iterations) const {
  if (!control_.on_progress) return;
  control_.on_progress({.newton_iteration = summary_.newton_iterations,
                        .linear_iterations = summary_.linear_iterations + linear_iterations,
                        .linear_residual = linear_residual,
                        .residual = summary_.residual,
                        .energy = summary_.energy,
                        .step_length = history_.length});
}

// Other preconditioners, and fixed tolerances, may take any number of iterations.
bool Newton::IsQuick() const {
  const bool is_quick =
      steps_.preconditioner() == PreconditionerType::kAmg || steps_.preconditioner() == PreconditionerType::kCholesky;
  return is_quick && options_.linear_tolerance == 0 && !control_.IsStopRequested();
}

bool Newton::EndsAtHardSystems() const {
  return control_.gives_up && IsQuick();
}

bool Newton::HasWorkLimit() const {
  return control_.most_work > 0 && IsQuick();
}

absl::StatusOr<LinearSummary> Newton::Solve(const Eigen::VectorXd& gradient, const ConstraintValues& h,
                                            NewtonStep* step) {
  LinearSolveOptions linear;
  if (options_.linear_tolerance > 0) {
    linear.relative_tolerance = options_.linear_tolerance;
  } else if (course_.exact_steps) {
    linear.relative_tolerance = tuning().forcing.min_term;
  } else {
    linear.relative_tolerance = ForcingTerm(summary_.residual.Max(), options_.tolerance, tuning().forcing);
    linear.rough =
        RoughForcing(summary_.residual, Sum(team(), h.pair.cwiseAbs()), options_.tolerance, tuning().forcing);
  }
  linear.cancel = control_.cancel;
  const bool stopping = control_.IsStopRequested();
  if (stopping) {
    linear.relative_tolerance = std::max(linear.relative_tolerance, tuning().stop.tolerance);
    if (!linear.rough.empty()) linear.rough.push_back({.energy = tuning().stop.tolerance, .residual = kAnyResidual});
    linear.max_iterations = MostIterationsAfterStop();
  } else {
    linear.stop = control_.stop;
  }
  if (EndsAtHardSystems()) linear.max_iterations = options_.tuning.step.iterations_to_give_up;
  if (HasWorkLimit()) linear.max_iterations = std::clamp<std::int64_t>(WorkLeft(), 1, linear.max_iterations);
  linear.on_progress = [this](std::int64_t iterations, double residual) { Report(residual, iterations); };
  PLANISH_ASSIGN_OR_RETURN(const LinearSummary solved, steps_.Solve(gradient, h, linear, step));
  ++summary_.linear_solves;
  summary_.linear_iterations += solved.iterations;
  summary_.work += solved.iterations;
  if (stopping) history_.iterations_after_stop += solved.iterations;
  if (solved.termination == LinearTermination::kInterrupted) {
    if (control_.IsCancelled()) return absl::CancelledError("cancelled");
    history_.cut_short = true;
  } else if (stopping && solved.termination == LinearTermination::kIterationLimit) {
    history_.cut_short = true;
  } else if (HasWorkLimit() && WorkLeft() <= 0 && solved.termination == LinearTermination::kIterationLimit) {
    // The work limit ended this solve, which is no failure. Newton's method ends after this step.
  } else if (solved.termination != LinearTermination::kConverged) {
    ++summary_.linear_failures;
    if (summary_.linear_failure.empty()) {
      summary_.linear_failure = absl::StrCat("Newton step ", summary_.newton_iterations + 1, ": ", Describe(solved));
    }
  }
  return solved;
}

absl::StatusOr<bool> Newton::ComputeStep(const Eigen::VectorXd& hessian, const Eigen::VectorXd& convex, bool indefinite,
                                         NewtonStep* step, double* slope) {
  PLANISH_RETURN_IF_ERROR(steps_.Prepare(hessian, convex, at_.cot, indefinite, history_.weak_faces, control_.cancel));
  if (summary_.preconditioner_note.empty() && !steps_.left_out().empty()) {
    summary_.preconditioner_note =
        absl::StrCat("Newton step ", summary_.newton_iterations + 1, ": ", steps_.left_out());
  }
  PLANISH_ASSIGN_OR_RETURN(const LinearSummary solved, Solve(at_.gradient, at_.h, step));
  if (!step->x.allFinite()) return false;
  if (indefinite && solved.termination != LinearTermination::kConverged &&
      !(solved.true_residual <= tuning().convexity.usable_residual)) {
    return false;
  }
  if (EndsAtHardSystems() && !indefinite && solved.termination == LinearTermination::kIterationLimit) {
    return absl::FailedPreconditionError("the linear system takes too many iterations");
  }
  merit_.UpdatePenalties(at_.mu, step->mu);
  const MeritFunction::Derivative derivative = merit_.Slope(at_.x, at_.h, step->x);
  *slope = derivative.slope;
  if (derivative.slope <= derivative.noise) return true;
  // This slope holds for a step that meets the linearized constraints. Near the constraints, the violations that the
  // linear solver has left matter more. So the slope may be positive by the penalty of these violations.
  Eigen::VectorXd left;
  ApplyPairRows(topology_, at_.cot, step->x, &left, team());
  Assign(team(), left + at_.h.pair, &left);
  return derivative.slope <= derivative.noise + merit_.PairPenalty(left);
}

absl::StatusOr<bool> Newton::SearchLine(const NewtonStep& step, double slope) {
  const LineSearchTuning& line_search = tuning().line_search;
  const double before = merit_.Value(at_.x, at_.energy, at_.h);
  const double rounding = line_search.merit_rounding * std::abs(before);
  // Sets `trial` to the point at `alpha` along the step `x`. True if its merit is low enough.
  Point trial;
  const auto lowers_merit = [&](const Eigen::VectorXd& x, double alpha) {
    summary_.work += tuning().work.trial;
    Eigen::VectorXd moved;
    Assign(team(), at_.x + alpha * x, &moved);
    trial = PointAt(std::move(moved));
    return merit_.Value(trial.x, trial.energy, trial.h) <=
           before + line_search.sufficient_decrease * alpha * std::min(0.0, slope) + rounding;
  };
  double alpha = LargestStepLength(at_.x, step.x, team(), line_search);
  // A few angles on their way to 0 should not shorten the step of all others.
  bool found = alpha < 1 && lowers_merit(ClippedStep(at_.x, step.x, team(), line_search), 1);
  if (found) {
    alpha = 1;
  } else {
    found = lowers_merit(step.x, alpha);
  }
  if (!found && alpha == 1) {
    // The curvature of the constraints can make the merit function refuse a good full step (the Maratos effect: Nocedal
    // and Wright 2006, section 15.5). A second-order correction goes back to where the constraints hold: the least step
    // d with B d = -h(x + step).
    NewtonStep correction;
    // Only h of the trial is needed. Memory is at its peak here, so the trial's x, set to zero, serves as the zero
    // gradient.
    trial.sine.resize(0);
    trial.x.setZero();
    PLANISH_RETURN_IF_ERROR(Solve(trial.x, trial.h, &correction).status());
    trial = {};
    correction.mu = {};
    correction.x += step.x;
    found = correction.x.allFinite() && LargestStepLength(at_.x, correction.x, team(), line_search) == 1 &&
            lowers_merit(correction.x, 1);
  }
  for (std::int64_t i = 0; !found && i < line_search.max_halvings; ++i) {
    alpha /= 2;
    found = lowers_merit(step.x, alpha);
  }
  if (!found) return false;
  history_.length = alpha;
  bounds_.Follow(at_.x, trial.x, alpha);
  MoveTo(std::move(trial));
  Assign(team(), at_.mu.triangle + alpha * step.mu.triangle, &at_.mu.triangle);
  Assign(team(), at_.mu.pair + alpha * step.mu.pair, &at_.mu.pair);
  return true;
}

absl::StatusOr<bool> Newton::TakeStep() {
  history_.length = 0;  // stays 0 until a step has been taken
  summary_.work += tuning().work.step;
  Eigen::VectorXd convex = LagrangianHessian(topology_, at_.curvature, at_.sine, at_.mu, team());
  Eigen::VectorXd hessian;  // empty if the Hessian itself is convex
  const double residual = summary_.residual.Max();
  const double before = std::exchange(course_.last_residual, residual);
  const ConvexityTuning& convexity = tuning().convexity;
  const bool gains = residual > convexity.very_near_solution && residual <= convexity.fast_gain * before;
  const bool near = residual <= convexity.near_solution && !gains;
  const bool try_exact = options_.hessian == HessianType::kExact ||
                         (options_.hessian == HessianType::kAuto && near && history_.indefinite_pays);
  if (try_exact) hessian = convex;
  const bool changed =
      Convexify(at_.curvature, steps_.RequiredConvexification(), &convex, team(), &history_.weak_faces, convexity) > 0;

  Eigen::VectorXd absolute;
  if (changed && try_exact) absolute = AbsoluteHessian(at_.curvature, hessian, team(), convexity);
  if (!changed) hessian.resize(0);
  at_.curvature.resize(0);
  if (control_.IsCancelled()) return absl::CancelledError("cancelled");
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
      history_.indefinite_pays = false;
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
  MoveTo(PointAt(StartingAngles(target_, team())));
  at_.mu = Multipliers::Zero(topology_);
  Forget();
}

void Newton::Forget() {
  bounds_.set_z({});
  merit_.Reset();
  course_ = {.collapsed = tuning().barrier.collapsed, .narrow = tuning().barrier.narrow};
}

double Newton::SmallestRatio() const {
  return 1 / Largest(team(), at_.x.cwiseQuotient(target_.angle).cwiseInverse());
}

bool Newton::AnglesCollapse() {
  if (objective_.barrier() != 0) return false;
  const double ratio = SmallestRatio();
  if (ratio < course_.collapsed) return true;
  if (ratio >= course_.narrow) {
    course_.narrow_steps = 0;
  } else if (summary_.residual.Max() > tuning().barrier.fast_decrease * course_.last_residual) {
    ++course_.narrow_steps;
  }
  return course_.narrow_steps > tuning().barrier.narrow_steps;
}

std::int64_t Newton::MostIterationsAfterStop() const {
  return std::max(tuning().stop.min_iterations, tuning().stop.iteration_faces / topology_.num_faces());
}

bool Newton::IsFlat() const {
  const Residual& r = summary_.residual;
  // On a nearly flat surface the constraints may hold before the first step, while the map would still fold.
  return course_.whole_step && std::max({r.triangle, r.vertex, r.wheel}) <= control_.flat_enough;
}

bool Newton::EndsEarly() {
  if (!control_.IsStopRequested()) return false;
  if (IsFlat()) return true;
  if (history_.iterations_after_stop >= tuning().stop.min_steps * MostIterationsAfterStop()) return true;
  return history_.steps_after_stop++ >=
         std::max(tuning().stop.min_steps, tuning().stop.step_faces / topology_.num_faces());
}

absl::StatusOr<Newton::Ending> Newton::Iterate(double tolerance) {
  const BarrierTuning& barrier = tuning().barrier;
  bool moved = false;
  while (true) {
    Evaluate();
    // After a step that failed, or a change of the objective, the last entry is overwritten.
    summary_.residuals.resize(static_cast<std::size_t>(summary_.newton_iterations) + 1);
    summary_.residuals.back() = static_cast<float>(summary_.residual.Max());
    Report(0, 0);
    if (control_.IsCancelled()) return absl::CancelledError("cancelled");
    if (summary_.residual.Max() <= tolerance) return Ending::kConverged;
    if (summary_.newton_iterations >= options_.max_newton_iterations) return Ending::kIterationLimit;
    if (EndsEarly()) return Ending::kStopped;
    if (HasWorkLimit() && WorkLeft() <= 0) return Ending::kOutOfWork;
    if (moved && AnglesCollapse()) return Ending::kStuck;
    history_.cut_short = false;
    const absl::StatusOr<bool> taken = TakeStep();
    if (taken.status().code() == absl::StatusCode::kFailedPrecondition) return Ending::kStuck;
    PLANISH_RETURN_IF_ERROR(taken.status());
    moved = *taken;
    course_.whole_step = moved && history_.length == 1 && !history_.cut_short;
    if (history_.cut_short && !moved) continue;  // a solve that was cut short says nothing about a full one
    // Near the constraints, the violations that a rough linear solve leaves can keep the merit function from falling.
    // After a tiny step, or none, all linear solves are therefore exact.
    if (history_.length < tuning().line_search.tiny_step && !course_.exact_steps) {
      course_.exact_steps = true;
      continue;
    }
    if (moved && objective_.barrier() == 0 && history_.length < barrier.cut_step) return Ending::kStuck;
    course_.short_steps = history_.length < barrier.short_step ? course_.short_steps + 1 : 0;
    if (course_.short_steps > barrier.short_steps) return Ending::kStuck;
    if (!moved && std::exchange(course_.exact_steps, true)) return Ending::kStuck;
  }
}

absl::StatusOr<Newton::Ending> Newton::GoOnWithABarrier() {
  const BarrierTuning& barrier = tuning().barrier;
  Forget();
  objective_.set_barrier(barrier.weakest);
  PLANISH_ASSIGN_OR_RETURN(Ending ending, Iterate(options_.tolerance));
  if (ending == Ending::kStuck) {
    // Starts again with the strongest barrier and weakens it step by step.
    Start();
    for (const double tau : BarrierSequence(barrier)) {
      objective_.set_barrier(tau);
      PLANISH_ASSIGN_OR_RETURN(ending, Iterate(tau > barrier.weakest ? barrier.rough_tolerance : options_.tolerance));
      if (ending == Ending::kStopped || ending == Ending::kOutOfWork) break;
      course_.short_steps = 0;
    }
  }
  if (ending != Ending::kConverged) return ending;
  // Goes on without a barrier.
  Point kept = at_;
  Multipliers kept_mu = at_.mu;
  objective_.set_barrier(0);
  course_.collapsed = course_.narrow = std::min(barrier.narrow, barrier.collapsed_after * SmallestRatio());
  PLANISH_ASSIGN_OR_RETURN(ending, Iterate(options_.tolerance));
  if (ending == Ending::kConverged) return ending;
  // f has no minimum with positive angles nearby, or the allowed work did not suffice to find one: keep the minimum
  // with the barrier.
  summary_.out_of_work = ending == Ending::kOutOfWork;
  MoveTo(std::move(kept));
  at_.mu = std::move(kept_mu);
  objective_.set_barrier(barrier.weakest);
  Evaluate();
  return ending == Ending::kStopped ? ending : Ending::kConverged;
}

absl::StatusOr<FlattenSummary> Newton::Run() {
  Start();
  summary_.work += tuning().work.setup;
  if (control_.IsCancelled()) return absl::CancelledError("cancelled");
  PLANISH_ASSIGN_OR_RETURN(Ending ending, Iterate(options_.tolerance));
  if (ending == Ending::kStuck && !control_.gives_up) {
    PLANISH_ASSIGN_OR_RETURN(ending, GoOnWithABarrier());
  }
  return Finish(ending);
}

absl::StatusOr<FlattenSummary> Newton::RunFrom(NewtonIterate start, const FlattenWork& before) {
  static_cast<FlattenWork&>(summary_) = before;
  summary_.work += tuning().work.setup;
  Forget();
  MoveTo(PointAt(std::move(start.x)));
  at_.mu = std::move(start.mu);
  objective_.set_barrier(start.barrier);
  bounds_.set_z(std::move(start.z));
  if (control_.IsCancelled()) return absl::CancelledError("cancelled");
  PLANISH_ASSIGN_OR_RETURN(const Ending ending, Iterate(options_.tolerance));
  return Finish(ending);
}

FlattenSummary Newton::Finish(Ending ending) {
  summary_.solver = options_.solver;
  summary_.system = options_.system;
  summary_.barrier = objective_.barrier();
  const HessianType used = summary_.indefinite_iterations > 0 ? HessianType::kExact : HessianType::kConvex;
  summary_.hessian = options_.hessian == HessianType::kAuto ? used : options_.hessian;
  summary_.preconditioner = steps_.preconditioner();
  summary_.preconditioner_changed = summary_.preconditioner != options_.preconditioner;
  summary_.multigrid_failure = steps_.multigrid_failure();
  summary_.converged = ending == Ending::kConverged;
  summary_.stopped = ending == Ending::kStopped || (!summary_.converged && history_.steps_after_stop > 0);
  summary_.out_of_work |= ending == Ending::kOutOfWork;
  // The beginning of the message for each Ending, in the order of the enum.
  constexpr const char* kEndings[] = {"converged", "no further progress", "iteration limit reached", "stopped",
                                      "given up, since it took too much work,"};
  const Residual& r = summary_.residual;
  summary_.stop_message = absl::StrFormat(
      "%s%s after %d Newton steps: triangle %.1e, vertex %.1e, wheel %.1e, gradient %.1e rad, tolerance %.1e",
      kEndings[static_cast<int>(ending)],
      summary_.barrier > 0 ? absl::StrFormat(" with a barrier of %g", summary_.barrier) : "",
      summary_.newton_iterations, r.triangle, r.vertex, r.wheel, r.gradient, options_.tolerance);
  return summary_;
}

}  // namespace planish
