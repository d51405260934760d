#include "core/unwrap/distortion.h"

#include <algorithm>
#include <cmath>
#include <limits>
#include <numbers>

#include "Eigen/Geometry"
#include "core/base/portable_math.h"
#include "core/mesh/angles.h"

namespace planish {

namespace {

// Of some faces.
struct Sums {
  double angle_error = 0, angle_error_max = 0, energy = 0;
  std::int64_t faces = 0;
  MapSums map;

  void Add(const Sums& other) {
    angle_error += other.angle_error;
    angle_error_max = std::max(angle_error_max, other.angle_error_max);
    energy += other.energy;
    faces += other.faces;
    map.Add(other.map);
  }
};

}  // namespace

void MapSums::Add(const Vec2 p[3], const Vec3 q[3]) {
  // The map from the plane to the surface is affine with the columns su and sv; its singular values are
  // larger >= smaller, whose product is the ratio of areas.
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

void MeasureDistortion(const Mesh& mesh, const Eigen::VectorXd& measured, const TargetAngles& target,
                       const CornerUv& uv, const std::vector<char>& ignored, Quality* quality,
                       const Execution& execution) {
  Sums sums;
  for (const Sums& part : execution.Collect<Sums>(mesh.num_faces(), [&](std::int64_t begin, std::int64_t end) {
         Sums chunk;
         for (std::int64_t f = begin; f < end; ++f) {
           if (!ignored.empty() && ignored[f]) continue;
           Vec2 p[3];
           Vec3 q[3];
           for (int k = 0; k < 3; ++k) {
             p[k] = Vec2(uv[2 * (3 * f + k)], uv[2 * (3 * f + k) + 1]);
             q[k] = mesh.positions[mesh.faces[f][k]];
           }
           double angles[3];
           TriangleAngles(p, angles);
           for (int k = 0; k < 3; ++k) {
             const Eigen::Index c = 3 * f + k;
             const double error = std::abs(angles[k] - measured[c]);
             chunk.angle_error += error;
             chunk.angle_error_max = std::max(chunk.angle_error_max, error);
             chunk.energy += target.weight[c] * (angles[k] - target.angle[c]) * (angles[k] - target.angle[c]);
           }
           chunk.map.Add(p, q);
           ++chunk.faces;
         }
         return chunk;
       })) {
    sums.Add(part);
  }
  if (execution.IsCancelled()) return;
  if (sums.faces == 0) return;
  const double num_angles = 3.0 * static_cast<double>(sums.faces);
  constexpr double kDegrees = 180 / std::numbers::pi;
  quality->angle_error_mean_deg = sums.angle_error / num_angles * kDegrees;
  quality->angle_error_max_deg = sums.angle_error_max * kDegrees;
  quality->abf_energy = sums.energy / num_angles;
  quality->conformal_distortion_mean = sums.map.conformal / sums.map.surface_area;
  quality->conformal_distortion_max = sums.map.conformal_max;
  quality->stretch_l2 = sums.map.StretchL2();
  quality->packing_efficiency = sums.map.uv_area;
}

}  // namespace planish
