// Draco meshes with all their attributes, one value per point. Thread-safe.
#pragma once

#include <cstdint>
#include <memory>
#include <string>
#include <vector>

#include "absl/status/statusor.h"
#include "core/mesh/mesh.h"

namespace planish {

// With the numbers of draco::GeometryAttribute::Type.
enum class DracoKind { kPosition, kNormal, kColor, kTexcoord, kGeneric };

struct DracoAttribute {
  DracoKind kind = DracoKind::kGeneric;
  std::uint32_t unique_id = 0;  // the number of the attribute where ids are not unique, as in files of Draco before 1.0
  int component = 0;   // Draco's number of the type; kDracoFloat32 is the only one that callers make themselves
  int components = 0;  // of a value
  bool normalized = false;
  std::int64_t value_size = 0;  // bytes
  std::string values;           // value_size bytes per point
  // How the values were rounded before they were encoded. 0 bits: not at all.
  int quantization_bits = 0;
  std::vector<float> origin;  // one per component; empty for octahedral normals
  float range = 0;
};

extern const int kDracoFloat32;
// The number that OpenGL and glTF have for a type (5120: byte, ..., 5126: float); 0 for one that they lack.
int GlTypeOfDraco(int component);

struct DracoPoints {
  std::int64_t num_points = 0;
  std::vector<Face> faces;  // of points
  std::vector<DracoAttribute> attributes;
  std::shared_ptr<const void> metadata;  // of the file, for EncodeDracoPoints; may be null
};

// Decodes any Draco triangle mesh. Points and faces keep the order of the decoded bytes. Bytes are not trusted, and may
// cost much, as for DecodeDraco (core/draco/codec.h). With `want_quantization` the bytes are decoded twice, the second
// time to find out how values were rounded.
// INVALID_ARGUMENT: MESH_DECODE_FAILED, MESH_NOT_A_MESH, MESH_EMPTY, MESH_INDEX_OUT_OF_RANGE; RESOURCE_EXHAUSTED:
// OUT_OF_MEMORY.
absl::StatusOr<DracoPoints> DecodeDracoPoints(const std::string& bytes, bool want_quantization);

// Encodes faces and points in their order (sequential: Edgebreaker would reorder both, drop faces without area and with
// them the promise that no face is lost). An attribute with quantization_bits is rounded on the same grid again if
// that gives back the same bytes, which is checked by decoding; any other is kept to the bit.
// INVALID_ARGUMENT: MESH_EMPTY, MESH_INDEX_OUT_OF_RANGE; OUTPUT_UNSUPPORTED for what Draco cannot hold (integers above
// 2^31; more points than three a face). RESOURCE_EXHAUSTED: OUT_OF_MEMORY.
absl::StatusOr<std::string> EncodeDracoPoints(const DracoPoints& points);

}  // namespace planish
