#include "tests/testing/discs.h"

#include <vector>

#include "core/base/status_macros.h"
#include "core/mesh/import.h"

namespace planish {

absl::StatusOr<Topology> DiscTopology(const Mesh& mesh, const Execution& execution) {
  PLANISH_ASSIGN_OR_RETURN(const FlatImport disc, ImportDisc(mesh, execution));
  std::vector<std::int32_t> order;
  const Topology sorted = MakeTopology(disc.mesh, &order, execution);
  if (execution.IsCancelled()) return absl::CancelledError("cancelled");
  Topology topology = sorted;
  for (std::int32_t c = 0; c < sorted.num_corners(); ++c) {
    const std::int32_t o = sorted.opposite[c];
    topology.opposite[3 * order[c / 3] + c % 3] = o < 0 ? -1 : 3 * order[o / 3] + o % 3;
  }
  // Import leaves out vertices without a face.
  std::vector<std::int32_t> rows = RowVertices(sorted);
  for (std::int32_t& v : rows) v = disc.source[v];
  topology.num_vertices = static_cast<std::int32_t>(mesh.num_vertices());
  topology.faces = mesh.faces;
  AssignRows(rows, &topology);
  return topology;
}

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

}  // namespace planish
