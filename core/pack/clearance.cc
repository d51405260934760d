#include "core/pack/clearance.h"

#include <algorithm>
#include <cmath>
#include <numeric>

#include "core/base/portable_math.h"
#include "core/mesh/box_tree.h"
#include "core/mesh/predicates.h"

namespace planish {
namespace {

struct Segment {
  Vec2 a, b;
  Box box;
};

// Chart in its place.
struct Placed {
  std::vector<Vec2> points;
  Box box;
};

double SquareOfDistance(const Segment& s, const Segment& t) {
  const double square = std::min({SquaredDistanceToSegment(s.a, t.a, t.b), SquaredDistanceToSegment(s.b, t.a, t.b),
                                  SquaredDistanceToSegment(t.a, s.a, s.b), SquaredDistanceToSegment(t.b, s.a, s.b)});
  return square > 0 && SegmentsMeet(s.a, s.b, t.a, t.b) ? 0 : square;
}

bool IsInside(const Vec2& p, const Outline& outline, const Placed& placed) {
  int winding = 0;
  for (const auto& [from, to] : outline.edges) {
    const Vec2 &a = placed.points[from], &b = placed.points[to];
    if ((a.y() <= p.y()) == (b.y() <= p.y())) continue;
    const double x = a.x() + (p.y() - a.y()) / (b.y() - a.y()) * (b.x() - a.x());
    if (x > p.x()) winding += b.y() > a.y() ? 1 : -1;
  }
  return winding != 0;
}

// Edges of a chart that come within `reach` of a box.
std::vector<Segment> EdgesNear(const Outline& outline, const Placed& placed, Box box, double reach) {
  box.low -= Vec2::Constant(reach);
  box.high += Vec2::Constant(reach);
  std::vector<Segment> segments;
  for (const auto& [from, to] : outline.edges) {
    Segment segment{placed.points[from], placed.points[to], {}};
    segment.box.Add(segment.a);
    segment.box.Add(segment.b);
    if (segment.box.Meets(box)) segments.push_back(segment);
  }
  return segments;
}

}  // namespace

std::vector<TooNear> FindTooNear(const std::vector<Outline>& outlines, const std::vector<double>& scales,
                                 const std::vector<Body>& bodies, double distance, double low,
                                 const Execution& execution) {
  std::vector<TooNear> found;
  const std::size_t n = outlines.size();
  std::vector<Placed> placed(n);
  for (std::size_t i = 0; i < n; ++i) {
    const double c = scales[i] * portable::Cos(bodies[i].angle), s = scales[i] * portable::Sin(bodies[i].angle);
    for (const Vec2& p : outlines[i].points) {
      placed[i].points.push_back(bodies[i].centre + Vec2(c * p.x() - s * p.y(), s * p.x() + c * p.y()));
      placed[i].box.Add(placed[i].points.back());
    }
    const double out = std::max((Vec2::Constant(low) - placed[i].box.low).maxCoeff(),
                                (placed[i].box.high - Vec2::Constant(1 - low)).maxCoeff());
    if (out > 0) found.push_back({static_cast<std::int32_t>(i), -1, out});
  }
  std::vector<std::int32_t> order(n);
  std::iota(order.begin(), order.end(), 0);
  std::sort(order.begin(), order.end(), [&](std::int32_t a, std::int32_t b) {
    const double x = placed[a].box.low.x(), y = placed[b].box.low.x();
    return x != y ? x < y : a < b;
  });
  for (std::size_t i = 0; i < n && !execution.IsCancelled(); ++i) {
    const std::int32_t a = order[i];
    for (std::size_t j = i + 1; j < n && placed[order[j]].box.low.x() <= placed[a].box.high.x() + distance; ++j) {
      const std::int32_t b = order[j];
      if (bodies[a].tile != bodies[b].tile) continue;
      if (placed[b].box.low.y() > placed[a].box.high.y() + distance) continue;
      if (placed[a].box.low.y() > placed[b].box.high.y() + distance) continue;
      const std::vector<Segment> of_a = EdgesNear(outlines[a], placed[a], placed[b].box, distance);
      const std::vector<Segment> of_b = EdgesNear(outlines[b], placed[b], placed[a].box, distance);
      double nearest = distance * distance;
      for (const Segment& s : of_a) {
        Box box = s.box;
        box.low -= Vec2::Constant(distance);
        box.high += Vec2::Constant(distance);
        for (const Segment& t : of_b) {
          if (t.box.Meets(box)) nearest = std::min(nearest, SquareOfDistance(s, t));
        }
      }
      if (nearest == distance * distance && (IsInside(placed[a].points[0], outlines[b], placed[b]) ||
                                             IsInside(placed[b].points[0], outlines[a], placed[a]))) {
        nearest = 0;
      }
      if (nearest < distance * distance) found.push_back({a, b, distance - std::sqrt(nearest)});
    }
  }
  return found;
}

}  // namespace planish
