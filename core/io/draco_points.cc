#include "core/io/draco_points.h"

#include <algorithm>
#include <cstring>
#include <new>
#include <set>
#include <stdexcept>

#include "core/base/error.h"
#include "core/base/status_macros.h"
#include "core/io/number.h"
#include "draco/attributes/attribute_octahedron_transform.h"
#include "draco/attributes/attribute_quantization_transform.h"
#include "draco/compression/decode.h"
#include "draco/compression/expert_encode.h"
#include "draco/core/decoder_buffer.h"
#include "draco/core/encoder_buffer.h"
#include "draco/mesh/mesh.h"

namespace planish {

const int kDracoFloat32 = draco::DT_FLOAT32;

int GlTypeOfDraco(int component) {
  switch (component) {
    case draco::DT_INT8:
      return 5120;
    case draco::DT_UINT8:
      return 5121;
    case draco::DT_INT16:
      return 5122;
    case draco::DT_UINT16:
      return 5123;
    case draco::DT_UINT32:
      return 5125;
    case draco::DT_FLOAT32:
      return 5126;
    default:
      return 0;
  }
}

namespace {

absl::Status Invalid(const std::string& reason, const std::string& message) {
  return MakeError(absl::StatusCode::kInvalidArgument, reason, message);
}

DracoKind KindOf(draco::GeometryAttribute::Type type) {
  switch (type) {
    case draco::GeometryAttribute::POSITION:
      return DracoKind::kPosition;
    case draco::GeometryAttribute::NORMAL:
      return DracoKind::kNormal;
    case draco::GeometryAttribute::COLOR:
      return DracoKind::kColor;
    case draco::GeometryAttribute::TEX_COORD:
      return DracoKind::kTexcoord;
    default:
      return DracoKind::kGeneric;
  }
}

draco::GeometryAttribute::Type TypeOf(DracoKind kind) {
  switch (kind) {
    case DracoKind::kPosition:
      return draco::GeometryAttribute::POSITION;
    case DracoKind::kNormal:
      return draco::GeometryAttribute::NORMAL;
    case DracoKind::kColor:
      return draco::GeometryAttribute::COLOR;
    case DracoKind::kTexcoord:
      return draco::GeometryAttribute::TEX_COORD;
    case DracoKind::kGeneric:
      break;
  }
  return draco::GeometryAttribute::GENERIC;
}

// With `raw`, quantized values stay integers and carry how they were rounded.
absl::StatusOr<std::unique_ptr<draco::Mesh>> Decode(const std::string& bytes, bool raw) {
  draco::DecoderBuffer buffer;
  buffer.Init(bytes.data(), bytes.size());
  const auto type = draco::Decoder::GetEncodedGeometryType(&buffer);
  if (!type.ok() || type.value() == draco::INVALID_GEOMETRY_TYPE) {
    return Invalid("MESH_DECODE_FAILED", "these " + std::to_string(bytes.size()) +
                                             " bytes are not Draco data: they need a Draco header at their start");
  }
  if (type.value() != draco::TRIANGULAR_MESH) {
    return Invalid("MESH_NOT_A_MESH", "the Draco data hold a point cloud; only triangle meshes can be unwrapped");
  }
  draco::Decoder decoder;
  if (raw) {
    for (int t = 0; t < draco::GeometryAttribute::NAMED_ATTRIBUTES_COUNT; ++t) {
      decoder.SetSkipAttributeTransform(static_cast<draco::GeometryAttribute::Type>(t));
    }
  }
  auto decoded = decoder.DecodeMeshFromBuffer(&buffer);
  if (!decoded.ok()) {
    return Invalid("MESH_DECODE_FAILED", "the Draco data are damaged or cut off (" + std::to_string(bytes.size()) +
                                             " bytes; Draco says: " + decoded.status().error_msg_string() + ")");
  }
  return std::move(decoded).value();
}

absl::StatusOr<DracoAttribute> CopyAttribute(const draco::PointAttribute& source, std::uint32_t num_points) {
  DracoAttribute attribute;
  attribute.kind = KindOf(source.attribute_type());
  attribute.unique_id = source.unique_id();
  attribute.component = source.data_type();
  attribute.components = source.num_components();
  attribute.normalized = source.normalized();
  attribute.value_size = std::int64_t{source.num_components()} * draco::DataTypeLength(source.data_type());
  const absl::Status damaged = Invalid("MESH_DECODE_FAILED", "an attribute of the Draco mesh is damaged");
  if (source.buffer() == nullptr || attribute.value_size <= 0 || source.byte_stride() < attribute.value_size ||
      source.byte_offset() < 0) {
    return damaged;
  }
  const std::uint64_t end = static_cast<std::uint64_t>(source.byte_offset()) +
                            static_cast<std::uint64_t>(source.byte_stride()) * source.size();
  const std::size_t entries = source.is_mapping_identity() ? source.size() : source.indices_map_size();
  if (end > source.buffer()->data_size() || entries < num_points) return damaged;
  attribute.values.resize(static_cast<std::size_t>(attribute.value_size) * num_points);
  for (std::uint32_t p = 0; p < num_points; ++p) {
    const draco::AttributeValueIndex value = source.mapped_index(draco::PointIndex(p));
    if (value.value() >= source.size()) return damaged;
    std::memcpy(attribute.values.data() + attribute.value_size * p, source.GetAddress(value),
                static_cast<std::size_t>(attribute.value_size));
  }
  return attribute;
}

void CopyQuantization(const draco::PointAttribute& raw, DracoAttribute* attribute) {
  if (raw.GetAttributeTransformData() == nullptr || attribute->component != draco::DT_FLOAT32) return;
  draco::AttributeQuantizationTransform quantization;
  draco::AttributeOctahedronTransform octahedron;
  if (quantization.InitFromAttribute(raw)) {
    attribute->quantization_bits = quantization.quantization_bits();
    attribute->origin = quantization.min_values();
    attribute->range = quantization.range();
    if (static_cast<int>(attribute->origin.size()) != attribute->components) attribute->quantization_bits = 0;
  } else if (attribute->kind == DracoKind::kNormal && octahedron.InitFromAttribute(raw)) {
    attribute->quantization_bits = octahedron.quantization_bits();
  }
}

absl::StatusOr<DracoPoints> DecodeOrThrow(const std::string& bytes, bool want_quantization) {
  PLANISH_ASSIGN_OR_RETURN(const std::unique_ptr<draco::Mesh> decoded, Decode(bytes, false));
  if (decoded->num_faces() == 0) return Invalid("MESH_EMPTY", "the Draco mesh has no faces");
  DracoPoints points;
  points.num_points = decoded->num_points();
  points.faces.resize(decoded->num_faces());
  for (std::uint32_t f = 0; f < decoded->num_faces(); ++f) {
    const draco::Mesh::Face& face = decoded->face(draco::FaceIndex(f));
    for (int k = 0; k < 3; ++k) {
      if (face[k].value() >= decoded->num_points()) {
        return Invalid("MESH_INDEX_OUT_OF_RANGE", "face " + std::to_string(f) + " of the Draco mesh refers to point " +
                                                      std::to_string(face[k].value()) + " of " +
                                                      std::to_string(decoded->num_points()));
      }
      points.faces[f][k] = static_cast<std::int32_t>(face[k].value());
    }
  }
  for (int id = 0; id < decoded->num_attributes(); ++id) {
    PLANISH_ASSIGN_OR_RETURN(DracoAttribute attribute, CopyAttribute(*decoded->attribute(id), decoded->num_points()));
    points.attributes.push_back(std::move(attribute));
  }
  std::set<std::uint32_t> ids;
  for (const DracoAttribute& attribute : points.attributes) ids.insert(attribute.unique_id);
  for (std::size_t i = 0; ids.size() < points.attributes.size() && i < points.attributes.size(); ++i) {
    points.attributes[i].unique_id = static_cast<std::uint32_t>(i);
  }
  if (decoded->GetMetadata() != nullptr) {
    points.metadata = std::make_shared<const draco::GeometryMetadata>(*decoded->GetMetadata());
  }
  if (!want_quantization) return points;
  PLANISH_ASSIGN_OR_RETURN(const std::unique_ptr<draco::Mesh> raw, Decode(bytes, true));
  for (int id = 0; id < std::min(raw->num_attributes(), decoded->num_attributes()); ++id) {
    CopyQuantization(*raw->attribute(id), &points.attributes[static_cast<std::size_t>(id)]);
  }
  return points;
}

// As text with all digits: SetAttributeExplicitQuantization keeps six decimals of its floats, so that values would come
// back changed.
draco::Options QuantizationOptions(const DracoAttribute& attribute) {
  draco::Options options;
  options.SetInt("quantization_bits", attribute.quantization_bits);
  if (attribute.origin.empty()) return options;
  std::string origin;
  for (const float value : attribute.origin) {
    if (!origin.empty()) origin += ' ';
    AppendShortest(value, &origin);
  }
  std::string range;
  AppendShortest(attribute.range, &range);
  options.SetString("quantization_origin", origin);
  options.SetString("quantization_range", range);
  return options;
}

absl::StatusOr<std::string> Encode(const DracoPoints& points, const std::vector<bool>& quantize) {
  draco::Mesh mesh;
  mesh.set_num_points(static_cast<std::uint32_t>(points.num_points));
  std::int64_t point_bytes = 0;
  for (const DracoAttribute& attribute : points.attributes) {
    draco::GeometryAttribute shape;
    shape.Init(TypeOf(attribute.kind), nullptr, static_cast<std::int8_t>(attribute.components),
               static_cast<draco::DataType>(attribute.component), attribute.normalized, attribute.value_size, 0);
    const int id = mesh.AddAttribute(shape, true, static_cast<std::uint32_t>(points.num_points));
    for (std::int64_t p = 0; p < points.num_points; ++p) {
      mesh.attribute(id)->SetAttributeValue(draco::AttributeValueIndex(static_cast<std::uint32_t>(p)),
                                            attribute.values.data() + p * attribute.value_size);
    }
    mesh.attribute(id)->set_unique_id(attribute.unique_id);
    if (!quantize[static_cast<std::size_t>(id)]) point_bytes += attribute.value_size;
  }
  mesh.SetNumFaces(points.faces.size());
  for (std::size_t f = 0; f < points.faces.size(); ++f) {
    draco::Mesh::Face face;
    for (int k = 0; k < 3; ++k) face[k] = static_cast<std::uint32_t>(points.faces[f][k]);
    mesh.SetFace(draco::FaceIndex(static_cast<std::uint32_t>(f)), face);
  }
  if (points.metadata != nullptr) {
    mesh.AddMetadata(
        std::make_unique<draco::GeometryMetadata>(*static_cast<const draco::GeometryMetadata*>(points.metadata.get())));
  }
  draco::ExpertEncoder encoder(mesh);
  encoder.SetEncodingMethod(draco::MESH_SEQUENTIAL_ENCODING);
  for (std::size_t i = 0; i < points.attributes.size(); ++i) {
    const DracoAttribute& attribute = points.attributes[i];
    if (!quantize[i]) continue;
    encoder.options().SetAttributeOptions(static_cast<int>(i), QuantizationOptions(attribute));
  }
  // As in EncodeDraco: the decoder refuses data of fewer than 3 bytes a face.
  encoder.options().SetGlobalBool(
      "compress_connectivity", point_bytes * points.num_points >= 3 * static_cast<std::int64_t>(points.faces.size()));
  draco::EncoderBuffer buffer;
  const draco::Status status = encoder.EncodeToBuffer(&buffer);
  if (!status.ok()) return InternalError("Draco cannot encode the mesh: " + status.error_msg_string());
  return std::string(buffer.data(), buffer.size());
}

absl::Status CheckEncodable(const DracoPoints& points) {
  if (points.faces.empty()) return Invalid("MESH_EMPTY", "the mesh has no faces");
  for (const Face& face : points.faces) {
    for (const std::int32_t point : face) {
      if (point < 0 || point >= points.num_points) {
        return Invalid("MESH_INDEX_OUT_OF_RANGE", "a face refers to point " + std::to_string(point));
      }
    }
  }
  return absl::OkStatus();
}

// Which attributes of `points` come back from `bytes` as they are; nothing if the faces do not.
std::vector<bool> KeptBy(const std::string& bytes, const DracoPoints& points) {
  const absl::StatusOr<DracoPoints> again = DecodeOrThrow(bytes, false);
  if (!again.ok() || again->faces != points.faces || again->attributes.size() != points.attributes.size()) return {};
  std::vector<bool> kept;
  for (std::size_t i = 0; i < points.attributes.size(); ++i) {
    kept.push_back(again->attributes[i].values == points.attributes[i].values);
  }
  return kept;
}

absl::StatusOr<std::string> EncodeOrThrow(const DracoPoints& points) {
  std::vector<bool> quantize;
  for (const DracoAttribute& attribute : points.attributes) quantize.push_back(attribute.quantization_bits > 0);
  // What was rounded must come back as it is; where it does not, it is not rounded the next time.
  for (int attempt = 0; attempt < 3; ++attempt) {
    absl::StatusOr<std::string> bytes = Encode(points, quantize);
    // What is not finite cannot be rounded; without rounding all but integers above 2^31 can be encoded.
    const std::vector<bool> kept = bytes.ok() ? KeptBy(*bytes, points) : std::vector<bool>();
    if (!kept.empty() && std::find(kept.begin(), kept.end(), false) == kept.end()) return bytes;
    for (std::size_t i = 0; i < quantize.size(); ++i) {
      quantize[i] = quantize[i] && attempt == 0 && !kept.empty() && kept[i];
    }
  }
  return Invalid("OUTPUT_UNSUPPORTED", "Draco cannot hold the values of this mesh: it does not give back the " +
                                           std::to_string(points.num_points) + " points that it is given");
}

absl::Status OutOfMemory(const char* doing) {
  return MakeError(absl::StatusCode::kResourceExhausted, "OUT_OF_MEMORY",
                   std::string("not enough memory to ") + doing + " the mesh");
}

}  // namespace

absl::StatusOr<DracoPoints> DecodeDracoPoints(const std::string& bytes, bool want_quantization) {
  try {
    return DecodeOrThrow(bytes, want_quantization);
  } catch (const std::bad_alloc&) {
    return OutOfMemory("decode");
  } catch (const std::length_error&) {
    return OutOfMemory("decode");
  }
}

absl::StatusOr<std::string> EncodeDracoPoints(const DracoPoints& points) {
  PLANISH_RETURN_IF_ERROR(CheckEncodable(points));
  try {
    return EncodeOrThrow(points);
  } catch (const std::bad_alloc&) {
    return OutOfMemory("encode");
  } catch (const std::length_error&) {
    return OutOfMemory("encode");
  }
}

}  // namespace planish
