#include "core/draco/points.h"

#include <algorithm>
#include <cstring>
#include <set>
#include <utility>

#include "core/base/number.h"
#include "core/base/status_macros.h"
#include "core/draco/library.h"
#include "draco/attributes/attribute_octahedron_transform.h"
#include "draco/attributes/attribute_quantization_transform.h"
#include "draco/compression/expert_encode.h"
#include "draco/mesh/mesh.h"

namespace planish {

const int kDracoFloat32 = draco::DT_FLOAT32;

int GlTypeOfDraco(int component) {
  constexpr std::pair<int, int> kTypes[] = {{draco::DT_INT8, 5120},   {draco::DT_UINT8, 5121},
                                            {draco::DT_INT16, 5122},  {draco::DT_UINT16, 5123},
                                            {draco::DT_UINT32, 5125}, {draco::DT_FLOAT32, 5126}};
  for (const auto& [type, gl_type] : kTypes) {
    if (type == component) return gl_type;
  }
  return 0;
}

namespace {

// DracoKind has the numbers of Draco's own types.
static_assert(static_cast<int>(DracoKind::kPosition) == draco::GeometryAttribute::POSITION);
static_assert(static_cast<int>(DracoKind::kTexcoord) == draco::GeometryAttribute::TEX_COORD);
static_assert(static_cast<int>(DracoKind::kGeneric) == draco::GeometryAttribute::GENERIC);

absl::StatusOr<DracoAttribute> CopyAttribute(const draco::PointAttribute& source, std::uint32_t num_points) {
  DracoAttribute attribute;
  const auto type = source.attribute_type();
  const bool is_named = type >= 0 && type < draco::GeometryAttribute::GENERIC;
  attribute.kind = is_named ? static_cast<DracoKind>(type) : DracoKind::kGeneric;
  attribute.unique_id = source.unique_id();
  attribute.component = source.data_type();
  attribute.components = source.num_components();
  attribute.normalized = source.normalized();
  attribute.value_size = std::int64_t{source.num_components()} * draco::DataTypeLength(source.data_type());
  const absl::Status damaged = InvalidDraco("MESH_DECODE_FAILED", "an attribute of the Draco mesh is damaged");
  if (!IsBacked(source, num_points)) return damaged;
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

absl::StatusOr<DracoPoints> CheckAndDecode(const std::string& bytes, bool want_quantization) {
  PLANISH_ASSIGN_OR_RETURN(const std::unique_ptr<draco::Mesh> decoded, OpenDraco(bytes));
  DracoPoints points;
  points.num_points = decoded->num_points();
  PLANISH_ASSIGN_OR_RETURN(points.faces, FacesOf(*decoded));
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
  PLANISH_ASSIGN_OR_RETURN(const std::unique_ptr<draco::Mesh> raw, OpenDraco(bytes, true));
  for (int id = 0; id < std::min(raw->num_attributes(), decoded->num_attributes()); ++id) {
    CopyQuantization(*raw->attribute(id), &points.attributes[static_cast<std::size_t>(id)]);
  }
  return points;
}

// The quantization as options of the encoder. Floats are text with all digits: SetAttributeExplicitQuantization would
// keep only six decimals, which would change the values.
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
  draco::ExpertEncoder encoder(mesh);
  mesh.set_num_points(static_cast<std::uint32_t>(points.num_points));
  std::int64_t point_bytes = 0;
  for (const DracoAttribute& attribute : points.attributes) {
    draco::GeometryAttribute shape;
    shape.Init(static_cast<draco::GeometryAttribute::Type>(attribute.kind), nullptr,
               static_cast<std::int8_t>(attribute.components), static_cast<draco::DataType>(attribute.component),
               attribute.normalized, attribute.value_size, 0);
    const int id = mesh.AddAttribute(shape, true, mesh.num_points());
    for (std::uint32_t p = 0; p < mesh.num_points(); ++p) {
      mesh.attribute(id)->SetAttributeValue(draco::AttributeValueIndex(p),
                                            attribute.values.data() + p * attribute.value_size);
    }
    mesh.attribute(id)->set_unique_id(attribute.unique_id);
    if (quantize[static_cast<std::size_t>(id)]) {
      encoder.options().SetAttributeOptions(id, QuantizationOptions(attribute));
    } else {
      point_bytes += attribute.value_size;
    }
  }
  SetFaces(points.faces, &mesh);
  if (points.metadata != nullptr) {
    mesh.AddMetadata(
        std::make_unique<draco::GeometryMetadata>(*static_cast<const draco::GeometryMetadata*>(points.metadata.get())));
  }
  return EncodeInOrder(point_bytes, mesh, &encoder);
}

absl::StatusOr<std::string> EncodeAndCompare(const DracoPoints& points) {
  std::vector<bool> quantize;
  for (const DracoAttribute& attribute : points.attributes) quantize.push_back(attribute.quantization_bits > 0);
  // Quantized values must decode to the same values. Attributes that do not are not quantized in the next attempt.
  for (int attempt = 0; attempt < 3; ++attempt) {
    absl::StatusOr<std::string> bytes = Encode(points, quantize);
    absl::StatusOr<DracoPoints> again;  // none if `bytes` is an error
    if (bytes.ok()) again = CheckAndDecode(*bytes, false);
    const bool has_all = again.ok() && again->faces == points.faces && !quantize.empty() &&
                         again->attributes.size() == points.attributes.size();
    bool is_kept = has_all;
    // Infinities and NaN cannot be quantized. Without quantization everything but integers above 2^31 can be encoded.
    for (std::size_t i = 0; i < quantize.size(); ++i) {
      const bool comes_back = has_all && again->attributes[i].values == points.attributes[i].values;
      quantize[i] = quantize[i] && attempt == 0 && comes_back;
      is_kept = is_kept && comes_back;
    }
    if (is_kept) return bytes;
  }
  return InvalidDraco("OUTPUT_UNSUPPORTED", "Draco cannot hold the values of this mesh: it does not give back the " +
                                                std::to_string(points.num_points) + " points that it is given");
}

}  // namespace

absl::StatusOr<DracoPoints> DecodeDracoPoints(const std::string& bytes, bool want_quantization) {
  return CatchOutOfMemory("decode", [&] { return CheckAndDecode(bytes, want_quantization); });
}

absl::StatusOr<std::string> EncodeDracoPoints(const DracoPoints& points) {
  PLANISH_RETURN_IF_ERROR(CheckFaces(points.faces, points.num_points));
  return CatchOutOfMemory("encode", [&] { return EncodeAndCompare(points); });
}

}  // namespace planish
