// Newton's method on the Lagrangian of one disc (section 6 of the paper), made to converge from anywhere by a
// convexified Hessian, a line search, and a barrier where angles collapse.
#pragma once

#include <cstdint>
#include <utility>
#include <vector>

#include "absl/status/statusor.h"
#include "core/abf/constraints.h"
#include "core/abf/flatten.h"
#include "core/abf/lagrangian.h"
#include "core/abf/line_search.h"
#include "core/abf/objective.h"
#include "core/abf/step_solver.h"
#include "core/abf/tuning.h"

namespace planish {

// A start or end point of Newton's method.
struct NewtonIterate {
  Eigen::VectorXd x;  // angles
  Multipliers mu;
  double barrier = 0;      // tau of the objective
  Eigen::VectorXd z = {};  // of BoundMultipliers; empty: not started yet
};

// One run of the method. All arguments of the constructor must outlive this object. Of the types in `options` only
// `hessian` may be kAuto. Errors are those of FlattenAngles(). Not thread-safe.
class Newton {
 public:
  Newton(const Topology& topology, const TargetAngles& target, const FlattenOptions& options,
         const FlattenControl& control)
      : topology_(topology),
        target_(target),
        options_(options),
        control_(control),
        objective_(target, team()),
        bounds_(target, objective_, team(), tuning().barrier),
        steps_(topology, options.solver, options.system, options.preconditioner, team(), options.tuning),
        merit_(objective_, team(), tuning().line_search) {
    steps_.set_limit_indefinite(options.hessian == HessianType::kAuto);
  }

  // Goes from StartingAngles() and mu = 0 to a minimum of f. If angles collapse, the method continues with a barrier,
  // then tries without one from there. The barrier is kept if f alone has no minimum with positive angles.
  absl::StatusOr<FlattenSummary> Run();
  // Goes from `start` to a minimum of f with the barrier of `start`, or until angles collapse. Counts continue from
  // `before`.
  absl::StatusOr<FlattenSummary> RunFrom(NewtonIterate start, const FlattenWork& before);

  // The solver of linear systems, for tests that make it fail.
  StepSolver& step_solver() { return steps_; }

  // The end point of Run() or RunFrom().
  const Eigen::VectorXd& x() const { return at_.x; }
  const Multipliers& mu() const { return at_.mu; }
  const Eigen::VectorXd& z() const { return bounds_.z(); }
  // Whether x() is good enough for an early end: the last step had full length, and the constraints hold to
  // FlattenControl::flat_enough.
  bool IsFlat() const;

 private:
  enum class Ending { kConverged, kStuck, kIterationLimit, kStopped, kOutOfWork };

  // Angles, and values that depend only on them.
  struct Point {
    Eigen::VectorXd x, sine;  // sine: empty once a step has been computed from it
    ConstraintValues h;
    double energy = 0;
  };
  Point PointAt(Eigen::VectorXd x) const;
  // Replaces the point of at_. Does not change mu.
  void MoveTo(Point point) { static_cast<Point&>(at_) = std::move(point); }

  struct State : Point {
    Multipliers mu;
    Eigen::VectorXd curvature, cot, gradient;  // by Evaluate(). curvature: empty once a step has been computed
  };

  // Goes to StartingAngles() and mu = 0, and calls Forget().
  void Start();
  // Resets the state of earlier steps except x and mu: penalties, bound multipliers, course_.
  void Forget();
  // Continues Run() once angles have collapsed.
  absl::StatusOr<Ending> GoOnWithABarrier();
  // Returns the summary of the run, with its message.
  FlattenSummary Finish(Ending ending);
  // Takes Newton steps on the current objective until every residual is at most `tolerance`.
  absl::StatusOr<Ending> Iterate(double tolerance);
  // Whether a stop is requested and no further step may be taken (StopTuning).
  bool EndsEarly();
  // The iteration limit of one linear solve after a stop is requested.
  std::int64_t MostIterationsAfterStop() const;
  // Computes gradient, curvature, cotangents and residual at x and mu.
  void Evaluate();
  // Takes one step; false if no step lowers the merit function.
  absl::StatusOr<bool> TakeStep();
  // Solves eq. 5 with `hessian`. True if the merit function falls along `step`; sets `slope` to its slope there.
  absl::StatusOr<bool> ComputeStep(const Eigen::VectorXd& hessian, const Eigen::VectorXd& convex, bool indefinite,
                                   NewtonStep* step, double* slope);
  // Whether each linear system is expected to take few iterations.
  bool IsQuick() const;
  // Whether a linear system that takes too many iterations ends the run (FlattenControl::gives_up).
  bool EndsAtHardSystems() const;
  // Whether FlattenControl::most_work applies, and how much work it still allows.
  bool HasWorkLimit() const;
  std::int64_t WorkLeft() const { return control_.most_work - summary_.work; }
  // Solves eq. 5 at the current iterate for another right-hand side.
  absl::StatusOr<LinearSummary> Solve(const Eigen::VectorXd& gradient, const ConstraintValues& h, NewtonStep* step);
  // Shortens `step` until it lowers the merit function, whose slope along the step is `slope`, and moves there. False
  // if no length lowers it; x and mu then stay unchanged.
  absl::StatusOr<bool> SearchLine(const NewtonStep& step, double slope);
  // The smallest ratio of an angle to its target.
  double SmallestRatio() const;
  // Whether angles collapse (BarrierTuning); false if there is a barrier.
  // Counts steps, so it is called once after each step.
  bool AnglesCollapse();
  // Calls on_progress. The arguments are those of the current linear solve.
  void Report(double linear_residual, std::int64_t linear_iterations) const;

  // The state that Forget() does not reset.
  struct History {
    // About the latest step.
    double length = 0;                          // 0: no step was taken
    bool cut_short = false;                     // a stop request ended a linear solve
    std::vector<std::int32_t> weak_faces = {};  // set by Convexify()
    // Counts since a stop was requested.
    std::int64_t steps_after_stop = 0, iterations_after_stop = 0;
    bool indefinite_pays = true;  // HessianType::kAuto: false once a step with the exact Hessian has failed
  };

  // Statistics of the steps since Forget().
  struct Course {
    double collapsed = 0, narrow = 0;  // ratios: BarrierTuning
    int narrow_steps = 0;              // in a row
    double last_residual = 0;          // before the last step; 0 before the first
    int short_steps = 0;               // in a row
    bool exact_steps = false;          // all linear solves use the least forcing term
    bool whole_step = false;           // the last step had full length and no stop cut its linear solve short
  };

  const NewtonTuning& tuning() const { return options_.tuning.newton; }
  ThreadTeam& team() const { return control_.Team(); }

  // The arguments of the constructor.
  const Topology& topology_;
  const TargetAngles& target_;
  const FlattenOptions& options_;
  const FlattenControl& control_;
  // The parts of the method.
  Objective objective_;
  BoundMultipliers bounds_;
  StepSolver steps_;
  MeritFunction merit_;
  // The state of the run.
  State at_;
  Course course_;
  History history_;
  FlattenSummary summary_;
};

}  // namespace planish
