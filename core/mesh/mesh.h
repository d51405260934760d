// An indexed triangle mesh: positions and faces, without derived data.
#pragma once

#include <algorithm>
#include <array>
#include <cstdint>
#include <vector>

#include "Eigen/Core"

namespace planish {

using Vec2 = Eigen::Vector2d;
using Vec3 = Eigen::Vector3d;
using Face = std::array<std::int32_t, 3>;

struct Mesh {
  std::vector<Vec3> positions;  // any unit
  std::vector<Face> faces;      // 0-based vertex ids, counter-clockwise seen from outside

  std::int64_t num_vertices() const { return static_cast<std::int64_t>(positions.size()); }
  std::int64_t num_faces() const { return static_cast<std::int64_t>(faces.size()); }
  // Whether all vertices of the face exist.
  bool IsInRange(const Face& face) const {
    return std::all_of(face.begin(), face.end(), [&](std::int32_t v) { return v >= 0 && v < num_vertices(); });
  }
};

// The positions of a face's corners.
template <typename Point>
std::array<Point, 3> TriangleOf(const std::vector<Point>& positions, const Face& face) {
  return {positions[face[0]], positions[face[1]], positions[face[2]]};
}

// The corners after and before corner k of a face. Arrays with a value for each corner (angles, UV) have the value of
// corner k of face f at 3 f + k.
constexpr int Next(int k) {
  return k == 2 ? 0 : k + 1;
}
constexpr int Prev(int k) {
  return k == 0 ? 2 : k - 1;
}

}  // namespace planish
