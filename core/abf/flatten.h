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

// Names as on the command line and in reports: "uzawa", "reduced", ...
const char* Name(SolverType type);
const char* Name(SystemType type);
const char* Name(PreconditionerType type);
const char* Name(HessianType type);

struct FlattenOptions {
  SolverType solver = SolverType::kAuto;
  SystemType system = SystemType::kAuto;
  PreconditionerType preconditioner = PreconditionerType::kAuto;
  // kConvex: made positive wherever it is not. kExact: as it is, with MINRES, and made positive only where that leads
  // nowhere. kAuto, for SolverType::kAuto and kMinres: kConvex far from the solution and kExact near it; for the other
  // solvers the same as kConvex.
  HessianType hessian = HessianType::kAuto;
  // Newton stops as converged when the largest violation of every constraint family and the largest scaled entry of
  // the gradient (Residual) are all at most this, in radians. In (0, 1e-2].
  double tolerance = 1e-9;
  int max_newton_iterations = 100;  // in [1, 1000]

  // INVALID_ARGUMENT with reason OPTIONS_INVALID naming the field, or OK.
  absl::Status Validate() const;
};

// Largest absolute residual of each family, in radians.
struct Residual {
  double triangle = 0;  // eq. 1
  double vertex = 0;    // eq. 2
  double wheel = 0;     // eq. 6
  double gradient = 0;  // of the Lagrangian, entry i divided by 2 w_i

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
  std::function<void(const FlattenProgress&)> on_progress;
  // For the solver's loops; null: the calling thread is alone. Not to be used by others meanwhile.
  ThreadTeam* team = nullptr;
};

struct FlattenSummary {
  // As used, never kAuto.
  SolverType solver = SolverType::kDirect;
  SystemType system = SystemType::kReduced;
  PreconditionerType preconditioner = PreconditionerType::kNone;
  bool preconditioner_changed = false;  // multigrid failed on the way and Cholesky took over
  HessianType hessian = HessianType::kConvex;
  bool converged = false;
  int newton_iterations = 0;
  std::int64_t linear_iterations = 0;
  int convexified_iterations = 0;  // Newton steps in which some Hessian entry was made positive
  int indefinite_iterations = 0;   // Newton steps taken with the exact Hessian where it was not positive, by MINRES
  Residual residual;
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

// Minimizes f subject to eq. 1, 2 and 6 by Newton's method on the Lagrangian, from x = a and mu = 0. Deterministic.
// INVALID_ARGUMENT: OPTIONS_INVALID. CANCELLED: interrupted. INTERNAL: SOLVER_FAILED, no step could be computed.
// Running out of iterations is not an error: see FlattenSummary::converged.
absl::StatusOr<Flattening> FlattenAngles(const Topology& topology, const TargetAngles& target,
                                         const FlattenOptions& options, const FlattenControl& control);

}  // namespace planish
