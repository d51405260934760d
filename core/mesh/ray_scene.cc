#include "core/mesh/ray_scene.h"

#include "core/mesh/spatial_order.h"

namespace planish {

std::optional<RayScene> MakeRayScene(const Mesh& mesh, const Execution& execution) {
  std::vector<std::int32_t> vertices;
  std::vector<char> has_face(mesh.positions.size(), 0);
  Vec3 low = Vec3::Constant(std::numeric_limits<double>::infinity()), high = -low;
  for (const Face& face : mesh.faces) {
    if (!mesh.IsInRange(face)) continue;
    for (const std::int32_t v : face) {
      if (!mesh.positions[v].allFinite()) return std::nullopt;
      if (std::exchange(has_face[v], 1)) continue;
      vertices.push_back(v);
      low = low.cwiseMin(mesh.positions[v]);
      high = high.cwiseMax(mesh.positions[v]);
    }
  }
  const double half = (high / 2 - low / 2).norm();
  if (vertices.empty() || !(half > 0) || !std::isfinite(half)) return std::nullopt;
  RayScene scene = {low, half, std::vector<rays::Point>(mesh.positions.size()), {}, std::nullopt};
  execution.ForEach(std::ssize(vertices),
                    [&](std::int64_t i) { scene.points[vertices[i]] = scene.PointAt(mesh.positions[vertices[i]]); });
  vertices = InSpatialOrder(mesh.positions, vertices, execution);
  if (execution.IsCancelled()) return std::nullopt;
  std::vector<std::int32_t> rank(scene.points.size(), -1);
  for (std::size_t i = 0; i < vertices.size(); ++i) rank[vertices[i]] = static_cast<std::int32_t>(i);
  std::vector<std::array<rays::Point, 3>> triangles;
  for (const std::int32_t f : FacesByFirstVertex(mesh.faces, rank)) {
    if (!mesh.IsInRange(mesh.faces[f])) continue;
    scene.faces.push_back(f);
    triangles.push_back(TriangleOf(scene.points, mesh.faces[f]));
  }
  scene.solid.emplace(std::move(triangles), execution);
  return scene;
}

RayScene::Hit RayScene::Nearest(const Vec3& place, const Vec3& direction, double reach) const {
  using rays::Cross;
  using rays::Dot;
  using rays::operator-;
  Hit best;
  const double length = direction.norm(), scale = 2 * half;  // the length of the scene's unit
  if (!(length > 0)) return best;
  const Vec3 along = direction / length;
  const rays::Point origin = PointAt(place - reach * along);
  const rays::Point ray = {static_cast<float>(along.x()), static_cast<float>(along.y()), static_cast<float>(along.z())};
  const auto middle = static_cast<float>(reach / scale);
  float nearest = std::numeric_limits<float>::infinity();
  solid->ForEachHit(origin, ray, 2 * middle, [&](std::size_t i, float t, float u, float v) {
    const float away = std::abs(t - middle);
    if (away >= nearest) return;
    const std::array<rays::Point, 3>& triangle = solid->triangle(i);
    if (!(Dot(Cross(triangle[1] - triangle[0], triangle[2] - triangle[0]), ray) > 0)) return;
    nearest = away;
    best.face = faces[i];
    best.distance = scale * static_cast<double>(t - middle);
    best.weights = {1.0 - static_cast<double>(u) - static_cast<double>(v), u, v};
  });
  return best;
}

}  // namespace planish
