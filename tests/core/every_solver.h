// Every way to solve eq. 5 that can be asked for.
#pragma once

#include <vector>

#include "core/abf/flatten.h"

namespace planish::testing {

// The valid combinations of solver, system and preconditioner, none of them kAuto.
inline std::vector<FlattenOptions> EverySolver() {
  std::vector<FlattenOptions> combinations;
  for (const auto solver : {SolverType::kUzawa, SolverType::kMinres, SolverType::kDirect}) {
    for (const auto system : {SystemType::kFull, SystemType::kReduced}) {
      for (const auto preconditioner : {PreconditionerType::kNone, PreconditionerType::kJacobi,
                                        PreconditionerType::kCholesky, PreconditionerType::kAmg}) {
        FlattenOptions options;
        options.solver = solver;
        options.system = system;
        options.preconditioner = preconditioner;
        if (options.Validate().ok()) combinations.push_back(options);
      }
    }
  }
  return combinations;
}

}  // namespace planish::testing
