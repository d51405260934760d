#include "core/mesh/angles.h"

#include <numbers>

#include "core/base/portable_math.h"
#include "core/base/radix_sort.h"

namespace planish {

template <typename Point>
void TriangleAngles(const Point p[3], double angles[3]) {
  // Edge k faces corner k. The smaller two angles are acute, and as exact as the area, which comes from the two shorter
  // edges. The largest angle, which faces the longest edge, is pi minus the others.
  const Point edge[3] = {p[2] - p[1], p[0] - p[2], p[1] - p[0]};
  const double squared[3] = {edge[0].squaredNorm(), edge[1].squaredNorm(), edge[2].squaredNorm()};
  const int largest =
      squared[0] >= squared[1] ? (squared[0] >= squared[2] ? 0 : 2) : (squared[1] >= squared[2] ? 1 : 2);
  const int next = Next(largest), prev = Prev(largest);
  const double twice_area = std::abs(DoubleArea(p[largest], p[next], p[prev]));
  angles[next] = portable::Atan2(twice_area, -edge[largest].dot(edge[prev]));
  angles[prev] = portable::Atan2(twice_area, -edge[largest].dot(edge[next]));
  angles[largest] = std::numbers::pi - angles[next] - angles[prev];
}

template void TriangleAngles(const Vec2 p[3], double angles[3]);
template void TriangleAngles(const Vec3 p[3], double angles[3]);

bool IsDegenerateTriangle(const Vec3& a, const Vec3& b, const Vec3& c) {
  return !(DoubleArea(a, b, c) > 1e-14 * LongestEdgeSquared(a, b, c));
}

namespace {

void MeasureFlatFace(const Vec3 p[3], double angles[3]) {
  constexpr double kLonger = 1e-3;  // in lengths of the longest edge
  double length[3];                 // per corner: of the edge that it faces
  for (int k = 0; k < 3; ++k) length[k] = (p[Prev(k)] - p[Next(k)]).norm();
  const double longest = std::max({length[0], length[1], length[2]});
  for (double& l : length) l += kLonger * longest;
  // Place the triangle in the plane, for accurate small angles.
  const double x = (length[0] * length[0] + length[1] * length[1] - length[2] * length[2]) / (2 * length[0]);
  const double s = (length[0] + length[1] + length[2]) / 2;
  const double area = std::sqrt(std::max(0.0, s * (s - length[0]) * (s - length[1]) * (s - length[2])));
  // The edge that corner 0 faces runs from (0, 0), corner 2, to (length[0], 0), corner 1.
  const Vec2 q[3] = {Vec2(x, 2 * area / length[0]), Vec2(length[0], 0), Vec2(0, 0)};
  TriangleAngles(q, angles);
}

}  // namespace

Eigen::VectorXd MeasuredAngles(const Mesh& mesh, const std::vector<std::int32_t>& faces, const Execution& execution) {
  Eigen::VectorXd angles(3 * faces.size());
  execution.ForEach(std::ssize(faces), [&](std::int64_t i) {
    const auto& [a, b, c] = mesh.faces[faces[i]];
    const Vec3 p[3] = {mesh.positions[a], mesh.positions[b], mesh.positions[c]};
    if (a == b || b == c || c == a || (p[0] == p[1] && p[1] == p[2])) {
      angles.segment<3>(3 * i).setZero();
    } else if (IsDegenerateTriangle(p[0], p[1], p[2])) {
      MeasureFlatFace(p, &angles[3 * i]);
    } else {
      TriangleAngles(p, &angles[3 * i]);
    }
  });
  return angles;
}

Eigen::VectorXd MeasuredAngles(const Mesh& mesh, const Execution& execution) {
  return MeasuredAngles(mesh, Indices(mesh.faces.size()), execution);
}

}  // namespace planish
