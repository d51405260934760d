#include "core/pack/islands.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <numeric>

#include "Eigen/Geometry"

namespace planish {
namespace {

// Vertices with the same place, by the first of them.
std::vector<std::int32_t> FirstAtPlace(const std::vector<Vec3>& positions) {
  std::vector<std::int32_t> order(positions.size());
  std::iota(order.begin(), order.end(), 0);
  const auto key = [&](std::int32_t v) {
    return std::array<double, 3>{positions[v].x(), positions[v].y(), positions[v].z()};
  };
  std::sort(order.begin(), order.end(), [&](std::int32_t a, std::int32_t b) {
    const auto ka = key(a), kb = key(b);
    return ka != kb ? ka < kb : a < b;
  });
  std::vector<std::int32_t> first(positions.size());
  for (std::size_t i = 0; i < order.size(); ++i) {
    const bool again = i > 0 && key(order[i]) == key(order[i - 1]);
    first[order[i]] = again ? first[order[i - 1]] : order[i];
  }
  return first;
}

class Groups {
 public:
  explicit Groups(std::size_t n) : parent_(n) { std::iota(parent_.begin(), parent_.end(), 0); }
  std::int32_t Root(std::int32_t i) {
    while (parent_[i] != i) i = parent_[i] = parent_[parent_[i]];
    return i;
  }
  void Join(std::int32_t a, std::int32_t b) {
    const auto [low, high] = std::minmax({Root(a), Root(b)});
    parent_[high] = low;
  }

 private:
  std::vector<std::int32_t> parent_;
};

}  // namespace

std::vector<std::int32_t> FindIslands(const Mesh& mesh, const std::vector<std::int32_t>& corner_texcoord) {
  const std::vector<std::int32_t> place = FirstAtPlace(mesh.positions);
  // Both ends of a side, (place, UV) each, the lower first.
  struct Side {
    std::array<std::int32_t, 4> ends;
    std::int32_t face;
  };
  std::vector<Side> sides;
  sides.reserve(3 * mesh.faces.size());
  for (std::size_t f = 0; f < mesh.faces.size(); ++f) {
    for (int k = 0; k < 3; ++k) {
      const auto end = [&](int corner) {
        return std::array<std::int32_t, 2>{place[mesh.faces[f][corner]], corner_texcoord[3 * f + corner]};
      };
      const auto [a, b] = std::minmax({end(k), end(Next(k))});
      sides.push_back({{a[0], a[1], b[0], b[1]}, static_cast<std::int32_t>(f)});
    }
  }
  std::sort(sides.begin(), sides.end(),
            [](const Side& a, const Side& b) { return a.ends != b.ends ? a.ends < b.ends : a.face < b.face; });
  Groups groups(mesh.faces.size());
  for (std::size_t i = 1; i < sides.size(); ++i) {
    if (sides[i].ends == sides[i - 1].ends) groups.Join(sides[i].face, sides[i - 1].face);
  }
  std::vector<std::int32_t> island(mesh.faces.size(), -1);
  std::int32_t count = 0;
  for (std::size_t f = 0; f < island.size(); ++f) {
    const std::int32_t root = groups.Root(static_cast<std::int32_t>(f));  // the first face of its group
    island[f] = root == static_cast<std::int32_t>(f) ? count++ : island[root];
  }
  return island;
}

Repacking Repack(const Mesh& mesh, const std::vector<double>& corner_uv,
                 const std::vector<std::int32_t>& corner_texcoord, IslandDensity density, const PackOptions& options,
                 const Execution& execution) {
  Repacking result;
  result.face_island = FindIslands(mesh, corner_texcoord);
  std::int32_t count = 0;
  for (const std::int32_t i : result.face_island) count = std::max(count, i + 1);
  std::vector<PackChart> charts(count);
  std::vector<double> surface(count, 0), plane(count, 0);
  // Corners with the same UV become one point of the island, so that its outline is found.
  std::vector<std::vector<std::array<std::int32_t, 2>>> corners(count);  // texcoord, corner
  for (std::size_t c = 0; c < corner_texcoord.size(); ++c) {
    corners[result.face_island[c / 3]].push_back({corner_texcoord[c], static_cast<std::int32_t>(c)});
  }
  std::vector<std::int32_t> point(corner_texcoord.size());
  for (std::int32_t i = 0; i < count; ++i) {
    std::sort(corners[i].begin(), corners[i].end());
    for (std::size_t k = 0; k < corners[i].size(); ++k) {
      const std::int32_t c = corners[i][k][1];
      if (k == 0 || corners[i][k][0] != corners[i][k - 1][0]) {
        charts[i].positions.emplace_back(corner_uv[2 * c], corner_uv[2 * c + 1]);
      }
      point[c] = static_cast<std::int32_t>(charts[i].positions.size()) - 1;
    }
  }
  for (std::size_t f = 0; f < mesh.faces.size(); ++f) {
    const std::int32_t i = result.face_island[f];
    const Face face = {point[3 * f], point[3 * f + 1], point[3 * f + 2]};
    charts[i].faces.push_back(face);
    const auto& p = charts[i].positions;
    const Vec2 a = p[face[1]] - p[face[0]], b = p[face[2]] - p[face[0]];
    plane[i] += std::abs(a.x() * b.y() - a.y() * b.x());
    const Vec3& corner = mesh.positions[mesh.faces[f][0]];
    const double area =
        (mesh.positions[mesh.faces[f][1]] - corner).cross(mesh.positions[mesh.faces[f][2]] - corner).norm();
    if (std::isfinite(area)) surface[i] += area;
  }
  if (density == IslandDensity::kEqual) {
    const double all_surface = std::accumulate(surface.begin(), surface.end(), 0.0);
    const double all_plane = std::accumulate(plane.begin(), plane.end(), 0.0);
    const double otherwise = all_surface > 0 && all_plane > 0 ? std::sqrt(all_surface / all_plane) : 1;
    for (std::int32_t i = 0; i < count; ++i) {
      charts[i].density = surface[i] > 0 && plane[i] > 0 ? std::sqrt(surface[i] / plane[i]) : otherwise;
    }
  }
  result.packing = Pack(charts, options, execution);
  result.corner_uv.resize(corner_uv.size());
  for (std::size_t c = 0; c < corner_texcoord.size(); ++c) {
    const std::int32_t i = result.face_island[c / 3];
    const Vec2 uv = result.packing.charts[i](charts[i].positions[point[c]]);
    result.corner_uv[2 * c] = uv.x();
    result.corner_uv[2 * c + 1] = uv.y();
  }
  return result;
}

}  // namespace planish
