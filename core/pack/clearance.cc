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

  Box BoxRound() const {
    Box box;
    box.Add(a);
    box.Add(b);
    return box;
  }
};

constexpr std::size_t kEdgesOfBlock = 16;  // edges that follow each other, in a box

// Chart in its place.
struct Placed {
  std::vector<Vec2> points;
  Box box;
  std::vector<Box> blocks;  // round kEdgesOfBlock edges of the outline each
};

Segment EdgeOf(const Outline& outline, const Placed& placed, std::size_t e) {
  return {placed.points[outline.edges[e][0]], placed.points[outline.edges[e][1]]};
}

Box Around(Box box, double reach) {
  box.low -= Vec2::Constant(reach);
  box.high += Vec2::Constant(reach);
  return box;
}

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

// The least distance between edges of two charts; its square, and that of `distance` if all are farther apart.
double SquareOfLeastDistance(const Outline& outline_a, const Placed& a, const Outline& outline_b, const Placed& b,
                             double distance) {
  double nearest = distance * distance;
  const Box near_b = Around(b.box, distance);
  for (std::size_t i = 0; i < a.blocks.size(); ++i) {
    if (!a.blocks[i].Meets(near_b)) continue;
    const Box near_block = Around(a.blocks[i], distance);
    for (std::size_t j = 0; j < b.blocks.size(); ++j) {
      if (!b.blocks[j].Meets(near_block)) continue;
      for (std::size_t k = kEdgesOfBlock * i; k < std::min(kEdgesOfBlock * (i + 1), outline_a.edges.size()); ++k) {
        const Segment s = EdgeOf(outline_a, a, k);
        const Box near_s = Around(s.BoxRound(), distance);
        if (!b.blocks[j].Meets(near_s)) continue;
        for (std::size_t m = kEdgesOfBlock * j; m < std::min(kEdgesOfBlock * (j + 1), outline_b.edges.size()); ++m) {
          const Segment t = EdgeOf(outline_b, b, m);
          if (t.BoxRound().Meets(near_s)) nearest = std::min(nearest, SquareOfDistance(s, t));
        }
      }
    }
  }
  return nearest;
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
    placed[i].points.reserve(outlines[i].points.size());
    for (const Vec2& p : outlines[i].points) {
      placed[i].points.push_back(bodies[i].centre + Vec2(c * p.x() - s * p.y(), s * p.x() + c * p.y()));
      placed[i].box.Add(placed[i].points.back());
    }
    placed[i].blocks.resize((outlines[i].edges.size() + kEdgesOfBlock - 1) / kEdgesOfBlock);
    for (std::size_t e = 0; e < outlines[i].edges.size(); ++e) {
      placed[i].blocks[e / kEdgesOfBlock].Add(EdgeOf(outlines[i], placed[i], e).BoxRound());
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
      double nearest = SquareOfLeastDistance(outlines[a], placed[a], outlines[b], placed[b], distance);
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
