// Meshes that are discs in the solver's arrays, and what its options are called.
#pragma once

#include "absl/status/statusor.h"
#include "core/abf/flatten.h"
#include "core/abf/topology.h"
#include "core/base/execution.h"
#include "core/mesh/mesh.h"

namespace planish {

// The topology of a mesh that is a disc. Faces and vertices keep the mesh's numbers. Errors as CheckDisc()
// (core/mesh/diagnosis.h).
absl::StatusOr<Topology> DiscTopology(const Mesh& mesh, const Execution& execution = {});

// As on the command line: "uzawa", "reduced", ... (in the order of the enumerators).
const char* Name(SolverType type);
const char* Name(SystemType type);
const char* Name(PreconditionerType type);
const char* Name(HessianType type);
const char* Name(BoundaryType type);

}  // namespace planish
