#include "client/files/gltf_attribute.h"

#include <cmath>
#include <cstddef>

#include "client/files/gltf_accessor.h"
#include "core/base/status_macros.h"

namespace planish {

absl::StatusOr<std::vector<float>> ReadVertexAttribute(const GltfMesh& gltf, const GltfPrimitive& primitive,
                                                       const std::string& name, std::size_t components) {
  std::vector<float> values;
  const Json& json = PrimitiveJson(gltf.document.json, primitive);
  const Json& attributes = json["attributes"];
  if (!attributes.contains(name)) return values;
  const auto index = attributes[name].get<std::int64_t>();
  const auto take = [&](const char* data, std::int64_t stride, GltfComponent component, bool normalized,
                        std::int64_t count) {
    const auto size = static_cast<std::int64_t>(ComponentSize(component));
    values.reserve(static_cast<std::size_t>(count) * components);
    for (std::int64_t i = 0; i < count; ++i) {
      for (std::size_t c = 0; c < components; ++c) {
        values.push_back(static_cast<float>(
            ComponentValue(data + i * stride + static_cast<std::int64_t>(c) * size, component, normalized)));
      }
    }
  };
  const GltfPool& pool = gltf.pools[primitive.pool];
  const Json* const draco = DracoJson(json);
  const Json* const ids = draco == nullptr ? nullptr : GltfObject(*draco, "attributes");
  if (pool.draco && ids != nullptr && ids->contains(name)) {
    for (const DracoAttribute& attribute : pool.draco->attributes) {
      if ((*ids)[name] != attribute.unique_id || attribute.components < static_cast<int>(components)) continue;
      const int type = GlTypeOfDraco(attribute.component);
      if (type == 0) continue;
      const Json& accessor = gltf.document.json["accessors"][static_cast<std::size_t>(index)];
      const bool normalized = accessor.contains("normalized") && accessor["normalized"] == true;
      take(attribute.values.data(), attribute.value_size, static_cast<GltfComponent>(type), normalized,
           pool.num_vertices);
      break;
    }
    return values;
  }
  PLANISH_ASSIGN_OR_RETURN(const GltfAccessor accessor, OpenAccessor(gltf.document, index));
  if (accessor.components < static_cast<int>(components) || accessor.count != pool.num_vertices) return values;
  take(accessor.DenseBytes().data(), accessor.element_size, accessor.component, accessor.normalized, accessor.count);
  return values;
}

absl::StatusOr<std::vector<float>> CornerNormals(const GltfMesh& gltf, const GltfPrimitive& primitive,
                                                 bool* are_given) {
  PLANISH_ASSIGN_OR_RETURN(const std::vector<float> normals, ReadVertexAttribute(gltf, primitive, "NORMAL", 3));
  PLANISH_ASSIGN_OR_RETURN(const std::vector<float> positions, ReadVertexAttribute(gltf, primitive, "POSITION", 3));
  *are_given = !normals.empty();
  std::vector<float> result;
  const std::int32_t* const corners = gltf.corner_vertex.data() + 3 * primitive.first_polygon;
  for (std::int64_t f = 0; f < primitive.num_polygons; ++f) {
    Vec3 p[3];
    for (int k = 0; k < 3; ++k) {
      const auto v = 3 * static_cast<std::size_t>(corners[3 * f + k]);
      p[k] = Vec3(positions[v], positions[v + 1], positions[v + 2]);
      if (*are_given) result.insert(result.end(), {normals[v], normals[v + 1], normals[v + 2]});
    }
    if (*are_given) continue;
    const Vec3 a = p[1] - p[0], b = p[2] - p[0];
    Vec3 n(a.y() * b.z() - a.z() * b.y(), a.z() * b.x() - a.x() * b.z(), a.x() * b.y() - a.y() * b.x());
    const double length = n.norm();
    n = length > 0 ? Vec3(n / length) : Vec3(0, 0, 1);
    for (int k = 0; k < 3; ++k) {
      for (const double x : {n.x(), n.y(), n.z()}) result.push_back(static_cast<float>(x));
    }
  }
  return result;
}

absl::StatusOr<std::vector<std::array<float, 4>>> CornerColors(const GltfMesh& gltf, const GltfPrimitive& primitive) {
  std::size_t components = 4;
  PLANISH_ASSIGN_OR_RETURN(std::vector<float> of_vertex, ReadVertexAttribute(gltf, primitive, "COLOR_0", 4));
  if (of_vertex.empty()) {
    components = 3;
    PLANISH_ASSIGN_OR_RETURN(of_vertex, ReadVertexAttribute(gltf, primitive, "COLOR_0", 3));
  }
  std::vector<std::array<float, 4>> colors;
  if (of_vertex.empty()) return colors;
  for (std::int64_t c = 3 * primitive.first_polygon; c < 3 * (primitive.first_polygon + primitive.num_polygons); ++c) {
    const auto v = components * static_cast<std::size_t>(gltf.corner_vertex[static_cast<std::size_t>(c)]);
    std::array<float, 4>& color = colors.emplace_back(std::array<float, 4>{1, 1, 1, 1});
    for (std::size_t k = 0; k < components; ++k) color[k] = of_vertex[v + k];
  }
  return colors;
}

}  // namespace planish
