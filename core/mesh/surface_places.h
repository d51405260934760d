// Places of a surface: samples, and the place nearest to a point.
#pragma once

#include <cstddef>
#include <optional>
#include <vector>

#include "core/mesh/mesh.h"
#include "core/mesh/ray_scene.h"

namespace planish {

inline Vec3 ToVec3(const rays::Point& p) {
  return {p[0], p[1], p[2]};
}

inline rays::Point ToPoint(const Vec3& p) {
  return {static_cast<float>(p.x()), static_cast<float>(p.y()), static_cast<float>(p.z())};
}

// Places are in the coordinates of the scene, whose diagonal is 1. Const calls are thread-safe.
class SurfacePlaces {
 public:
  // `scene` must have been made of `mesh`, and must outlive this object.
  SurfacePlaces(const Mesh& mesh, const RayScene& scene);

  double area() const { return area_; }

  struct Place {
    std::size_t triangle = 0;  // of the scene
    Vec3 at = Vec3::Zero(), normal = Vec3::Zero();
  };

  // Places that are spread evenly over the area.
  std::vector<Place> Samples(int count) const;

  // The place nearest to a point among those whose normal has at least this cosine with `normal`; nullopt if there is
  // none within `reach`. The search is faster with a `guess`, a place that may be near.
  std::optional<Place> Nearest(const Vec3& p, const Vec3& normal, double reach, double cosine,
                               const std::optional<Place>& guess = {}) const;

 private:
  const RayScene& scene_;
  std::vector<Vec3> normal_;    // per triangle of the scene; 0 if it has no area
  std::vector<double> so_far_;  // area of this triangle and those before
  double area_ = 0;
};

}  // namespace planish
