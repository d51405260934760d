#include "core/unwrap/distortion.h"

#include <algorithm>
#include <cmath>
#include <limits>
#include <numbers>

#include "Eigen/Geometry"
#include "core/mesh/angles.h"

namespace planish {

namespace {

// Of some faces.
struct Sums {
  double angle_error = 0, angle_error_max = 0, energy = 0;
  double surface_area = 0, uv_area = 0;
  double conformal = 0, conformal_max = 1, stretch = 0;  // the first and the last weighted by area

  void Add(const Sums& other) {
    angle_error += other.angle_error;
    angle_error_max = std::max(angle_error_max, other.angle_error_max);
    energy += other.energy;
    surface_area += other.surface_area;
    uv_area += other.uv_area;
    conformal += other.conformal;
    conformal_max = std::max(conformal_max, other.conformal_max);
    stretch += other.stretch;
  }

  // The face with the corners p in the plane and q on the surface.
  void AddMap(const Vec2 p[3], const Vec3 q[3]) {
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
    const double ratio = twice_uv_area > 0 ? larger / smaller : std::numeric_limits<double>::infinity();
    conformal += area * ratio;
    conformal_max = std::max(conformal_max, ratio);
    stretch += area * (larger * larger + smaller * smaller) / 2;
  }
};

}  // namespace

void MeasureDistortion(const Mesh& mesh, const Eigen::VectorXd& measured, const TargetAngles& target,
                       const CornerUv& uv, Quality* quality, const Execution& execution) {
  Sums sums;
  for (const Sums& part : execution.Collect<Sums>(mesh.num_faces(), [&](std::int64_t begin, std::int64_t end) {
         Sums chunk;
         for (std::int64_t f = begin; f < end; ++f) {
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
           chunk.AddMap(p, q);
         }
         return chunk;
       })) {
    sums.Add(part);
  }
  if (execution.IsStopped()) return;
  const double num_angles = 3.0 * static_cast<double>(mesh.num_faces());
  constexpr double kDegrees = 180 / std::numbers::pi;
  quality->angle_error_mean_deg = sums.angle_error / num_angles * kDegrees;
  quality->angle_error_max_deg = sums.angle_error_max * kDegrees;
  quality->abf_energy = sums.energy / num_angles;
  quality->conformal_distortion_mean = sums.conformal / sums.surface_area;
  quality->conformal_distortion_max = sums.conformal_max;
  quality->stretch_l2 = std::sqrt(sums.stretch / sums.surface_area) * std::sqrt(sums.uv_area / sums.surface_area);
  quality->packing_efficiency = sums.uv_area;
}

}  // namespace planish
