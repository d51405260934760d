#include <algorithm>

#include "absl/strings/str_format.h"
#include "core/abf/flatten.h"
#include "core/base/error.h"

namespace planish {
const char* Name(SolverType type) {
  constexpr const char* kNames[] = {"auto", "uzawa", "minres", "direct"};
  return kNames[static_cast<int>(type)];
}

const char* Name(SystemType type) {
  constexpr const char* kNames[] = {"auto", "full", "reduced"};
  return kNames[static_cast<int>(type)];
}

const char* Name(PreconditionerType type) {
  constexpr const char* kNames[] = {"auto", "none", "jacobi", "cholesky", "amg"};
  return kNames[static_cast<int>(type)];
}

const char* Name(HessianType type) {
  constexpr const char* kNames[] = {"convex", "exact", "auto"};
  return kNames[static_cast<int>(type)];
}

const char* Name(BoundaryType type) {
  constexpr const char* kNames[] = {"free", "convex"};
  return kNames[static_cast<int>(type)];
}

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

}  // namespace planish
