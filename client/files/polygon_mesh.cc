#include "client/files/polygon_mesh.h"

#include <bit>

#include "client/files/ear_clipping.h"

namespace planish {

Triangulation Triangulate(const PolygonMesh& polygons) {
  constexpr std::int32_t kUnused = -1;
  Triangulation result;
  std::vector<std::int32_t> new_vertex(polygons.positions.size(), kUnused);
  for (const std::int32_t vertex : polygons.corner_vertex) new_vertex[vertex] = 0;
  for (std::size_t vertex = 0; vertex < new_vertex.size(); ++vertex) {
    if (new_vertex[vertex] == kUnused) continue;
    new_vertex[vertex] = static_cast<std::int32_t>(result.mesh.num_vertices());
    result.mesh.positions.push_back(polygons.positions[vertex]);
    result.source_vertex.push_back(static_cast<std::int32_t>(vertex));
  }

  std::vector<Vec3> outline;
  for (std::int64_t polygon = 0; polygon < polygons.num_polygons(); ++polygon) {
    const std::int64_t first = polygons.polygon_begin[polygon];
    const std::int64_t end = polygons.polygon_begin[polygon + 1];
    outline.clear();
    for (std::int64_t c = first; c < end; ++c) outline.push_back(polygons.positions[polygons.corner_vertex[c]]);
    for (const Face& triangle : TrianglesOfPolygon(outline)) {
      Face face;
      for (int k = 0; k < 3; ++k) {
        const std::int64_t source = first + triangle[k];
        face[k] = new_vertex[polygons.corner_vertex[source]];
        result.corner_of_triangle.push_back(source);
      }
      result.mesh.faces.push_back(face);
      result.source_polygon.push_back(polygon);
    }
  }
  return result;
}

std::size_t ValueIndex::Hash::operator()(const Key& key) const {
  std::uint64_t hash = 0;
  for (const std::uint64_t word : key) {
    hash = (hash ^ word) * 0x9E3779B97F4A7C15u;
    hash ^= hash >> 32;
  }
  return hash;
}

std::int32_t ValueIndex::Add(const Vec3& value) {
  Key key;
  for (int axis = 0; axis < 3; ++axis) key[axis] = std::bit_cast<std::uint64_t>(value[axis] + 0.0);
  return ids_.emplace(key, size()).first->second;
}

std::int32_t TexcoordTable::Add(double u, double v) {
  const std::int32_t id = ids_.Add(Vec3(u, v, 0));
  if (id == static_cast<std::int32_t>(values_.size())) values_.emplace_back(u, v);
  return id;
}

}  // namespace planish
