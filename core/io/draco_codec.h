// Draco bytes to and from meshes: the only file that knows Draco.
#pragma once

#include <cstdint>
#include <string>

#include "absl/status/statusor.h"
#include "core/mesh/mesh.h"

namespace planish {

// Encodes positions (rounded to float) and faces losslessly: sequential, no quantization, so that decoding gives back
// the same faces, corners and float bits in the same order (DESIGN.md, section 5).
// INVALID_ARGUMENT: no faces (MESH_EMPTY), an index out of range, a position that does not fit a float, or more
// vertices than 3F (the decoder refuses that: drop isolated vertices first).
absl::StatusOr<std::string> EncodeDraco(const Mesh& mesh);

// Decodes any Draco triangle mesh. Positions become double exactly. Never trusts the bytes: geometry type, one
// POSITION attribute of three floats and the index range are checked; positions may still be NaN or infinite.
// INVALID_ARGUMENT: MESH_DECODE_FAILED, MESH_NOT_A_MESH, MESH_EMPTY, MESH_POSITION_INVALID,
// MESH_INDEX_OUT_OF_RANGE; RESOURCE_EXHAUSTED: OUT_OF_MEMORY.
absl::StatusOr<Mesh> DecodeDraco(const std::string& bytes);

}  // namespace planish
