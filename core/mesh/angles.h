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
// the position and scale of the mesh. The angles of a face add up to pi. A face without area gets the angles of a
// triangle whose edges are longer by a thousandth of its longest edge ("intrinsic mollification", Sharp and Crane 2020,
// but only there), so none of its angles is 0. A face that repeats a vertex, or whose corners coincide, gets 0 for all
// three. Invalid after a cancellation.
Eigen::VectorXd MeasuredAngles(const Mesh& mesh, const Execution& execution = {});
// The angles of only these faces: corner k of faces[i] at 3 i + k.
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

// Twice the area of a triangle. In the plane, negative if the triangle runs clockwise.
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

// Whether the points span no area at working precision: 2 area <= 1e-14 times the longest edge squared.
bool IsDegenerateTriangle(const Vec3& a, const Vec3& b, const Vec3& c);

// angles[k] is the angle of triangle `p` at corner k, radians, in [0, pi]. The three add up to pi. Two are 0 if the
// triangle has no area. For Vec2 and Vec3.
template <typename Point>
void TriangleAngles(const Point p[3], double angles[3]);

}  // namespace planish
