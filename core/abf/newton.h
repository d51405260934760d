// Newton's method on the Lagrangian of one mesh, with everything that makes it converge: convexification, line search,
// barrier.
#pragma once

#include <cstdint>
#include <string>
#include <vector>

#include "absl/status/statusor.h"
#include "core/abf/bound_multipliers.h"
#include "core/abf/constraints.h"
#include "core/abf/flatten.h"
#include "core/abf/lagrangian.h"
#include "core/abf/line_search.h"
#include "core/abf/objective.h"
#include "core/abf/step_solver.h"

namespace planish {

// A point that Newton's method starts from or ends at.
struct NewtonIterate {
  Eigen::VectorXd x;  // angles
  Multipliers mu;
  double barrier = 0;      // of the objective
  Eigen::VectorXd z = {};  // BoundMultipliers, or none yet
};

// x and mu, and what is known at them. All arguments of the constructor must outlive this; no type in `options` may be
// kAuto but hessian.
class Newton {
 public:
  Newton(const Topology& topology, const TargetAngles& target, const FlattenOptions& options,
         const FlattenControl& control)
      : topology_(topology),
        target_(target),
        team_(control.team != nullptr ? *control.team : Alone()),
        objective_(target, team_),
        bounds_(target, objective_, team_),
        options_(options),
        control_(control),
        steps_(topology, options.solver, options.system, options.preconditioner, team_),
        merit_(objective_, team_) {
    steps_.set_limit_indefinite(options.hessian == HessianType::kAuto);
  }

  // From StartingAngles() and mu = 0 to a minimum of f. If angles run into 0 on the way, on or again with a barrier,
  // which stays where f has no minimum without.
  absl::StatusOr<FlattenSummary> Run();
  // From `start` to a minimum of f with the barrier of `start`, or to where angles run into 0.
  absl::StatusOr<FlattenSummary> RunFrom(NewtonIterate start);

  // Where Run() ended.
  const Eigen::VectorXd& x() const { return at_.x; }
  const Multipliers& mu() const { return mu_; }
  const Eigen::VectorXd& z() const { return bounds_.z(); }
  // Whether that is good enough to stop at: where a whole step led, with constraints that hold
  // (FlattenControl::flat_enough).
  bool IsFlat() const;

 private:
  enum class Ending { kConverged, kStuck, kIterationLimit, kStopped };

  // Angles, and what follows from them alone.
  struct Point {
    Eigen::VectorXd x, sine;  // sine: empty once a step has been computed from it
    ConstraintValues h;
    double energy = 0;
  };
  Point PointAt(Eigen::VectorXd x) const;

  // To StartingAngles() and mu = 0.
  void Start();
  // Of the steps so far, what is not x and mu.
  void Forget();
  // Run(), once angles have run into 0.
  absl::StatusOr<Ending> GoOnWithABarrier();
  // What there is to report in the end.
  FlattenSummary Finish(Ending ending);
  // Newton steps on the present objective until every residual is at most `tolerance`.
  absl::StatusOr<Ending> Iterate(double tolerance);
  // Whether control_.stop is set and no more steps are due.
  bool EndsEarly();
  // Of one linear solve after that.
  std::int64_t MostHurriedIterations() const;
  // Everything else that depends on x and mu.
  void Evaluate();
  // One step; false if none leads anywhere.
  absl::StatusOr<bool> TakeStep();
  // Solves eq. 5 with `hessian`; true if the step leads downhill on the merit function, with its slope.
  absl::StatusOr<bool> ComputeStep(const Eigen::VectorXd& hessian, const Eigen::VectorXd& convex, bool indefinite,
                                   NewtonStep* step, double* slope);
  // Solves eq. 5 of the present iterate for another right-hand side.
  absl::StatusOr<LinearSummary> Solve(const Eigen::VectorXd& gradient, const ConstraintValues& h, NewtonStep* step);
  // Shortens `step` until it lowers the merit function, and goes there; false if it never does. `slope` is the merit
  // function's along the step.
  absl::StatusOr<bool> SearchLine(const NewtonStep& step, double slope);
  // Without a barrier: whether some angle is less than `collapsed_` times its target, or has been less than `narrow_`
  // times for some steps that did not lead nearer to a solution. To be asked once after each step.
  bool AnglesCollapse();
  void Report(double linear_residual, std::int64_t linear_iterations) const;
  void Stop(const std::string& why);

  const Topology& topology_;
  const TargetAngles& target_;
  ThreadTeam& team_;
  Objective objective_;
  BoundMultipliers bounds_;
  const FlattenOptions& options_;
  const FlattenControl& control_;
  StepSolver steps_;

  Point at_;
  Multipliers mu_;
  Eigen::VectorXd curvature_, cot_, gradient_;  // curvature_: empty once a step has been computed from it
  std::vector<std::int32_t> weak_faces_;        // of the present step
  MeritFunction merit_;
  double collapsed_ = 0, narrow_ = 0;  // see AnglesCollapse()
  int narrow_steps_ = 0;               // in a row
  double last_residual_ = 0;           // before the last step; 0 before the first
  double step_length_ = 0;
  int short_steps_ = 0;       // in a row
  bool exact_steps_ = false;  // no forcing terms any more
  bool whole_step_ = false;   // the last step was taken at full length, from a linear solve that converged
  bool cut_short_ = false;    // control_.stop ended a linear solve of the present step
  std::int64_t hurried_steps_ = 0, hurried_iterations_ = 0;  // after control_.stop
  bool indefinite_pays_ = true;  // HessianType::kAuto: no step with the exact Hessian has failed yet
  FlattenSummary summary_;
};

}  // namespace planish
