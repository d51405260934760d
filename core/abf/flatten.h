// Angle Based Flattening of one disc: from target angles to planar angles.
#pragma once

#include <cstdint>
#include <functional>
#include <string>
#include <vector>

#include "Eigen/Core"
#include "absl/status/statusor.h"
#include "core/abf/target_angles.h"
#include "core/abf/topology.h"
#include "core/abf/tuning.h"
#include "core/base/execution.h"

namespace planish {

enum class SolverType { kAuto, kUzawa, kMinres, kDirect };
enum class SystemType { kAuto, kFull, kReduced };
enum class PreconditionerType { kAuto, kNone, kJacobi, kCholesky, kAmg };
enum class HessianType { kConvex, kExact, kAuto };
enum class BoundaryType { kFree, kConvex };

struct FlattenOptions {
  // kAuto: Uzawa (MINRES for HessianType::kExact) on the reduced system, preconditioned by multigrid, or by a Cholesky
  // factorization for SolverType::kDirect and where there are fewer faces than StepTuning::multigrid_faces. The full
  // system gets Jacobi.
  SolverType solver = SolverType::kAuto;
  SystemType system = SystemType::kAuto;
  PreconditionerType preconditioner = PreconditionerType::kAuto;
  // kConvex: convexified wherever it is not positive. kExact: exact, solved by MINRES, and convexified only where the
  // exact Hessian gives no step. kAuto: convexified far from the solution, exact (solved by MINRES) near it; the same
  // as kConvex with SolverType::kUzawa and kDirect.
  HessianType hessian = HessianType::kAuto;
  // kConvex: the angles at every boundary vertex add up to at most pi, within the tolerance, so that the outline of the
  // map is a convex polygon (boundary_control.h).
  BoundaryType boundary = BoundaryType::kFree;
  // Newton's method has converged when Residual::Max() is at most this. Radians, in (0, 1e-2].
  double tolerance = 1e-9;
  int max_newton_iterations = 100;  // in [1, 1000], over all active sets of BoundaryType::kConvex
  // Relative tolerance of every linear solve, in [0, 1e-2]. 0, the normal choice: forcing terms proportional to the
  // residual (ForcingTuning). A fixed tolerance is for comparisons.
  double linear_tolerance = 0;
  FlattenTuning tuning = {};  // for tests and benches; others keep the defaults

  // INVALID_ARGUMENT with reason OPTIONS_INVALID naming the field, or OK.
  absl::Status Validate() const;
};

// The largest violation of each kind of constraint, and of the gradient; radians.
struct Residual {
  double triangle = 0;  // eq. 1
  double vertex = 0;    // eq. 2, and the angle sums of active boundary vertices
  double wheel = 0;     // eq. 6
  double gradient = 0;  // of the Lagrangian, entry i divided by the objective's f''(x_i): 2 w_i, more with a barrier

  double Max() const;
};

struct FlattenProgress {
  int newton_iteration = 0;            // completed
  std::int64_t linear_iterations = 0;  // over all Newton steps so far
  double linear_residual = 0;          // relative, within the present linear solve; 0 between solves
  Residual residual;                   // after newton_iteration steps
  double energy = 0;                   // f(x)
  double step_length = 0;              // fraction of the last Newton step taken, in (0, 1]; 0: none was taken
};

// How a call reports progress and is ended. A stop request (Execution::stop) asks for an early end with the best angles
// within reach: the current linear solve is cut short, and Newton's method takes at most a few more steps (StopTuning),
// until the constraints hold well enough for a map without flips. FlattenSummary::stopped says whether that happened.
// During the call, only the loops of this solve may use the team (Execution::team).
struct FlattenControl : Execution {
  // After a stop request the method ends once no constraint is violated by more than this, radians. On 15 discs, angles
  // with violations below 0.05 had no flip in their layout; most discs get there in two steps.
  double flat_enough = 2e-2;
  // If angles collapse, or a linear system is hard to solve (StepTuning::iterations_to_give_up), the method ends
  // without having converged, instead of continuing with a barrier or another solver. For charts that can be cut.
  bool gives_up = false;
  // The most FlattenWork::work that the solve may take; 0: no limit. A solve that would take more ends without having
  // converged (FlattenSummary::out_of_work). If it has converged with a barrier, and would take more without, it keeps
  // the barrier. The limit does not apply to solvers without multigrid or a factorization, or with a fixed linear
  // tolerance.
  std::int64_t most_work = 0;
  // Called on the calling thread: at the start, after every Newton step and every few dozen linear iterations.
  std::function<void(const FlattenProgress&)> on_progress = {};
};

// The outcome of BoundaryType::kConvex.
struct BoundaryReport {
  BoundaryType type = BoundaryType::kFree;
  // The following members are for kConvex only.
  std::int32_t vertices = 0;  // boundary vertices
  std::int32_t active = 0;    // boundary vertices that are straight at the end: their angles add up to pi
  int set_changes = 0;        // changes of the set of active vertices
  // Whether the set is right (boundary_control.h): no boundary vertex has more than pi, and none is straight without
  // need.
  bool settled = true;
};

// The work behind a summary, over all runs of Newton's method: with BoundaryType::kConvex there is one for each active
// set.
struct FlattenWork {
  int newton_iterations = 0;
  std::int64_t linear_iterations = 0;
  // Linear iterations, plus the cost of setting up systems, of Newton steps and of line searches, in the unit of one
  // linear iteration (WorkTuning). An easy disc takes about 100; a unit takes about 0.1 microseconds a face.
  std::int64_t work = 0;
  int linear_solves = 0;
  // Solves that did not converge: they reached their iteration limit or failed (LinearTermination). Newton's method
  // uses their steps only if the merit function falls along them. Solves that a stop cut short do not count.
  int linear_failures = 0;
  // The reason of the first failure: "Newton step 4: iteration limit after 100 iterations, residual 1.2e-03 of the
  // right-hand side"; empty without failures.
  std::string linear_failure;
  // The part of multigrid that was left out in some step, and why (StepSolver::left_out()); empty if there was none.
  std::string preconditioner_note;
  int convexified_iterations = 0;  // Newton steps in which some Hessian entry was made positive
  int indefinite_iterations = 0;   // Newton steps with an exact Hessian that was not positive, by MINRES
  std::vector<float> residuals;    // Residual::Max() at the start of Newton's method and after each step
};

struct FlattenSummary : FlattenWork {
  // The methods used at the end, never kAuto. Sizes decide some of them (StepTuning::multigrid_faces).
  SolverType solver = SolverType::kDirect;
  SystemType system = SystemType::kReduced;
  PreconditionerType preconditioner = PreconditionerType::kNone;
  bool preconditioner_changed = false;  // multigrid failed, and a Cholesky factorization replaced it
  std::string multigrid_failure;        // why multigrid failed; empty if it did not
  // The requested type. For kAuto: kExact if some step used an exact Hessian that was not positive, otherwise kConvex.
  HessianType hessian = HessianType::kConvex;
  bool converged = false;
  bool stopped = false;  // FlattenControl::stop ended the solve early
  // FlattenControl::most_work ended the solve. If `converged`, the limit ended the attempt without `barrier`, so f
  // alone may have a minimum.
  bool out_of_work = false;
  Residual residual;
  BoundaryReport boundary;
  // The weight tau of the barrier (objective.h) that was kept because f alone has no minimum with positive angles on
  // this mesh; 0: no barrier. With a barrier, residual.gradient is that of f_tau.
  double barrier = 0;
  double energy = 0;         // f(x) at the end, without barrier
  std::string stop_message;  // one sentence with numbers
};

struct Flattening {
  Eigen::VectorXd angles;  // 3F planar angles, radians, in (0, pi)
  FlattenSummary summary;
};

// Minimizes f (eq. 4) subject to eq. 1, 2 and 6 and to the requested boundary control, by Newton's method on the
// Lagrangian, from StartingAngles() and mu = 0. Deterministic unless a stop is requested: the same bits with any team.
// Thread-safe: calls share only arguments that they do not change; each needs a team of its own.
//
// INVALID_ARGUMENT: OPTIONS_INVALID. CANCELLED: FlattenControl::cancel was set. INTERNAL: SOLVER_FAILED, multigrid
// failed and a Cholesky factorization may not replace it (StepSolver::Solve); the message says why and what to do.
// Neither the iteration limit nor a stop request is an error: see FlattenSummary::converged and stopped.
absl::StatusOr<Flattening> FlattenAngles(const Topology& topology, const TargetAngles& target,
                                         const FlattenOptions& options, const FlattenControl& control);

}  // namespace planish
