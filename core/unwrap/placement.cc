#include "core/unwrap/placement.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <limits>
#include <numbers>
#include <utility>

#include "core/base/portable_math.h"
#include "core/mesh/box_tree.h"
#include "core/pack/outline.h"

namespace planish {
namespace {

constexpr double kInfinity = std::numeric_limits<double>::infinity();

// The points that are farthest in some directions, counter-clockwise (the first of equals).
constexpr int kDirections = 16;
struct Extremes {
  std::array<double, kDirections> distance;
  std::array<std::int64_t, kDirections> point = {};

  Extremes() { distance.fill(-kInfinity); }
};

Extremes FindExtremes(const std::vector<Vec2>& points, const Execution& execution) {
  std::array<Vec2, kDirections> directions;
  for (int d = 0; d < kDirections; ++d) {
    const double angle = 2 * std::numbers::pi * d / kDirections;
    directions[d] = Vec2(portable::Cos(angle), portable::Sin(angle));
  }
  Extremes extremes;
  for (const Extremes& part :
       execution.Collect<Extremes>(static_cast<std::int64_t>(points.size()), [&](std::int64_t begin, std::int64_t end) {
         Extremes chunk;
         for (int d = 0; d < kDirections; ++d) {
           for (std::int64_t i = begin; i < end; ++i) {
             const double distance = points[i].dot(directions[d]);
             if (distance > chunk.distance[d]) {
               chunk.distance[d] = distance;
               chunk.point[d] = i;
             }
           }
         }
         return chunk;
       })) {
    for (int d = 0; d < kDirections; ++d) {
      if (part.distance[d] <= extremes.distance[d]) continue;
      extremes.distance[d] = part.distance[d];
      extremes.point[d] = part.point[d];
    }
  }
  return extremes;
}

// Those of the points that may be corners of their convex hull: all but those well inside of the polygon of the
// extremes.
std::vector<Vec2> HullCandidates(const std::vector<Vec2>& points, const Execution& execution) {
  const Extremes extremes = FindExtremes(points, execution);
  // normal . p > offset inside.
  struct Side {
    Vec2 normal;
    double offset;
  };
  std::vector<Side> sides;
  const auto& distance = extremes.distance;
  const double extent = std::abs(distance[0]) + std::abs(distance[4]) + std::abs(distance[8]) + std::abs(distance[12]);
  for (int d = 0; d < kDirections; ++d) {
    const Vec2 &from = points[extremes.point[d]], &to = points[extremes.point[(d + 1) % kDirections]];
    if (from == to) continue;
    const Vec2 along = to - from, normal(-along.y(), along.x());
    const double margin = 1e-14 * normal.lpNorm<1>() * extent;  // more than rounding can do
    sides.push_back({normal, normal.dot(from) + margin});
  }
  std::vector<Vec2> candidates;
  if (sides.size() < 3) return points;
  for (const std::vector<Vec2>&part : execution.Collect<std::vector<Vec2>>(
           static_cast<std::int64_t>(points.size()), [&](std::int64_t begin, std::int64_t end) {
             std::vector<Vec2> chunk;
             for (std::int64_t i = begin; i < end; ++i) {
               const bool inside = std::all_of(sides.begin(), sides.end(), [&](const Side& side) {
                 return side.normal.dot(points[i]) > side.offset;
               });
               if (!inside) chunk.push_back(points[i]);
             }
             return chunk;
           })) {
    candidates.insert(candidates.end(), part.begin(), part.end());
  }
  return candidates;
}

// Unit vector along the side of the least rectangle that has the longer extent. The rectangle has a side on a hull
// edge; the points where its other sides touch go round the hull with that edge (rotating calipers).
Vec2 LongAxis(const std::vector<Vec2>& hull, const Execution& execution) {
  Vec2 best_axis(1, 0);
  double best_area = kInfinity;
  const std::size_t n = hull.size();
  // Farthest along the edge, away from it, and back along it.
  std::size_t front = 1, far = 1, back = 1;
  for (std::size_t i = 0; i < n; ++i) {
    if (execution.IsCancelledAt(static_cast<std::int64_t>(i))) break;
    const Vec2 edge = hull[(i + 1) % n] - hull[i];
    if (edge.squaredNorm() == 0) continue;
    const Vec2 axis = edge.normalized(), normal(-axis.y(), axis.x());
    const auto advance = [&](std::size_t* at, const Vec2& direction) {
      while (*at < i + n && (hull[(*at + 1) % n] - hull[*at % n]).dot(direction) >= 0) ++*at;
    };
    front = std::max(front, i + 1);
    advance(&front, axis);
    far = std::max(far, front);
    advance(&far, normal);
    back = std::max(back, far);
    advance(&back, -axis);
    const Vec2 extent((hull[front % n] - hull[back % n]).dot(axis), (hull[far % n] - hull[i]).dot(normal));
    if (extent.prod() < best_area) {
      best_area = extent.prod();
      best_axis = extent.x() >= extent.y() ? axis : normal;
    }
  }
  return best_axis;
}

}  // namespace

double PlaceInUnitSquare(std::vector<Vec2>* points, const Execution& execution) {
  if (points->empty()) return 1;
  std::vector<Vec2> candidates = HullCandidates(*points, execution);
  if (execution.IsCancelled()) return 1;
  const Vec2 u = LongAxis(ConvexHull(std::move(candidates)), execution), v(-u.y(), u.x());
  const auto n = static_cast<std::int64_t>(points->size());
  const Box bounds = execution.SumUp<Box>(n, [&](std::int64_t i, Box* box) {
    Vec2& p = (*points)[i];
    p = Vec2(p.dot(u), p.dot(v));
    box->Add(p);
  });
  const double side = (bounds.high - bounds.low).maxCoeff();
  if (!(side > 0)) return 1;
  execution.For(n, [&](std::int64_t begin, std::int64_t end) {
    for (std::int64_t i = begin; i < end; ++i) (*points)[i] = ((*points)[i] - bounds.low) / side;
  });
  return 1 / side;
}

}  // namespace planish
