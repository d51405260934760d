#include "core/unwrap/polygons.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <cstdlib>

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

Polygons::Polygons(const Mesh& mesh, const std::vector<std::int32_t>& uncut_corners)
    : num_faces_(static_cast<std::int32_t>(mesh.faces.size())) {
  if (uncut_corners.empty()) return;
  using Edge = std::array<std::int32_t, 3>;  // lower vertex, higher vertex, face
  std::vector<Edge> uncut;
  const auto edge_of = [&](std::int32_t c) -> Edge {
    const auto [low, high] = std::minmax(Origin(mesh.faces, c), Target(mesh.faces, c));
    return {low, high, c / 3};
  };
  for (const std::int32_t c : uncut_corners) uncut.push_back(edge_of(c));
  std::sort(uncut.begin(), uncut.end());
  std::vector<std::int32_t> nearest(uncut.size(), -1);
  for (std::int32_t c = 0; c < 3 * num_faces_; ++c) {
    const Edge edge = edge_of(c);
    for (auto it = std::lower_bound(uncut.begin(), uncut.end(), Edge{edge[0], edge[1], 0});
         it != uncut.end() && (*it)[0] == edge[0] && (*it)[1] == edge[1]; ++it) {
      std::int32_t& best = nearest[it - uncut.begin()];
      const std::int32_t f = edge[2], own = (*it)[2];
      if (f != own && (best < 0 || std::abs(f - own) < std::abs(best - own))) best = f;
    }
  }
  UnionFind joined(mesh.faces.size());
  for (std::size_t i = 0; i < uncut.size(); ++i) {
    if (nearest[i] >= 0) joined.Join(uncut[i][2], nearest[i]);
  }
  for (std::int32_t f = 0; f < num_faces_; ++f) of_face_.push_back(joined.Find(f));
  const std::int32_t polygons = NumberByFirst(num_faces_, &of_face_);
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
