#include "core/io/polygon_mesh.h"

#include "core/io/ear_clipping.h"

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

}  // namespace planish
