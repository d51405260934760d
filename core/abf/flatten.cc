#include "core/abf/flatten.h"

#include <utility>

#include "core/abf/boundary_control.h"
#include "core/abf/newton.h"
#include "core/base/status_macros.h"

namespace planish {
namespace {

// kAuto resolved: Uzawa on the reduced system, preconditioned by multigrid, or by a Cholesky factorization where the
// mesh is small. The full system knows nothing better than Jacobi.
FlattenOptions Resolve(FlattenOptions options, const Topology& topology) {
  if (options.system == SystemType::kAuto) options.system = SystemType::kReduced;
  if (options.hessian == HessianType::kAuto && options.solver != SolverType::kAuto &&
      options.solver != SolverType::kMinres) {
    options.hessian = HessianType::kConvex;
  }
  if (options.solver == SolverType::kAuto) {
    options.solver = options.hessian == HessianType::kExact ? SolverType::kMinres : SolverType::kUzawa;
  }
  if (options.preconditioner == PreconditionerType::kAuto) {
    if (options.system == SystemType::kFull) {
      options.preconditioner = PreconditionerType::kJacobi;
    } else if (options.solver == SolverType::kDirect || topology.num_faces() < options.tuning.step.multigrid_faces) {
      options.preconditioner = PreconditionerType::kCholesky;
    } else {
      options.preconditioner = PreconditionerType::kAmg;
    }
  }
  return options;
}

}  // namespace

absl::StatusOr<Flattening> FlattenAngles(const Topology& topology, const TargetAngles& target,
                                         const FlattenOptions& options, const FlattenControl& control) {
  PLANISH_RETURN_IF_ERROR(options.Validate());
  const FlattenOptions resolved = Resolve(options, topology);
  if (resolved.boundary == BoundaryType::kConvex) return FlattenConvex(topology, target, resolved, control);
  Newton newton(topology, target, resolved, control);
  PLANISH_ASSIGN_OR_RETURN(FlattenSummary summary, newton.Run());
  return Flattening{newton.x(), std::move(summary)};
}

}  // namespace planish
