#include "core/mesh/angles.h"

#include <cmath>
#include <numbers>

#include "Eigen/Geometry"

namespace planish {
namespace {

double CrossNorm(const Vec3& u, const Vec3& v) {
  return u.cross(v).norm();
}
double CrossNorm(const Vec2& u, const Vec2& v) {
  return std::abs(u.x() * v.y() - u.y() * v.x());
}

template <typename Point>
double Angle(const Point& o, const Point& a, const Point& b) {
  const Point u = a - o, v = b - o;
  return std::atan2(CrossNorm(u, v), u.dot(v));
}

template <typename Point>
void Angles(const Point p[3], double angles[3]) {
  // Edge k faces corner k. The largest angle, which faces the longest edge, is what the others leave of pi: they are
  // acute, and as exact as the area, which the two shorter edges give.
  const Point edge[3] = {p[2] - p[1], p[0] - p[2], p[1] - p[0]};
  const double squared[3] = {edge[0].squaredNorm(), edge[1].squaredNorm(), edge[2].squaredNorm()};
  const int largest =
      squared[0] >= squared[1] ? (squared[0] >= squared[2] ? 0 : 2) : (squared[1] >= squared[2] ? 1 : 2);
  const int next = Next(largest), prev = Prev(largest);
  const double twice_area = CrossNorm(edge[next], edge[prev]);
  angles[next] = std::atan2(twice_area, -edge[largest].dot(edge[prev]));
  angles[prev] = std::atan2(twice_area, -edge[largest].dot(edge[next]));
  angles[largest] = std::numbers::pi - angles[next] - angles[prev];
}

}  // namespace

template <>
double AngleAt<Vec3>(const Vec3& o, const Vec3& a, const Vec3& b) {
  return Angle(o, a, b);
}
template <>
double AngleAt<Vec2>(const Vec2& o, const Vec2& a, const Vec2& b) {
  return Angle(o, a, b);
}

template <>
void TriangleAngles<Vec3>(const Vec3 p[3], double angles[3]) {
  Angles(p, angles);
}
template <>
void TriangleAngles<Vec2>(const Vec2 p[3], double angles[3]) {
  Angles(p, angles);
}

Eigen::VectorXd MeasuredAngles(const Mesh& mesh, const Execution& execution) {
  Eigen::VectorXd angles(3 * mesh.num_faces());
  execution.For(mesh.num_faces(), [&](std::int64_t begin, std::int64_t end) {
    for (std::int64_t f = begin; f < end; ++f) {
      const Face& face = mesh.faces[f];
      const Vec3 p[3] = {mesh.positions[face[0]], mesh.positions[face[1]], mesh.positions[face[2]]};
      TriangleAngles(p, &angles[3 * f]);
    }
  });
  return angles;
}

}  // namespace planish
