#include "core/abf/flatten.h"

#include <algorithm>
#include <utility>

#include "absl/strings/str_format.h"
#include "core/abf/boundary_control.h"
#include "core/abf/newton.h"
#include "core/base/error.h"
#include "core/base/status_macros.h"

namespace planish {

double Residual::Max() const {
  return std::max({triangle, vertex, wheel, gradient});
}

absl::Status FlattenOptions::Validate() const {
  if (!(tolerance > 0 && tolerance <= 1e-2)) {
    return OptionError("tolerance", absl::StrFormat("%g is not in (0, 0.01] radians", tolerance));
  }
  if (max_newton_iterations < 1 || max_newton_iterations > 1000) {
    return OptionError("max_newton_iterations", absl::StrFormat("%d is not in [1, 1000]", max_newton_iterations));
  }
  if (!(linear_tolerance >= 0 && linear_tolerance <= 1e-2)) {
    return OptionError("linear_tolerance", absl::StrFormat("%g is not in [0, 0.01]", linear_tolerance));
  }
  if (system == SystemType::kFull && solver == SolverType::kDirect) {
    return OptionError("system", "the direct solver factorizes the reduced system; use reduced, or another solver");
  }
  if (system == SystemType::kFull &&
      (preconditioner == PreconditionerType::kCholesky || preconditioner == PreconditionerType::kAmg)) {
    return OptionError("preconditioner",
                       "cholesky and amg are made from the reduced system; use reduced, or none or jacobi");
  }
  if (solver == SolverType::kDirect && preconditioner != PreconditionerType::kAuto &&
      preconditioner != PreconditionerType::kCholesky) {
    return OptionError("preconditioner", "the direct solver takes no preconditioner but cholesky");
  }
  if (hessian == HessianType::kExact && solver != SolverType::kMinres && solver != SolverType::kAuto) {
    return OptionError("hessian", "the exact Hessian may be indefinite, which only the minres solver can take");
  }
  return absl::OkStatus();
}

namespace {

// Resolves kAuto: Uzawa on the reduced system, preconditioned by multigrid, or by a Cholesky factorization for small
// meshes. For the full system there is nothing better than Jacobi.
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
