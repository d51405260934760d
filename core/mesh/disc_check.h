// Is this mesh a disc? If not, which element says no?
#pragma once

#include "absl/status/statusor.h"
#include "core/base/execution.h"
#include "core/mesh/mesh.h"
#include "core/mesh/topology.h"

namespace planish {

// The connectivity of `mesh` if it is a disc: manifold, consistently oriented, in one piece, with one boundary loop, no
// handles and no face without area. Vertices without a face are ignored (see CountIsolatedVertices).
//
// Otherwise INVALID_ARGUMENT. The first fault found, in this order, is the reason:
//   MESH_EMPTY  MESH_INDEX_OUT_OF_RANGE  MESH_POSITION_NOT_FINITE  MESH_FACE_DEGENERATE  MESH_FACE_DUPLICATE
//   MESH_EDGE_NON_MANIFOLD  MESH_NOT_ORIENTABLE  MESH_ORIENTATION_INCONSISTENT  MESH_VERTEX_NON_MANIFOLD
//   MESH_SEVERAL_COMPONENTS  MESH_CLOSED  MESH_SEVERAL_LOOPS  MESH_HAS_HANDLES
// The message names the first few elements; metadata has "count" and, as they apply, "faces" and "vertices"
// (comma-separated 0-based ids) and "edges" ("a-b,c-d", vertex ids), at most 16 of each.
//
// CANCELLED after an interrupt.
//
// O(F) time and memory.
absl::StatusOr<Topology> CheckDisc(const Mesh& mesh, const Execution& execution = {});

// The part of CheckDisc without which nothing can be done: MESH_EMPTY, MESH_INDEX_OUT_OF_RANGE and
// MESH_POSITION_NOT_FINITE (of vertices that faces refer to). O(F).
absl::Status CheckElements(const Mesh& mesh, const Execution& execution = {});

// Vertices that no face refers to. Indices must be in range.
std::int64_t CountIsolatedVertices(const Mesh& mesh);

// Whether the three points span no area at working precision: 2 area <= 1e-14 times the longest edge squared.
bool IsDegenerateTriangle(const Vec3& a, const Vec3& b, const Vec3& c);

}  // namespace planish
