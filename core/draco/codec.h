// Converts between Draco bytes and meshes. Thread-safe.
#pragma once

#include <cstdint>
#include <limits>
#include <string>
#include <string_view>

#include "absl/status/statusor.h"
#include "core/mesh/mesh.h"

namespace planish {

// Encodes positions (rounded to float) and faces losslessly: sequential, no quantization. Decoding gives the same
// faces, corners and float bits in the same order, including duplicate and degenerate faces, NaN and infinities. Takes
// 12 bytes a vertex and about 2 to 8 a face.
//
// INVALID_ARGUMENT: no faces (MESH_EMPTY), an index out of range (MESH_INDEX_OUT_OF_RANGE), a finite position that does
// not fit a float (MESH_POSITION_INVALID), more than 2^31 / 3 faces (MESH_TOO_LARGE), or more vertices than 3F
// (MESH_DECODE_FAILED: the decoder refuses that; drop isolated vertices first). RESOURCE_EXHAUSTED: OUT_OF_MEMORY.
absl::StatusOr<std::string> EncodeDraco(const Mesh& mesh);

// Limits of a decoded mesh; the defaults are the range of the indices.
struct DracoLimits {
  std::int64_t max_faces = std::numeric_limits<std::int32_t>::max() / 3;
  std::int64_t max_vertices = std::numeric_limits<std::int32_t>::max();
};

// Decodes any Draco triangle mesh, sequential or Edgebreaker. Faces and corners keep the order of the bytes. Positions
// become double exactly. Vertices are the values of the POSITION attribute, so seams of normals or texture coordinates
// do not tear the mesh. Sequential data with other attributes repeats a position for each point; there, points at the
// same position (to the bit) that all differ in another attribute become one vertex again.
//
// Never trusts the bytes: checks the geometry type, that POSITION has three floats, and the range of indices. Positions
// may still be NaN or infinite. `limits` apply to the counts that the first bytes declare, before anything is decoded
// or allocated (core/draco/header.h; points count as vertices there), and again to the decoded mesh. The cost is not
// checked: Draco demands 3 bytes a face of sequential data, but a few bytes of Edgebreaker or quantized values may hold
// any amount. A damaged file of 1.5 KB took 13 s and 600 MB, so call this only where time and memory are limited.
// INVALID_ARGUMENT: MESH_DECODE_FAILED, MESH_NOT_A_MESH, MESH_EMPTY, MESH_POSITION_INVALID, MESH_INDEX_OUT_OF_RANGE.
// RESOURCE_EXHAUSTED: OUT_OF_MEMORY, and MESH_TOO_LARGE with metadata "element" ("faces" or "vertices"), "declared"
// (the count, declared or decoded) and "limit".
absl::StatusOr<Mesh> DecodeDraco(std::string_view bytes, const DracoLimits& limits = {});

}  // namespace planish
