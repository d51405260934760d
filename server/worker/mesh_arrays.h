#pragma once

#include <cstdint>
#include <string_view>

#include "absl/status/statusor.h"
#include "core/mesh/mesh.h"

namespace planish {

// The mesh that planish.v1.MeshArrays holds: positions of `vertices` vertices and, right behind them, triangles. The
// same mesh that DecodeDraco() makes of a file that keeps the order of its vertices and faces; positions may be NaN or
// infinite. INVALID_ARGUMENT: MESH_EMPTY, MESH_INDEX_OUT_OF_RANGE with metadata "faces"; RESOURCE_EXHAUSTED:
// MESH_TOO_LARGE for more than indices can count; INTERNAL for bytes that are no such arrays.
absl::StatusOr<Mesh> ReadMeshArrays(std::string_view bytes, std::int64_t vertices);

}  // namespace planish
