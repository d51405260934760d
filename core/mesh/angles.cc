#include "core/mesh/angles.h"

#include <cmath>

#include "Eigen/Geometry"

namespace planish {

template <>
double AngleAt<Vec3>(const Vec3& o, const Vec3& a, const Vec3& b) {
  const Vec3 u = a - o, v = b - o;
  return std::atan2(u.cross(v).norm(), u.dot(v));
}

template <>
double AngleAt<Vec2>(const Vec2& o, const Vec2& a, const Vec2& b) {
  const Vec2 u = a - o, v = b - o;
  return std::atan2(std::abs(u.x() * v.y() - u.y() * v.x()), u.dot(v));
}

Eigen::VectorXd MeasuredAngles(const Mesh& mesh) {
  Eigen::VectorXd angles(3 * mesh.num_faces());
  for (std::int64_t f = 0; f < mesh.num_faces(); ++f) {
    const Face& face = mesh.faces[f];
    for (int k = 0; k < 3; ++k) {
      angles[3 * f + k] =
          AngleAt(mesh.positions[face[k]], mesh.positions[face[Next(k)]], mesh.positions[face[Prev(k)]]);
    }
  }
  return angles;
}

}  // namespace planish
