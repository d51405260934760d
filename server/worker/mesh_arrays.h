#pragma once

#include <cstdint>
#include <string_view>

#include "absl/status/statusor.h"
#include "core/mesh/mesh.h"

namespace planish {

// Reads the mesh in planish.v1.MeshArrays: the positions of `vertices` vertices, followed by triangles. The result is
// the mesh that DecodeDraco() makes from a file that keeps the order of vertices and faces. Positions may be NaN or
// infinite. INVALID_ARGUMENT: MESH_EMPTY, MESH_INDEX_OUT_OF_RANGE with metadata "faces"; RESOURCE_EXHAUSTED:
// MESH_TOO_LARGE for more elements than indices can count; INTERNAL if the length of `bytes` is wrong.
absl::StatusOr<Mesh> ReadMeshArrays(std::string_view bytes, std::int64_t vertices);

}  // namespace planish
