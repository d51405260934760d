#include "core/draco/library.h"

#include <utility>

#include "draco/compression/decode.h"
#include "draco/core/decoder_buffer.h"
#include "draco/core/encoder_buffer.h"

namespace planish {

absl::Status InvalidDraco(const std::string& reason, const std::string& message,
                          const std::map<std::string, std::string>& metadata) {
  return MakeError(absl::StatusCode::kInvalidArgument, reason, message, metadata);
}

absl::Status NotDraco(std::string_view bytes) {
  return InvalidDraco("MESH_DECODE_FAILED", "these " + std::to_string(bytes.size()) +
                                                " bytes are not Draco data: they need a Draco header at their start");
}

absl::StatusOr<std::unique_ptr<draco::Mesh>> OpenDraco(std::string_view bytes, bool keep_quantized) {
  draco::DecoderBuffer buffer;
  buffer.Init(bytes.data(), bytes.size());
  const auto type = draco::Decoder::GetEncodedGeometryType(&buffer);
  if (!type.ok() || type.value() == draco::INVALID_GEOMETRY_TYPE) {
    return NotDraco(bytes);
  }
  if (type.value() != draco::TRIANGULAR_MESH) {
    return InvalidDraco("MESH_NOT_A_MESH", "the Draco data hold a point cloud; only triangle meshes can be unwrapped");
  }
  draco::Decoder decoder;
  for (int t = 0; keep_quantized && t < draco::GeometryAttribute::NAMED_ATTRIBUTES_COUNT; ++t) {
    decoder.SetSkipAttributeTransform(static_cast<draco::GeometryAttribute::Type>(t));
  }
  auto decoded = decoder.DecodeMeshFromBuffer(&buffer);
  if (!decoded.ok()) {
    const std::string detail = decoded.status().error_msg_string();
    return InvalidDraco("MESH_DECODE_FAILED", "the Draco data are damaged or cut off (" + std::to_string(bytes.size()) +
                                                  " bytes" + (detail.empty() ? "" : "; Draco says: " + detail) + ")");
  }
  if (decoded.value()->num_faces() == 0) return InvalidDraco("MESH_EMPTY", "the Draco mesh has no faces");
  return std::move(decoded).value();
}

absl::StatusOr<std::vector<Face>> FacesOf(const draco::Mesh& mesh) {
  std::vector<Face> faces(mesh.num_faces());
  for (std::uint32_t f = 0; f < mesh.num_faces(); ++f) {
    for (int k = 0; k < 3; ++k) {
      const std::uint32_t point = mesh.face(draco::FaceIndex(f))[k].value();
      if (point >= mesh.num_points()) return IndexOutOfRange(f, point, mesh.num_points());
      faces[f][k] = static_cast<std::int32_t>(point);
    }
  }
  return faces;
}

bool IsBacked(const draco::PointAttribute& attribute, std::uint32_t num_points) {
  const std::int64_t size = attribute.num_components() * draco::DataTypeLength(attribute.data_type());
  if (attribute.buffer() == nullptr || size <= 0 || attribute.byte_stride() < size || attribute.byte_offset() < 0) {
    return false;
  }
  const std::uint64_t end = static_cast<std::uint64_t>(attribute.byte_offset()) +
                            static_cast<std::uint64_t>(attribute.byte_stride()) * attribute.size();
  const std::size_t entries = attribute.is_mapping_identity() ? attribute.size() : attribute.indices_map_size();
  return end <= attribute.buffer()->data_size() && entries >= num_points;
}

absl::Status IndexOutOfRange(std::int64_t face, std::int64_t vertex, std::int64_t count) {
  return InvalidDraco("MESH_INDEX_OUT_OF_RANGE",
                      "a face has the index " + std::to_string(vertex) + ", but the mesh has " + std::to_string(count) +
                          " vertices, numbered from 0",
                      {{"faces", std::to_string(face)}});
}

absl::Status CheckFaces(const std::vector<Face>& faces, std::int64_t count) {
  if (faces.empty()) return InvalidDraco("MESH_EMPTY", "the mesh has no faces");
  for (std::size_t f = 0; f < faces.size(); ++f) {
    for (const std::int32_t v : faces[f]) {
      if (v < 0 || v >= count) return IndexOutOfRange(static_cast<std::int64_t>(f), v, count);
    }
  }
  return absl::OkStatus();
}

void SetFaces(const std::vector<Face>& faces, draco::Mesh* mesh) {
  mesh->SetNumFaces(faces.size());
  for (std::size_t f = 0; f < faces.size(); ++f) {
    draco::Mesh::Face face;
    for (int k = 0; k < 3; ++k) face[k] = static_cast<std::uint32_t>(faces[f][k]);
    mesh->SetFace(draco::FaceIndex(static_cast<std::uint32_t>(f)), face);
  }
}

absl::StatusOr<std::string> EncodeInOrder(std::int64_t point_bytes, const draco::Mesh& mesh,
                                          draco::ExpertEncoder* encoder) {
  encoder->SetEncodingMethod(draco::MESH_SEQUENTIAL_ENCODING);
  // Entropy-coded differences of indices make the data up to a third smaller, take no more time, and keep the order.
  // But the decoder refuses data of less than 3 bytes a face, so the values of the points must take at least that.
  encoder->options().SetGlobalBool("compress_connectivity",
                                   point_bytes * std::int64_t{mesh.num_points()} >= 3 * std::int64_t{mesh.num_faces()});
  draco::EncoderBuffer buffer;
  const draco::Status status = encoder->EncodeToBuffer(&buffer);
  if (!status.ok()) return InternalError("Draco cannot encode the mesh: " + status.error_msg_string());
  return std::string(buffer.data(), buffer.size());
}

}  // namespace planish
