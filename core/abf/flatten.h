// Angle Based Flattening of one disc: positions to planar angles.
#pragma once

#include <cstdint>
#include <functional>
#include <string>

#include "Eigen/Core"
#include "absl/status/statusor.h"
#include "core/abf/target_angles.h"
#include "core/base/interrupter.h"
#include "core/base/thread_team.h"
#include "core/mesh/topology.h"

namespace planish {

enum class SolverType { kAuto, kUzawa, kMinres, kDirect };
enum class SystemType { kAuto, kFull, kReduced };
enum class PreconditionerType { kAuto, kNone, kJacobi, kCholesky, kAmg };
enum class HessianType { kConvex, kExact, kAuto };
enum class BoundaryType { kFree, kConvex };

// Names as on the command line and in reports: "uzawa", "reduced", ...
const char* Name(SolverType type);
const char* Name(SystemType type);
const char* Name(PreconditionerType type);
const char* Name(HessianType type);
const char* Name(BoundaryType type);

struct FlattenOptions {
  SolverType solver = SolverType::kAuto;
  SystemType system = SystemType::kAuto;
  PreconditionerType preconditioner = PreconditionerType::kAuto;
  // kConvex: made positive wherever it is not. kExact: as it is, with MINRES, and made positive only where that leads
  // nowhere. kAuto, for SolverType::kAuto and kMinres: kConvex far from the solution and kExact near it; for the other
  // solvers the same as kConvex.
  HessianType hessian = HessianType::kAuto;
  // kConvex: the angles at every boundary vertex add up to at most pi, within the tolerance, so that the outline of the
  // map is a convex polygon (boundary_control.h).
  BoundaryType boundary = BoundaryType::kFree;
  // Newton stops as converged when the largest violation of every constraint family and the largest scaled entry of
  // the gradient (Residual) are all at most this, in radians. In (0, 1e-2].
  double tolerance = 1e-9;
  int max_newton_iterations = 100;  // in [1, 1000], over all active sets
  // Relative tolerance of every linear solve, in [0, 1e-2]. 0: a forcing term, proportional to the residual of the
  // Newton step, which is what to use; a fixed one is here for comparison.
  double linear_tolerance = 0;

  // INVALID_ARGUMENT with reason OPTIONS_INVALID naming the field, or OK.
  absl::Status Validate() const;
};

// Largest absolute residual of each family, in radians.
struct Residual {
  double triangle = 0;  // eq. 1
  double vertex = 0;    // eq. 2, and angle sums of boundary vertices held straight
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
  double step_length = 0;              // fraction of the last Newton step taken, in (0, 1]
};

struct FlattenControl {
  const Interrupter* interrupter = nullptr;
  // Ends the work with the best angles within reach: a linear solve under way is cut short, and Newton's method goes on
  // for a few short steps at most, until the constraints hold well enough for a map without flips
  // (FlattenSummary::stopped). Any thread may set it at any time.
  const Interrupter* stop = nullptr;
  // What is well enough after `stop`: the largest violation of a constraint, radians. Of 15 shared discs and surfaces
  // by formula, none below 0.05 had a flip in its layout; most are there after two steps.
  double flat_enough = 2e-2;
  std::function<void(const FlattenProgress&)> on_progress;
  // For the solver's loops; null: the calling thread is alone. Not to be used by others meanwhile.
  ThreadTeam* team = nullptr;
};

// How BoundaryType::kConvex went.
struct BoundaryReport {
  BoundaryType type = BoundaryType::kFree;
  // The rest is for kConvex only.
  std::int32_t vertices = 0;  // boundary vertices
  std::int32_t active = 0;    // of these, held straight at the end: angles that add up to pi
  int set_changes = 0;        // times that the set of active vertices changed
  // Whether the set is right (boundary_control.h): no boundary vertex has more than pi, and none is held without need.
  bool settled = true;
};

struct FlattenSummary {
  // As used, never kAuto.
  SolverType solver = SolverType::kDirect;
  SystemType system = SystemType::kReduced;
  PreconditionerType preconditioner = PreconditionerType::kNone;
  bool preconditioner_changed = false;  // multigrid failed on the way and Cholesky took over
  HessianType hessian = HessianType::kConvex;
  bool converged = false;
  bool stopped = false;  // FlattenControl::stop came before the end
  int newton_iterations = 0;
  std::int64_t linear_iterations = 0;
  int convexified_iterations = 0;  // Newton steps in which some Hessian entry was made positive
  int indefinite_iterations = 0;   // Newton steps taken with the exact Hessian where it was not positive, by MINRES
  Residual residual;
  BoundaryReport boundary;
  // 0, or the weight tau of the barrier (objective.h) that was left in because f alone has no minimum with positive
  // angles on this mesh; residual.gradient is then that of f with the barrier.
  double barrier = 0;
  double energy = 0;         // f(x) at the end, without barrier
  std::string stop_message;  // one sentence with numbers
};

struct Flattening {
  Eigen::VectorXd angles;  // 3F planar angles, radians, in (0, pi)
  FlattenSummary summary;
};

// Minimizes f subject to eq. 1, 2 and 6, and the boundary control asked for, by Newton's method on the Lagrangian, from
// x = a and mu = 0. Deterministic. INVALID_ARGUMENT: OPTIONS_INVALID. CANCELLED: interrupted. INTERNAL: SOLVER_FAILED,
// no step could be computed. Running out of iterations is not an error: see FlattenSummary::converged.
absl::StatusOr<Flattening> FlattenAngles(const Topology& topology, const TargetAngles& target,
                                         const FlattenOptions& options, const FlattenControl& control);

}  // namespace planish
