#include "core/mesh/surface_places.h"

#include <algorithm>
#include <array>
#include <cmath>

#include "Eigen/Geometry"

namespace planish {
namespace {

// The place of a triangle nearest to a point (Ericson 2005).
Vec3 NearestOf(const std::array<rays::Point, 3>& triangle, const Vec3& p) {
  const Vec3 a = ToVec3(triangle[0]), b = ToVec3(triangle[1]), c = ToVec3(triangle[2]);
  const Vec3 ab = b - a, ac = c - a, ap = p - a, bp = p - b, cp = p - c;
  const double d1 = ab.dot(ap), d2 = ac.dot(ap), d3 = ab.dot(bp), d4 = ac.dot(bp), d5 = ab.dot(cp), d6 = ac.dot(cp);
  const double va = d3 * d6 - d5 * d4, vb = d5 * d2 - d1 * d6, vc = d1 * d4 - d3 * d2;
  if (d1 <= 0 && d2 <= 0) return a;
  if (d3 >= 0 && d4 <= d3) return b;
  if (d6 >= 0 && d5 <= d6) return c;
  if (vc <= 0 && d1 >= 0 && d3 <= 0) return a + d1 / (d1 - d3) * ab;
  if (vb <= 0 && d2 >= 0 && d6 <= 0) return a + d2 / (d2 - d6) * ac;
  if (va <= 0 && d4 - d3 >= 0 && d5 - d6 >= 0) return b + (d4 - d3) / ((d4 - d3) + (d5 - d6)) * (c - b);
  const double sum = va + vb + vc;
  return sum > 0 ? Vec3(a + vb / sum * ab + vc / sum * ac) : a;
}

}  // namespace

SurfacePlaces::SurfacePlaces(const Mesh& mesh, const RayScene& scene) : scene_(scene), normal_(scene.faces.size()) {
  for (std::size_t i = 0; i < normal_.size(); ++i) {
    const auto [a, b, c] = TriangleOf(mesh.positions, mesh.faces[scene.faces[i]]);
    const Vec3 area = ((b - a) / (2 * scene.half)).cross((c - a) / (2 * scene.half));
    area_ += area.norm();
    so_far_.push_back(area_);
    normal_[i] = area.norm() > 0 ? Vec3(area.normalized()) : Vec3(Vec3::Zero());
  }
}

std::vector<SurfacePlaces::Place> SurfacePlaces::Samples(int count) const {
  std::vector<Place> samples;
  for (int k = 0; k < count; ++k) {
    const double wanted = area_ * (k + 0.5) / count;
    const auto i = std::min<std::size_t>(std::lower_bound(so_far_.begin(), so_far_.end(), wanted) - so_far_.begin(),
                                         so_far_.size() - 1);
    constexpr double kOne = 0.7548776662466927, kTwo = 0.5698402909980532;  // fractions of the plastic number
    double u = k * kOne - std::floor(k * kOne), v = k * kTwo - std::floor(k * kTwo);
    if (u + v > 1) {
      u = 1 - u;
      v = 1 - v;
    }
    const std::array<rays::Point, 3>& triangle = scene_.solid->triangle(i);
    const Vec3 a = ToVec3(triangle[0]), b = ToVec3(triangle[1]), c = ToVec3(triangle[2]);
    samples.push_back({i, a + u * (b - a) + v * (c - a), normal_[i]});
  }
  return samples;
}

std::optional<SurfacePlaces::Place> SurfacePlaces::Nearest(const Vec3& p, const Vec3& normal, double reach,
                                                           double cosine, const std::optional<Place>& guess) const {
  std::optional<Place> nearest;
  double least = reach * reach;
  const auto look = [&](std::size_t i) {
    if (!(normal_[i].dot(normal) >= cosine)) return false;
    const Vec3 at = NearestOf(scene_.solid->triangle(i), p);
    const double squared = (at - p).squaredNorm();
    if (!(squared < least || (nearest && squared == least && i < nearest->triangle))) return false;
    least = squared;
    nearest = {i, at, normal_[i]};
    return true;
  };
  if (guess) look(guess->triangle);
  scene_.solid->ForEachNear(ToPoint(p), static_cast<float>(std::sqrt(least)), [&](std::size_t i, float* left) {
    if (look(i)) *left = static_cast<float>(std::sqrt(least));
  });
  return nearest;
}

}  // namespace planish
