#include <limits>
#include <map>

#include "client/files/file_io.h"
#include "client/files/gltf_mesh.h"
#include "client/files/polygon_mesh.h"
#include "core/base/error.h"
#include "core/base/status_macros.h"

namespace planish {
namespace {

constexpr std::int64_t kMostCorners = std::numeric_limits<std::int32_t>::max();

enum Mode { kPoints = 0, kTriangles = 4, kStrip = 5, kFan = 6 };

// Per vertex of a pool: the ids of its position and its UV in the polygon mesh.
struct PoolVertices {
  std::vector<std::int32_t> vertex;
  std::vector<std::int32_t> texcoord;  // empty: the pool has no such attribute
};

class GltfReader {
 public:
  GltfReader(const std::string& path, int texcoord) : path_(path), uv_name_("TEXCOORD_" + std::to_string(texcoord)) {}

  absl::StatusOr<PolygonMesh> Read(std::string_view bytes, std::shared_ptr<const GltfMesh>* gltf) {
    auto result = std::make_shared<GltfMesh>();
    gltf_ = result.get();
    PLANISH_ASSIGN_OR_RETURN(gltf_->document, ParseGltf(path_, bytes));
    const Json& meshes = GltfArray(document(), "meshes");
    const Json& accessors = GltfArray(document(), "accessors");
    const Json& materials = GltfArray(document(), "materials");
    num_accessors_ = static_cast<std::int64_t>(accessors.size());
    num_materials_ = static_cast<std::int64_t>(materials.size());
    for (std::size_t m = 0; m < meshes.size(); ++m) PLANISH_RETURN_IF_ERROR(ReadMesh(meshes[m], m));
    if (mesh_.num_polygons() == 0) {
      return FileMalformed(path_, 0, "no triangles: there is nothing to unwrap in meshes without them");
    }
    for (std::int64_t i = 0; i < num_materials_; ++i) {
      mesh_.material_names.push_back(GltfName(materials[static_cast<std::size_t>(i)], "material", i));
    }
    if (num_materials_ == 0) mesh_.polygon_material.clear();
    if (has_texcoord_) {
      mesh_.texcoords = texcoords_.TakeValues();
    } else {
      mesh_.corner_texcoord.clear();
    }
    *gltf = std::move(result);
    return std::move(mesh_);
  }

 private:
  const GltfDocument& document() const { return gltf_->document; }

  absl::Status ReadMesh(const Json& mesh, std::size_t m) {
    const std::string element = "meshes[" + std::to_string(m) + "]";
    mesh_.group_names.push_back(GltfName(mesh, "mesh", static_cast<std::int64_t>(m)));
    const auto primitives = mesh.find("primitives");
    if (primitives == mesh.end() || !primitives->is_array()) {
      return GltfFault(document(), element + ".primitives", "missing");
    }
    welded_ = ValueIndex();
    first_vertex_ = static_cast<std::int64_t>(mesh_.positions.size());
    pool_of_attributes_.clear();
    for (std::size_t p = 0; p < primitives->size(); ++p) {
      element_ = element + ".primitives[" + std::to_string(p) + "]";
      if (!(*primitives)[p].is_object()) return GltfFault(document(), element_, "not an object");
      PLANISH_RETURN_IF_ERROR(ReadPrimitive((*primitives)[p], m, p));
    }
    return absl::OkStatus();
  }

  absl::Status ReadPrimitive(const Json& json, std::size_t m, std::size_t p) {
    PLANISH_ASSIGN_OR_RETURN(const std::int64_t mode, GltfInt(document(), json, element_, "mode", 0, 6, kTriangles));
    const Json* const attributes = GltfObject(json, "attributes");
    if (attributes == nullptr) return GltfFault(document(), element_ + ".attributes", "missing");
    // Points and lines cannot be unwrapped; primitives without positions show nothing.
    if (mode < kTriangles || !attributes->contains("POSITION")) return absl::OkStatus();
    GltfPrimitive primitive;
    primitive.mesh = m;
    primitive.primitive = p;
    primitive.is_list = mode == kTriangles;
    primitive.first_polygon = mesh_.num_polygons();
    PLANISH_ASSIGN_OR_RETURN(primitive.pool, FindPool(json, *attributes));
    PLANISH_ASSIGN_OR_RETURN(const std::int32_t material, ReadMaterial(json));
    if (gltf_->pools[primitive.pool].draco) {
      primitive.is_list = true;
      if (json.contains("indices")) {
        // Draco holds the indices, so the accessor has no data; but the writer replaces it, so it must exist.
        const absl::StatusOr<std::int64_t> indices =
            GltfIndex(document(), json["indices"], element_ + ".indices", num_accessors_);
        if (!indices.ok()) return indices.status();
      }
      for (const Face& face : gltf_->pools[primitive.pool].draco->faces) {
        PLANISH_RETURN_IF_ERROR(AddTriangle(face[0], face[1], face[2], primitive.pool, material));
      }
    } else {
      PLANISH_ASSIGN_OR_RETURN(const std::vector<std::int64_t> indices, ReadIndices(json, primitive.pool));
      PLANISH_RETURN_IF_ERROR(AddTriangles(indices, mode, primitive.pool, material));
    }
    primitive.num_polygons = mesh_.num_polygons() - primitive.first_polygon;
    mesh_.polygon_group.resize(mesh_.num_polygons(), static_cast<std::int32_t>(m));
    gltf_->primitives.push_back(primitive);
    return absl::OkStatus();
  }

  absl::StatusOr<std::int32_t> ReadMaterial(const Json& json) {
    const auto material = json.find("material");
    if (material == json.end()) return kNoId;
    PLANISH_ASSIGN_OR_RETURN(const std::int64_t index,
                             GltfIndex(document(), *material, element_ + ".material", num_materials_));
    return static_cast<std::int32_t>(index);
  }

  // The pool of a primitive's vertices; created when its attributes first occur in this mesh.
  absl::StatusOr<std::size_t> FindPool(const Json& json, const Json& attributes) {
    const Json* const draco = DracoJson(json);
    const auto targets = json.find("targets");
    Json key = Json::array({attributes, targets == json.end() ? Json() : *targets});
    if (draco != nullptr) key.push_back(element_);  // primitives do not share Draco's points
    const auto [entry, is_new] = pool_of_attributes_.emplace(key.dump(), gltf_->pools.size());
    if (!is_new) return entry->second;
    GltfPool pool;
    PoolVertices vertices;
    if (draco != nullptr) {
      PLANISH_RETURN_IF_ERROR(OpenDraco(*draco, attributes, &pool, &vertices));
    } else {
      PLANISH_ASSIGN_OR_RETURN(const GltfAccessor positions,
                               Attribute(attributes.at("POSITION"), element_ + ".attributes.POSITION"));
      pool.num_vertices = positions.count;
      if (positions.count > kMostCorners) return GltfFault(document(), positions.element, "too many elements");
      PLANISH_RETURN_IF_ERROR(AddPositions(positions, &vertices));
    }
    PLANISH_RETURN_IF_ERROR(CheckAttributes(attributes, element_ + ".attributes", draco, pool.num_vertices));
    if (targets != json.end()) {
      if (!targets->is_array()) return GltfFault(document(), element_ + ".targets", "not an array");
      for (std::size_t t = 0; t < targets->size(); ++t) {
        const std::string element = element_ + ".targets[" + std::to_string(t) + "]";
        PLANISH_RETURN_IF_ERROR(CheckAttributes((*targets)[t], element, nullptr, pool.num_vertices));
      }
    }
    const auto uv = attributes.find(uv_name_);
    if (vertices.texcoord.empty() && uv != attributes.end()) {
      PLANISH_ASSIGN_OR_RETURN(const GltfAccessor accessor, Attribute(*uv, element_ + ".attributes." + uv_name_));
      PLANISH_RETURN_IF_ERROR(AddTexcoords(accessor.DenseBytes(), accessor, &vertices));
    }
    gltf_->pools.push_back(std::move(pool));
    vertices_.push_back(std::move(vertices));
    return gltf_->pools.size() - 1;
  }

  absl::StatusOr<GltfAccessor> Attribute(const Json& index, const std::string& element) {
    PLANISH_ASSIGN_OR_RETURN(const std::int64_t i, GltfIndex(document(), index, element, num_accessors_));
    return OpenAccessor(document(), i);
  }

  // Checks that each accessor opens and has a value for each vertex. Attributes held by Draco have no bytes of their
  // own.
  absl::Status CheckAttributes(const Json& attributes, const std::string& element, const Json* draco,
                               std::int64_t num_vertices) {
    if (!attributes.is_object()) return GltfFault(document(), element, "not an object");
    const Json* const in_draco = draco == nullptr ? nullptr : GltfObject(*draco, "attributes");
    for (const auto& [name, index] : attributes.items()) {
      const std::string where = element + "." + name;
      PLANISH_ASSIGN_OR_RETURN(const std::int64_t i, GltfIndex(document(), index, where, num_accessors_));
      if (in_draco != nullptr && in_draco->contains(name)) continue;
      PLANISH_ASSIGN_OR_RETURN(const GltfAccessor accessor, OpenAccessor(document(), i));
      if (accessor.count == num_vertices) continue;
      return GltfFault(document(), where,
                       accessor.element + " has " + std::to_string(accessor.count) + " elements, but there are " +
                           std::to_string(num_vertices) + " positions");
    }
    return absl::OkStatus();
  }

  absl::Status AddPositions(const GltfAccessor& accessor, PoolVertices* vertices) {
    if (accessor.components != 3 || accessor.component == GltfComponent::kUint) {
      return GltfFault(document(), element_ + ".attributes.POSITION",
                       accessor.element + " must be VEC3 of floats, or of bytes or shorts (KHR_mesh_quantization)");
    }
    const std::string bytes = accessor.DenseBytes();
    const int size = ComponentSize(accessor.component);
    for (std::int64_t i = 0; i < accessor.count; ++i) {
      Vec3 position;
      for (int axis = 0; axis < 3; ++axis) {
        position[axis] = ComponentValue(bytes.data() + i * accessor.element_size + axis * size, accessor.component,
                                        accessor.normalized);
      }
      PLANISH_RETURN_IF_ERROR(AddVertex(position, vertices));
    }
    return absl::OkStatus();
  }

  absl::Status AddVertex(const Vec3& position, PoolVertices* vertices) {
    const std::int64_t vertex = first_vertex_ + welded_.Add(position);
    if (vertex >= kMostCorners) return GltfFault(document(), element_, "more than 2147483647 vertices in all");
    if (vertex == static_cast<std::int64_t>(mesh_.positions.size())) mesh_.positions.push_back(position);
    vertices->vertex.push_back(static_cast<std::int32_t>(vertex));
    return absl::OkStatus();
  }

  absl::Status AddTexcoords(const std::string& bytes, const GltfAccessor& accessor, PoolVertices* vertices) {
    if (accessor.components != 2 || accessor.component == GltfComponent::kUint) {
      return GltfFault(document(), element_ + ".attributes." + uv_name_,
                       accessor.element + " must be VEC2 of floats, or of bytes or shorts");
    }
    const int size = ComponentSize(accessor.component);
    for (std::int64_t i = 0; i < accessor.count; ++i) {
      const char* const value = bytes.data() + i * accessor.element_size;
      const double v = ComponentValue(value + size, accessor.component, accessor.normalized);
      vertices->texcoord.push_back(
          texcoords_.Add(ComponentValue(value, accessor.component, accessor.normalized), 1 - v));
    }
    return absl::OkStatus();
  }

  absl::Status OpenDraco(const Json& draco, const Json& attributes, GltfPool* pool, PoolVertices* vertices) {
    const std::string element = element_ + ".extensions." + kDracoExtension;
    if (!draco.contains("bufferView")) return GltfFault(document(), element + ".bufferView", "missing");
    PLANISH_ASSIGN_OR_RETURN(const std::string_view bytes,
                             ViewBytes(document(), draco.at("bufferView"), element + ".bufferView"));
    const Json* const ids = GltfObject(draco, "attributes");
    if (ids == nullptr) return GltfFault(document(), element + ".attributes", "missing");
    absl::StatusOr<DracoPoints> points = DecodeDracoPoints(std::string(bytes), false);
    if (!points.ok()) {
      if (points.status().code() != absl::StatusCode::kInvalidArgument) return points.status();
      return GltfFault(document(), element, std::string(points.status().message()));
    }
    pool->num_vertices = points->num_points;
    bool has_positions = false;
    for (const auto& [name, id] : ids->items()) {
      const std::string where = element + ".attributes." + name;
      if (!attributes.contains(name)) return GltfFault(document(), where, "not an attribute of the primitive");
      const DracoAttribute* attribute = nullptr;
      for (const DracoAttribute& candidate : points->attributes) {
        if (id == candidate.unique_id) attribute = &candidate;
      }
      if (attribute == nullptr) return GltfFault(document(), where, "the Draco data have no attribute " + id.dump());
      if (name != "POSITION" && name != uv_name_) continue;
      // Describes Draco's values as an accessor, since they have the same layout.
      GltfAccessor accessor;
      accessor.element = where;
      accessor.count = points->num_points;
      accessor.components = attribute->components;
      // The primitive's accessor says whether Draco's integers are normalized.
      PLANISH_ASSIGN_OR_RETURN(const std::int64_t index,
                               GltfIndex(document(), attributes[name], where, num_accessors_));
      const Json& json = document().json["accessors"][static_cast<std::size_t>(index)];
      accessor.normalized = json.contains("normalized") && json["normalized"] == true;
      accessor.element_size = attribute->value_size;
      accessor.stride = attribute->value_size;
      accessor.data = attribute->values.data();
      const int type = GlTypeOfDraco(attribute->component);
      if (type == 0) return GltfFault(document(), where, "has a type that glTF lacks");
      accessor.component = static_cast<GltfComponent>(type);
      if (name == "POSITION") {
        PLANISH_RETURN_IF_ERROR(AddPositions(accessor, vertices));
        has_positions = true;
      } else {
        PLANISH_RETURN_IF_ERROR(AddTexcoords(attribute->values, accessor, vertices));
      }
    }
    if (!has_positions) return GltfFault(document(), element + ".attributes.POSITION", "missing");
    pool->draco = *std::move(points);
    return absl::OkStatus();
  }

  absl::StatusOr<std::vector<std::int64_t>> ReadIndices(const Json& json, std::size_t pool) {
    const std::int64_t num_vertices = gltf_->pools[pool].num_vertices;
    std::vector<std::int64_t> indices;
    const auto found = json.find("indices");
    if (found == json.end()) {
      for (std::int64_t i = 0; i < num_vertices; ++i) indices.push_back(i);
      return indices;
    }
    const std::string element = element_ + ".indices";
    PLANISH_ASSIGN_OR_RETURN(const GltfAccessor accessor, Attribute(*found, element));
    const bool is_unsigned = accessor.component == GltfComponent::kUbyte ||
                             accessor.component == GltfComponent::kUshort || accessor.component == GltfComponent::kUint;
    if (accessor.components != 1 || !is_unsigned) {
      return GltfFault(document(), element, accessor.element + " must be SCALAR of unsigned integers");
    }
    const std::string bytes = accessor.DenseBytes();
    indices.reserve(static_cast<std::size_t>(accessor.count));
    for (std::int64_t i = 0; i < accessor.count; ++i) {
      const std::int64_t index = IndexValue(bytes.data() + i * accessor.element_size, accessor.component);
      if (index >= num_vertices) {
        return GltfFault(document(), element,
                         "index " + std::to_string(i) + " is " + std::to_string(index) + ", but there are " +
                             std::to_string(num_vertices) + " positions");
      }
      indices.push_back(index);
    }
    return indices;
  }

  absl::Status AddTriangles(const std::vector<std::int64_t>& indices, std::int64_t mode, std::size_t pool,
                            std::int32_t material) {
    const std::size_t count = indices.size();
    if (mode == kTriangles) {
      if (count % 3 != 0) {
        return GltfFault(document(), element_, std::to_string(count) + " corners are no whole number of triangles");
      }
      for (std::size_t i = 0; i < count; i += 3) {
        PLANISH_RETURN_IF_ERROR(AddTriangle(indices[i], indices[i + 1], indices[i + 2], pool, material));
      }
      return absl::OkStatus();
    }
    for (std::size_t i = 0; i + 2 < count; ++i) {
      // Every second triangle of a strip is wound the other way; glTF swaps its last two corners.
      const std::int64_t a = mode == kFan ? indices[0] : indices[i];
      const std::int64_t b = mode == kFan || i % 2 == 0 ? indices[i + 1] : indices[i + 2];
      const std::int64_t c = mode == kFan || i % 2 == 0 ? indices[i + 2] : indices[i + 1];
      if (a == b || b == c || c == a) continue;
      PLANISH_RETURN_IF_ERROR(AddTriangle(a, b, c, pool, material));
    }
    return absl::OkStatus();
  }

  absl::Status AddTriangle(std::int64_t a, std::int64_t b, std::int64_t c, std::size_t pool, std::int32_t material) {
    if (static_cast<std::int64_t>(mesh_.corner_vertex.size()) > kMostCorners - 3) {
      return GltfFault(document(), element_, "more than 715827882 triangles in all");
    }
    const PoolVertices& vertices = vertices_[pool];
    for (const std::int64_t corner : {a, b, c}) {
      const auto i = static_cast<std::size_t>(corner);
      mesh_.corner_vertex.push_back(vertices.vertex[i]);
      mesh_.corner_texcoord.push_back(vertices.texcoord.empty() ? kNoId : vertices.texcoord[i]);
      gltf_->corner_vertex.push_back(static_cast<std::int32_t>(corner));
    }
    has_texcoord_ |= !vertices.texcoord.empty();
    mesh_.polygon_begin.push_back(static_cast<std::int64_t>(mesh_.corner_vertex.size()));
    mesh_.polygon_material.push_back(material);
    return absl::OkStatus();
  }

  const std::string& path_;
  const std::string uv_name_;
  GltfMesh* gltf_ = nullptr;
  std::int64_t num_accessors_ = 0;
  std::int64_t num_materials_ = 0;
  // State of the current mesh.
  std::string element_;  // the current primitive
  ValueIndex welded_;
  std::int64_t first_vertex_ = 0;
  std::map<std::string, std::size_t> pool_of_attributes_;

  std::vector<PoolVertices> vertices_;  // per pool
  TexcoordTable texcoords_;
  bool has_texcoord_ = false;
  PolygonMesh mesh_;
};

}  // namespace

Json& PrimitiveJson(Json& root, const GltfPrimitive& primitive) {
  return root["meshes"][primitive.mesh]["primitives"][primitive.primitive];
}

const Json& PrimitiveJson(const Json& root, const GltfPrimitive& primitive) {
  return root["meshes"][primitive.mesh]["primitives"][primitive.primitive];
}

const Json* DracoJson(const Json& primitive) {
  const Json* const extensions = GltfObject(primitive, "extensions");
  return extensions == nullptr ? nullptr : GltfObject(*extensions, kDracoExtension);
}

absl::StatusOr<PolygonMesh> ReadGltf(const std::string& path, std::string_view bytes, int texcoord,
                                     std::shared_ptr<const GltfMesh>* gltf) {
  return GltfReader(path, texcoord).Read(bytes, gltf);
}

}  // namespace planish
