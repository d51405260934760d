#include "core/unwrap/distortion.h"

#include <algorithm>
#include <cmath>
#include <numbers>

#include "Eigen/Geometry"
#include "core/mesh/angles.h"

namespace planish {

void MeasureDistortion(const Mesh& mesh, const Eigen::VectorXd& measured, const TargetAngles& target,
                       const CornerUv& uv, Quality* quality) {
  double angle_error_sum = 0, angle_error_max = 0, energy = 0;
  double surface_area = 0, uv_area = 0, conformal_sum = 0, conformal_max = 1, stretch_sum = 0;
  for (std::int64_t f = 0; f < mesh.num_faces(); ++f) {
    Vec2 p[3];
    Vec3 q[3];
    for (int k = 0; k < 3; ++k) {
      p[k] = Vec2(uv[2 * (3 * f + k)], uv[2 * (3 * f + k) + 1]);
      q[k] = mesh.positions[mesh.faces[f][k]];
    }
    for (int k = 0; k < 3; ++k) {
      const Eigen::Index c = 3 * f + k;
      const double angle = AngleAt(p[k], p[Next(k)], p[Prev(k)]);
      const double error = std::abs(angle - measured[c]);
      angle_error_sum += error;
      angle_error_max = std::max(angle_error_max, error);
      energy += target.weight[c] * (angle - target.angle[c]) * (angle - target.angle[c]);
    }
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
    const double larger = std::sqrt((a + c + std::hypot(a - c, 2 * b)) / 2);
    const double smaller = 2 * area / twice_uv_area / larger;
    const double conformal = twice_uv_area > 0 ? larger / smaller : std::numeric_limits<double>::infinity();
    conformal_sum += area * conformal;
    conformal_max = std::max(conformal_max, conformal);
    stretch_sum += area * (larger * larger + smaller * smaller) / 2;
  }
  const double num_angles = 3.0 * static_cast<double>(mesh.num_faces());
  constexpr double kDegrees = 180 / std::numbers::pi;
  quality->angle_error_mean_deg = angle_error_sum / num_angles * kDegrees;
  quality->angle_error_max_deg = angle_error_max * kDegrees;
  quality->abf_energy = energy / num_angles;
  quality->conformal_distortion_mean = conformal_sum / surface_area;
  quality->conformal_distortion_max = conformal_max;
  quality->stretch_l2 = std::sqrt(stretch_sum / surface_area) * std::sqrt(uv_area / surface_area);
  quality->packing_efficiency = uv_area;
}

}  // namespace planish
