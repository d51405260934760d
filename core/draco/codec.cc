#include "core/draco/codec.h"

#include <array>
#include <cstring>
#include <memory>
#include <set>
#include <vector>

#include "core/base/radix_sort.h"
#include "core/base/status_macros.h"
#include "core/draco/header.h"
#include "core/draco/library.h"
#include "core/mesh/half_edges.h"
#include "draco/compression/expert_encode.h"
#include "draco/mesh/mesh.h"

namespace planish {
namespace {

using Point = std::array<float, 3>;

absl::Status CheckCount(const std::string& element, std::int64_t count, std::int64_t limit) {
  if (count <= limit) return absl::OkStatus();
  return MakeError(absl::StatusCode::kResourceExhausted, "MESH_TOO_LARGE",
                   "the Draco mesh has " + std::to_string(count) + " " + element + ", more than the limit of " +
                       std::to_string(limit),
                   {{"element", element}, {"declared", std::to_string(count)}, {"limit", std::to_string(limit)}});
}

absl::Status CheckCounts(std::int64_t faces, std::int64_t vertices, const DracoLimits& limits) {
  PLANISH_RETURN_IF_ERROR(CheckCount("faces", faces, limits.max_faces));
  return CheckCount("vertices", vertices, limits.max_vertices);
}

absl::Status CheckEncodable(const Mesh& mesh) {
  if (mesh.num_faces() > std::numeric_limits<std::int32_t>::max() / 3) {
    return InvalidDraco("MESH_TOO_LARGE", "the mesh has " + std::to_string(mesh.num_faces()) +
                                              " triangles, Draco takes 715827882 at most");
  }
  PLANISH_RETURN_IF_ERROR(CheckFaces(mesh.faces, mesh.num_vertices()));
  if (mesh.num_vertices() > 3 * mesh.num_faces()) {
    return InvalidDraco("MESH_DECODE_FAILED",
                        "the mesh has " + std::to_string(mesh.num_vertices()) + " vertices for " +
                            std::to_string(mesh.num_faces()) +
                            " triangles; a Draco decoder refuses more than three a triangle: leave "
                            "out vertices without a face");
  }
  for (std::int64_t v = 0; v < mesh.num_vertices(); ++v) {
    // The mesh check reports NaN and infinity: it lists all vertices that have them.
    const double largest = mesh.positions[v].array().isFinite().select(mesh.positions[v].array().abs(), 0.0).maxCoeff();
    if (static_cast<double>(static_cast<float>(largest)) > std::numeric_limits<float>::max()) {
      return InvalidDraco("MESH_POSITION_INVALID",
                          "a vertex lies outside the range of float (3.4e38); scale the mesh down",
                          {{"vertices", std::to_string(v)}});
    }
  }
  return absl::OkStatus();
}

absl::StatusOr<const draco::PointAttribute*> PositionOf(const draco::Mesh& mesh) {
  const int count = mesh.NumNamedAttributes(draco::GeometryAttribute::POSITION);
  if (count != 1) {
    return InvalidDraco("MESH_POSITION_INVALID",
                        "the Draco mesh has " + std::to_string(count) + " POSITION attributes, it needs exactly one");
  }
  const draco::PointAttribute* position = mesh.GetNamedAttribute(draco::GeometryAttribute::POSITION);
  if (position->num_components() != 3 || position->data_type() != draco::DT_FLOAT32) {
    return InvalidDraco("MESH_POSITION_INVALID",
                        "the POSITION attribute of the Draco mesh must have three components of type FLOAT32; it has " +
                            std::to_string(position->num_components()) + " of Draco type " +
                            std::to_string(position->data_type()));
  }
  if (!IsBacked(*position, mesh.num_points())) {
    return InvalidDraco("MESH_POSITION_INVALID", "the Draco mesh has fewer positions than its points refer to");
  }
  return position;
}

// The bytes of all attributes of a point except POSITION.
std::string OtherValues(const draco::Mesh& mesh, std::uint32_t point) {
  std::string values;
  for (int id = 0; id < mesh.num_attributes(); ++id) {
    const draco::PointAttribute& attribute = *mesh.attribute(id);
    if (attribute.attribute_type() == draco::GeometryAttribute::POSITION) continue;
    const draco::AttributeValueIndex value = attribute.mapped_index(draco::PointIndex(point));
    if (!IsBacked(attribute, mesh.num_points()) || value.value() >= attribute.size()) continue;
    values.append(reinterpret_cast<const char*>(attribute.GetAddress(value)),
                  static_cast<std::size_t>(attribute.num_components()) * draco::DataTypeLength(attribute.data_type()));
  }
  return values;
}

// An encoder that knows only points (one position, normal and UV each) splits a vertex whose other attributes have
// several values. Joins such vertices again: those at the same position (to the bit) that all differ in another
// attribute. Vertices at the same position that are alike in everything were kept apart on purpose, at a cut of the
// surface.
void JoinSplitPoints(const draco::Mesh& decoded, Mesh* mesh) {
  const std::int64_t vertices = mesh->num_vertices();
  const auto compare = [&](std::int32_t a, std::int32_t b) {
    return std::memcmp(mesh->positions[a].data(), mesh->positions[b].data(), sizeof(Vec3));
  };
  const std::vector<std::int32_t> order =
      SortedIndices(vertices, [&](std::int32_t a, std::int32_t b) { return compare(a, b) < 0; });
  std::vector<std::int32_t> number = Indices(vertices);  // the vertex it is joined with, then its new number
  for (std::int64_t begin = 0, end = 0; begin < vertices; begin = end) {
    std::set<std::string> others;
    for (end = begin; end < vertices && compare(order[begin], order[end]) == 0; ++end) {
      if (end > begin && others.empty()) others.insert(OtherValues(decoded, order[begin]));
      if (end > begin) others.insert(OtherValues(decoded, order[end]));
    }
    if (static_cast<std::int64_t>(others.size()) != end - begin) continue;
    for (std::int64_t i = begin; i < end; ++i) number[order[i]] = order[begin];
  }
  const std::int32_t count = NumberByFirst(vertices, &number);
  for (std::int64_t v = 0; v < vertices; ++v) mesh->positions[number[v]] = mesh->positions[v];
  mesh->positions.resize(count);
  for (Face& face : mesh->faces) {
    for (std::int32_t& vertex : face) vertex = number[vertex];
  }
}

absl::StatusOr<Mesh> FromDraco(const draco::Mesh& decoded, const DracoLimits& limits) {
  PLANISH_ASSIGN_OR_RETURN(const draco::PointAttribute* position, PositionOf(decoded));
  PLANISH_RETURN_IF_ERROR(CheckCounts(decoded.num_faces(), static_cast<std::int64_t>(position->size()), limits));
  Mesh mesh;
  PLANISH_ASSIGN_OR_RETURN(mesh.faces, FacesOf(decoded));
  for (std::size_t f = 0; f < mesh.faces.size(); ++f) {
    for (std::int32_t& vertex : mesh.faces[f]) {
      const std::uint32_t value = position->mapped_index(draco::PointIndex(static_cast<std::uint32_t>(vertex))).value();
      if (value >= position->size()) return IndexOutOfRange(static_cast<std::int64_t>(f), value, position->size());
      vertex = static_cast<std::int32_t>(value);
    }
  }
  mesh.positions.resize(position->size());
  for (std::uint32_t v = 0; v < position->size(); ++v) {
    Point point;
    std::memcpy(point.data(), position->GetAddress(draco::AttributeValueIndex(v)), sizeof(point));
    mesh.positions[v] = Vec3(point[0], point[1], point[2]);
  }
  // If POSITION has a mapping of its own, its values already are the sender's vertices.
  if (position->is_mapping_identity() && decoded.num_attributes() > 1 && position->size() == decoded.num_points()) {
    JoinSplitPoints(decoded, &mesh);
  }
  return mesh;
}

absl::StatusOr<Mesh> CheckAndDecode(std::string_view bytes, const DracoLimits& limits) {
  PLANISH_ASSIGN_OR_RETURN(const DracoCounts declared, PeekDraco(bytes));
  if (declared.geometry == DracoGeometry::kMesh) {
    PLANISH_RETURN_IF_ERROR(CheckCounts(declared.faces.value_or(0), declared.vertices.value_or(0), limits));
  }
  PLANISH_ASSIGN_OR_RETURN(const std::unique_ptr<draco::Mesh> decoded, OpenDraco(bytes));
  return FromDraco(*decoded, limits);
}

}  // namespace

absl::StatusOr<std::string> EncodeDraco(const Mesh& mesh) {
  PLANISH_RETURN_IF_ERROR(CheckEncodable(mesh));
  return CatchOutOfMemory("encode", [&] {
    const auto num_points = static_cast<std::uint32_t>(mesh.num_vertices());
    draco::Mesh source;
    source.set_num_points(num_points);
    draco::GeometryAttribute position;
    position.Init(draco::GeometryAttribute::POSITION, nullptr, 3, draco::DT_FLOAT32, false, sizeof(Point), 0);
    const int id = source.AddAttribute(position, true, num_points);
    for (std::uint32_t v = 0; v < num_points; ++v) {
      const Eigen::Vector3f rounded = mesh.positions[v].cast<float>();
      source.attribute(id)->SetAttributeValue(draco::AttributeValueIndex(v), rounded.data());
    }
    SetFaces(mesh.faces, &source);
    draco::ExpertEncoder encoder(source);
    return EncodeInOrder(sizeof(Point), source, &encoder);
  });
}

absl::StatusOr<Mesh> DecodeDraco(std::string_view bytes, const DracoLimits& limits) {
  return CatchOutOfMemory("decode", [&] { return CheckAndDecode(bytes, limits); });
}

}  // namespace planish
