// Draco bytes to and from meshes. Thread-safe.
#pragma once

#include <cstdint>
#include <limits>
#include <string>
#include <string_view>

#include "absl/status/statusor.h"
#include "core/mesh/mesh.h"

namespace planish {

// Encodes positions (rounded to float) and faces losslessly: sequential, no quantization, so that decoding gives back
// the same faces, corners and float bits in the same order; duplicate and degenerate faces, NaN and infinities
// included. 12 bytes a vertex and about 2 to 8 a face, as entropy coding goes.
// INVALID_ARGUMENT: no faces (MESH_EMPTY), an index out of range (MESH_INDEX_OUT_OF_RANGE), a finite position that does
// not fit a float (MESH_POSITION_INVALID), more than 2^31 / 3 faces (MESH_TOO_LARGE), or more vertices than 3F
// (MESH_DECODE_FAILED: the decoder refuses that; drop isolated vertices first). RESOURCE_EXHAUSTED: OUT_OF_MEMORY.
absl::StatusOr<std::string> EncodeDraco(const Mesh& mesh);

// What a decoded mesh may have; by default what indices can count.
struct DracoLimits {
  std::int64_t max_faces = std::numeric_limits<std::int32_t>::max() / 3;
  std::int64_t max_vertices = std::numeric_limits<std::int32_t>::max();
};

// Decodes any Draco triangle mesh, sequential or Edgebreaker. Faces and corners keep the order of the decoded bytes.
// Positions become double exactly. The vertices are the values of the POSITION attribute, so that seams of normals or
// texture coordinates do not tear the mesh; where sequential data with other attributes had to repeat a position for
// each point, points at the same position (to the bit) that all differ in another attribute are one vertex again.
//
// Never trusts the bytes: geometry type, one POSITION attribute of three floats and the index range are checked;
// positions may still be NaN or infinite. `limits` hold for what the first bytes declare, before anything is decoded or
// allocated (core/draco/header.h; points count as vertices there), and again for what was decoded. The cost is not
// checked: Draco itself demands 3 bytes a face of sequential data, but the entropy coding of Edgebreaker and of
// quantized values sets no bound to what a few bytes may rightly hold. A damaged file of 1.5 KB took 13 s and 600 MB:
// call this where time and memory are limited.
// INVALID_ARGUMENT: MESH_DECODE_FAILED, MESH_NOT_A_MESH, MESH_EMPTY, MESH_POSITION_INVALID,
// MESH_INDEX_OUT_OF_RANGE; RESOURCE_EXHAUSTED: OUT_OF_MEMORY, and MESH_TOO_LARGE with metadata "element" ("faces" or
// "vertices"), "declared" (how many, before or after) and "limit".
absl::StatusOr<Mesh> DecodeDraco(std::string_view bytes, const DracoLimits& limits = {});

}  // namespace planish
