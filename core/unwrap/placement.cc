#include "core/unwrap/placement.h"

#include <algorithm>
#include <limits>

#include "core/mesh/predicates.h"

namespace planish {
namespace {

// Counter-clockwise, without collinear points (Andrew's monotone chain).
std::vector<Vec2> ConvexHull(std::vector<Vec2> points) {
  std::sort(points.begin(), points.end(),
            [](const Vec2& a, const Vec2& b) { return a.x() < b.x() || (a.x() == b.x() && a.y() < b.y()); });
  std::vector<Vec2> hull;
  for (const bool lower : {true, false}) {
    const std::size_t start = hull.size();
    for (const Vec2& p : points) {
      while (hull.size() >= start + 2 && Orientation(hull[hull.size() - 2], hull.back(), p) <= 0) hull.pop_back();
      hull.push_back(p);
    }
    hull.pop_back();
    if (lower) std::reverse(points.begin(), points.end());
  }
  return hull;
}

// Unit vector along the side of the least rectangle that has the longer extent. The rectangle has a side on a hull
// edge.
Vec2 LongAxis(const std::vector<Vec2>& hull) {
  Vec2 best_axis(1, 0);
  double best_area = std::numeric_limits<double>::infinity();
  for (std::size_t i = 0; i < hull.size(); ++i) {
    const Vec2 edge = hull[(i + 1) % hull.size()] - hull[i];
    if (edge.squaredNorm() == 0) continue;
    const Vec2 axis = edge.normalized(), normal(-axis.y(), axis.x());
    Vec2 low = Vec2::Constant(std::numeric_limits<double>::infinity()), high = -low;
    for (const Vec2& p : hull) {
      const Vec2 turned(p.dot(axis), p.dot(normal));
      low = low.cwiseMin(turned);
      high = high.cwiseMax(turned);
    }
    const Vec2 extent = high - low;
    if (extent.prod() < best_area) {
      best_area = extent.prod();
      best_axis = extent.x() >= extent.y() ? axis : normal;
    }
  }
  return best_axis;
}

}  // namespace

void PlaceInUnitSquare(std::vector<Vec2>* points) {
  if (points->empty()) return;
  const Vec2 u = LongAxis(ConvexHull(*points)), v(-u.y(), u.x());
  Vec2 low = Vec2::Constant(std::numeric_limits<double>::infinity()), high = -low;
  for (Vec2& p : *points) {
    p = Vec2(p.dot(u), p.dot(v));
    low = low.cwiseMin(p);
    high = high.cwiseMax(p);
  }
  const double side = (high - low).maxCoeff();
  if (!(side > 0)) return;
  for (Vec2& p : *points) p = (p - low) / side;
}

}  // namespace planish
