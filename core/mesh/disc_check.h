// Is this mesh a disc? If not, which element says no?
#pragma once

#include "absl/status/status.h"
#include "core/base/execution.h"
#include "core/mesh/mesh.h"

namespace planish {

// OK if `mesh` is a disc: manifold, consistently oriented, in one piece, with one boundary loop, no handles and no face
// without area. Vertices without a face are ignored (see CountIsolatedVertices). ImportDisc() (core/mesh/import.h) has
// the mesh as well.
//
// Otherwise INVALID_ARGUMENT. The first fault found, in this order, is the reason:
//   MESH_EMPTY  MESH_INDEX_OUT_OF_RANGE  MESH_POSITION_NOT_FINITE  MESH_FACE_DEGENERATE  MESH_FACE_DUPLICATE
//   MESH_EDGE_NON_MANIFOLD  MESH_NOT_ORIENTABLE  MESH_ORIENTATION_INCONSISTENT  MESH_VERTEX_NON_MANIFOLD
//   MESH_SEVERAL_COMPONENTS  MESH_CLOSED  MESH_SEVERAL_LOOPS  MESH_HAS_HANDLES
// The message counts, but names no element. Metadata has "count" and, as they apply, "faces" and "vertices"
// (comma-separated 0-based ids) and "edges" ("a-b,c-d", vertex ids), at most 16 of each.
//
// CANCELLED after a cancellation.
//
// O(F) time and memory.
absl::Status CheckDisc(const Mesh& mesh, const Execution& execution = {});

// Vertices that no face refers to. Indices must be in range.
std::int64_t CountIsolatedVertices(const Mesh& mesh);

}  // namespace planish
