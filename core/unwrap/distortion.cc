#include "core/unwrap/distortion.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <limits>
#include <numbers>

#include "Eigen/Geometry"
#include "core/base/portable_math.h"
#include "core/base/radix_sort.h"
#include "core/mesh/angles.h"
#include "core/mesh/half_edges.h"

namespace planish {

void MapSums::Add(const Vec2 p[3], const Vec3 q[3]) {
  // The map from the plane to the surface is affine with the columns su and sv. Its singular values are larger >=
  // smaller; their product is the ratio of areas.
  const Vec2 e1 = p[1] - p[0], e2 = p[2] - p[0];
  const Vec3 s1 = q[1] - q[0], s2 = q[2] - q[0];
  const double twice_uv_area = std::abs(e1.x() * e2.y() - e1.y() * e2.x());
  const double area = s1.cross(s2).norm() / 2;
  surface_area += area;
  uv_area += twice_uv_area / 2;
  const Vec3 su = (s1 * e2.y() - s2 * e1.y()) / twice_uv_area;
  const Vec3 sv = (s2 * e1.x() - s1 * e2.x()) / twice_uv_area;
  const double a = su.dot(su), b = su.dot(sv), c = sv.dot(sv);
  const double larger = std::sqrt((a + c + portable::Hypot(a - c, 2 * b)) / 2);
  const double smaller = 2 * area / twice_uv_area / larger;
  const double ratio = twice_uv_area > 0 ? larger / smaller : std::numeric_limits<double>::infinity();
  conformal += area * ratio;
  conformal_max = std::max(conformal_max, ratio);
  stretch += area * (larger * larger + smaller * smaller) / 2;
}

void MapSums::Add(const MapSums& other) {
  surface_area += other.surface_area;
  uv_area += other.uv_area;
  conformal += other.conformal;
  conformal_max = std::max(conformal_max, other.conformal_max);
  stretch += other.stretch;
}

double MapSums::StretchL2() const {
  return surface_area > 0 ? std::sqrt(stretch / surface_area) * std::sqrt(uv_area / surface_area) : 1;
}

double SeamLength(const Mesh& mesh, const std::vector<std::int32_t>& half_edges,
                  const std::function<bool(std::int32_t)>& is_joined) {
  std::vector<KeyedIndex> by_edge;
  by_edge.reserve(half_edges.size());
  for (const std::int32_t c : half_edges) {
    const auto [low, high] = std::minmax({Origin(mesh.faces, c), Target(mesh.faces, c)});
    by_edge.push_back({std::uint64_t(low) << 32 | std::uint64_t(high), c});
  }
  SortByKey(&by_edge);
  double length = 0;
  for (std::size_t i = 0, end = 0; i < by_edge.size(); i = end) {
    std::size_t joined = 0;
    for (; end < by_edge.size() && by_edge[end].key == by_edge[i].key; ++end) joined += is_joined(by_edge[end].index);
    const std::int32_t c = by_edge[i].index;
    const Vec3 along = mesh.positions[Target(mesh.faces, c)] - mesh.positions[Origin(mesh.faces, c)];
    length += static_cast<double>((end - i) / 2 - joined / 2) * along.norm();
  }
  return length;
}

void DistortionSums::Add(const DistortionSums& other) {
  angle_error += other.angle_error;
  angle_error_max = std::max(angle_error_max, other.angle_error_max);
  energy += other.energy;
  faces += other.faces;
  map.Add(other.map);
}

void DistortionSums::Fill(Quality* quality) const {
  if (faces == 0) return;
  const double num_angles = 3.0 * static_cast<double>(faces);
  constexpr double kDegrees = 180 / std::numbers::pi;
  quality->angle_error_mean_deg = angle_error / num_angles * kDegrees;
  quality->angle_error_max_deg = angle_error_max * kDegrees;
  quality->abf_energy = energy / num_angles;
  quality->conformal_distortion_mean = map.conformal / map.surface_area;
  quality->conformal_distortion_max = map.conformal_max;
  quality->stretch_l2 = map.StretchL2();
  quality->packing_efficiency = map.uv_area;
}

DistortionSums MeasureDistortion(const Mesh& mesh, const std::vector<std::int32_t>& faces,
                                 const Eigen::VectorXd& measured, const TargetAngles& target, const CornerUv& uv,
                                 const std::vector<char>& ignored, const Execution& execution) {
  return execution.SumUp<DistortionSums>(std::ssize(faces), [&](std::int64_t i, DistortionSums* sum) {
    const std::int32_t f = faces[i];
    if (!ignored.empty() && ignored[f]) return;
    const std::array<Vec2, 3> p = TriangleOf(uv, f);
    double angles[3];
    TriangleAngles(p.data(), angles);
    for (int k = 0; k < 3; ++k) {
      const Eigen::Index c = 3 * i + k;
      const double error = std::abs(angles[k] - measured[c]);
      sum->angle_error += error;
      sum->angle_error_max = std::max(sum->angle_error_max, error);
      sum->energy += target.weight[c] * (angles[k] - target.angle[c]) * (angles[k] - target.angle[c]);
    }
    sum->map.Add(p.data(), TriangleOf(mesh.positions, mesh.faces[f]).data());
    ++sum->faces;
  });
}

}  // namespace planish
