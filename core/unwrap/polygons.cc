#include "core/unwrap/polygons.h"

#include <algorithm>
#include <array>
#include <cmath>

#include "core/mesh/angles.h"
#include "core/mesh/half_edges.h"

namespace planish {
namespace {

bool IsUsable(const Mesh& mesh, const Face& face) {
  return std::all_of(face.begin(), face.end(), [&](std::int32_t v) {
    return v >= 0 && v < mesh.num_vertices() && mesh.positions[v].allFinite();
  });
}

}  // namespace

Polygons::Polygons(std::int64_t num_faces, const std::vector<std::int32_t>& face_polygon)
    : num_faces_(static_cast<std::int32_t>(num_faces)), of_face_(face_polygon) {
  if (are_triangles()) return;
  const std::int32_t polygons = NumberByFirst(of_face_.size(), &of_face_);
  faces_ = GroupByKey(num_faces_, polygons, [&](std::int32_t f) { return of_face_[f]; });
}

std::int64_t Polygons::CountIn(const std::vector<std::int32_t>& faces) const {
  if (are_triangles()) return std::ssize(faces);
  std::vector<std::int32_t> numbers;
  for (const std::int32_t f : faces) numbers.push_back(of_face_[f]);
  std::sort(numbers.begin(), numbers.end());
  return std::unique(numbers.begin(), numbers.end()) - numbers.begin();
}

PolygonSize SizeOfPolygon(const Mesh& mesh, const Polygons& polygons, std::int32_t i) {
  PolygonSize size;
  bool is_usable = true;
  std::int32_t triangles = 0;
  std::vector<std::int32_t> corners;
  polygons.ForEachFace(i, [&](std::int32_t f) {
    is_usable = is_usable && IsUsable(mesh, mesh.faces[f]);
    if (!is_usable) return;
    const std::array<Vec3, 3> p = TriangleOf(mesh.positions, mesh.faces[f]);
    size.area += DoubleArea(p) / 2;
    if (++triangles == 1) size.length = LongestEdge(p);
    if (!polygons.are_triangles()) corners.insert(corners.end(), mesh.faces[f].begin(), mesh.faces[f].end());
  });
  if (!is_usable) return {};
  if (triangles < 2) return size;
  const auto farthest_from = [&](const Vec3& p) {
    return *std::max_element(corners.begin(), corners.end(), [&](std::int32_t v, std::int32_t w) {
      return (mesh.positions[v] - p).squaredNorm() < (mesh.positions[w] - p).squaredNorm();
    });
  };
  const Vec3& one = mesh.positions[farthest_from(mesh.positions[corners[0]])];
  size.length = std::max(size.length, (mesh.positions[farthest_from(one)] - one).norm());
  return size;
}

}  // namespace planish
