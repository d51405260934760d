// Draco meshes with all their attributes, one value per point. Thread-safe.
#pragma once

#include <cstdint>
#include <memory>
#include <string>
#include <vector>

#include "absl/status/statusor.h"
#include "core/mesh/mesh.h"

namespace planish {

// Kinds of attributes, numbered like draco::GeometryAttribute::Type.
enum class DracoKind { kPosition, kNormal, kColor, kTexcoord, kGeneric };

struct DracoAttribute {
  DracoKind kind = DracoKind::kGeneric;
  std::uint32_t unique_id = 0;  // the attribute's index if the file's ids are not unique (Draco before 1.0)
  int component = 0;            // Draco's number of the type; callers may set only kDracoFloat32
  int components = 0;           // numbers per value
  bool normalized = false;
  std::int64_t value_size = 0;  // bytes
  std::string values;           // value_size bytes per point
  // How the values were quantized before encoding. 0 bits: not at all.
  int quantization_bits = 0;
  std::vector<float> origin;  // one per component; empty for octahedral normals
  float range = 0;
};

extern const int kDracoFloat32;
// The number of a type in OpenGL and glTF (5120: byte, ..., 5126: float); 0 if they lack it.
int GlTypeOfDraco(int component);

struct DracoPoints {
  std::int64_t num_points = 0;
  std::vector<Face> faces;  // of points
  std::vector<DracoAttribute> attributes;
  std::shared_ptr<const void> metadata;  // of the file, for EncodeDracoPoints; may be null
};

// Decodes any Draco triangle mesh. Points and faces keep the order of the bytes. As with DecodeDraco
// (core/draco/codec.h), bytes are not trusted, and may take much time and memory. With `want_quantization`, decodes
// twice, the second time to find the quantization parameters.
// INVALID_ARGUMENT: MESH_DECODE_FAILED, MESH_NOT_A_MESH, MESH_EMPTY, MESH_INDEX_OUT_OF_RANGE; RESOURCE_EXHAUSTED:
// OUT_OF_MEMORY.
absl::StatusOr<DracoPoints> DecodeDracoPoints(const std::string& bytes, bool want_quantization);

// Encodes faces and points in their order. Sequential: Edgebreaker would reorder both and drop faces without area. An
// attribute with quantization_bits is quantized on the same grid again if that gives the same values, which is checked
// by decoding; otherwise it is stored exactly.
// INVALID_ARGUMENT: MESH_EMPTY, MESH_INDEX_OUT_OF_RANGE; OUTPUT_UNSUPPORTED for what Draco cannot hold (integers above
// 2^31; more points than three a face). RESOURCE_EXHAUSTED: OUT_OF_MEMORY.
absl::StatusOr<std::string> EncodeDracoPoints(const DracoPoints& points);

}  // namespace planish
