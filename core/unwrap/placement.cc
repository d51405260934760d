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

// The points that are farthest in some directions, counter-clockwise (the first of equals).
constexpr int kDirections = 16;
struct Extremes {
  std::array<double, kDirections> distance;
  std::array<std::int64_t, kDirections> point = {};

  Extremes() { distance.fill(-std::numeric_limits<double>::infinity()); }
  void Add(int d, double at, std::int64_t i) {
    if (at <= distance[d]) return;
    distance[d] = at;
    point[d] = i;
  }
  void Add(const Extremes& other) {
    for (int d = 0; d < kDirections; ++d) Add(d, other.distance[d], other.point[d]);
  }
};

Extremes FindExtremes(const std::vector<Vec2>& points, const Execution& execution) {
  std::array<Vec2, kDirections> directions;
  for (int d = 0; d < kDirections; ++d) {
    const double angle = 2 * std::numbers::pi * d / kDirections;
    directions[d] = Vec2(portable::Cos(angle), portable::Sin(angle));
  }
  return execution.SumUp<Extremes>(std::ssize(points), [&](std::int64_t i, Extremes* extremes) {
    for (int d = 0; d < kDirections; ++d) extremes->Add(d, points[i].dot(directions[d]), i);
  });
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
  if (sides.size() < 3) return points;
  struct Candidates {
    std::vector<Vec2> points;
    void Add(const Candidates& other) { points.insert(points.end(), other.points.begin(), other.points.end()); }
  };
  const auto add = [&](std::int64_t i, Candidates* candidates) {
    const auto is_within = [&](const Side& side) { return side.normal.dot(points[i]) > side.offset; };
    if (!std::all_of(sides.begin(), sides.end(), is_within)) candidates->points.push_back(points[i]);
  };
  return execution.SumUp<Candidates>(std::ssize(points), add).points;
}

}  // namespace

double PlaceInUnitSquare(std::vector<Vec2>* points, const Execution& execution) {
  if (points->empty()) return 1;
  std::vector<Vec2> candidates = HullCandidates(*points, execution);
  if (execution.IsCancelled()) return 1;
  const HullRectangle rectangle = LeastRectangle(ConvexHull(std::move(candidates)));
  const Vec2& along = rectangle.along;
  const Vec2 u = rectangle.width >= rectangle.height ? along : Vec2(-along.y(), along.x()), v(-u.y(), u.x());
  const auto n = static_cast<std::int64_t>(points->size());
  const Box bounds = execution.SumUp<Box>(n, [&](std::int64_t i, Box* box) {
    Vec2& p = (*points)[i];
    p = Vec2(p.dot(u), p.dot(v));
    box->Add(p);
  });
  const double side = (bounds.high - bounds.low).maxCoeff();
  if (!(side > 0)) return 1;
  execution.ForEach(n, [&](std::int64_t i) { (*points)[i] = ((*points)[i] - bounds.low) / side; });
  return 1 / side;
}

}  // namespace planish
