// Angles and sizes of triangles.
#pragma once

#include <algorithm>
#include <array>
#include <cmath>
#include <cstdint>
#include <vector>

#include "Eigen/Core"
#include "Eigen/Geometry"
#include "core/base/execution.h"
#include "core/mesh/mesh.h"

namespace planish {

// alpha*: the 3F measured angles, radians, corner k of face f at 3 f + k. Accurate for angles near 0 and pi, whatever
// the position and scale of the mesh; those of a face add up to pi. A face without area gets the angles of edges that
// are longer by a thousandth of its longest edge ("intrinsic mollification", Sharp and Crane 2020, but only there): no
// angle is 0. One that names a vertex twice, or lies in one point, has no angles: 0. Of no use after a cancellation.
Eigen::VectorXd MeasuredAngles(const Mesh& mesh, const Execution& execution = {});
// The angles of these faces alone: corner k of faces[i] at 3 i + k.
Eigen::VectorXd MeasuredAngles(const Mesh& mesh, const std::vector<std::int32_t>& faces,
                               const Execution& execution = {});

// The square of the longest edge of a triangle, in the plane or in space.
template <typename Point>
double LongestEdgeSquared(const Point& a, const Point& b, const Point& c) {
  return std::max({(b - a).squaredNorm(), (c - b).squaredNorm(), (a - c).squaredNorm()});
}

template <typename Point>
double LongestEdge(const std::array<Point, 3>& p) {
  return std::sqrt(LongestEdgeSquared(p[0], p[1], p[2]));
}

// Twice the area of a triangle. In the plane negative if it runs clockwise.
inline double DoubleArea(const Vec2& a, const Vec2& b, const Vec2& c) {
  const Vec2 u = b - a, v = c - a;
  return u.x() * v.y() - u.y() * v.x();
}
inline double DoubleArea(const Vec3& a, const Vec3& b, const Vec3& c) {
  return (b - a).cross(c - a).norm();
}
template <typename Point>
double DoubleArea(const std::array<Point, 3>& p) {
  return DoubleArea(p[0], p[1], p[2]);
}

// Whether the three points span no area at working precision: 2 area <= 1e-14 times the longest edge squared.
bool IsDegenerateTriangle(const Vec3& a, const Vec3& b, const Vec3& c);

// angles[k]: the angle of the triangle `p` at corner k, radians, in [0, pi]. The three add up to pi. If the triangle
// has no area, two are 0. For Vec2 and Vec3.
template <typename Point>
void TriangleAngles(const Point p[3], double angles[3]);

}  // namespace planish
