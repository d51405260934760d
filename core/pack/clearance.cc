#include "core/pack/clearance.h"

#include <algorithm>
#include <array>
#include <cmath>

#include "core/mesh/box_tree.h"
#include "core/mesh/predicates.h"

namespace planish {
namespace {

constexpr std::size_t kEdgesOfBlock = 16;  // edges that follow each other, in a box

// Chart in its place.
struct Placed {
  std::vector<Vec2> points;
  Box box;
  std::vector<Box> blocks;  // round kEdgesOfBlock edges of the outline each
};

using Segment = std::array<Vec2, 2>;

Segment EdgeOf(const Outline& outline, const Placed& placed, std::size_t e) {
  return {placed.points[outline.edges[e][0]], placed.points[outline.edges[e][1]]};
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
  const Box near_b = b.box.Grown(distance);
  for (std::size_t i = 0; i < a.blocks.size(); ++i) {
    if (!a.blocks[i].Meets(near_b)) continue;
    const Box near_block = a.blocks[i].Grown(distance);
    for (std::size_t j = 0; j < b.blocks.size(); ++j) {
      if (!b.blocks[j].Meets(near_block)) continue;
      for (std::size_t k = kEdgesOfBlock * i; k < std::min(kEdgesOfBlock * (i + 1), outline_a.edges.size()); ++k) {
        const auto [from, to] = EdgeOf(outline_a, a, k);
        const Box near_s = Box::Round(from, to).Grown(distance);
        if (!b.blocks[j].Meets(near_s)) continue;
        for (std::size_t m = kEdgesOfBlock * j; m < std::min(kEdgesOfBlock * (j + 1), outline_b.edges.size()); ++m) {
          const auto [c, d] = EdgeOf(outline_b, b, m);
          if (Box::Round(c, d).Meets(near_s)) nearest = std::min(nearest, SquaredDistance(from, to, c, d));
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
  std::vector<Box> boxes(n);
  for (std::size_t i = 0; i < n; ++i) {
    const Rotation rotate(bodies[i].angle, scales[i]);
    placed[i].points.reserve(outlines[i].points.size());
    for (const Vec2& p : outlines[i].points) {
      placed[i].points.push_back(bodies[i].centre + rotate(p));
      placed[i].box.Add(placed[i].points.back());
    }
    boxes[i] = placed[i].box;
    placed[i].blocks.resize((outlines[i].edges.size() + kEdgesOfBlock - 1) / kEdgesOfBlock);
    for (std::size_t e = 0; e < outlines[i].edges.size(); ++e) {
      const auto [from, to] = EdgeOf(outlines[i], placed[i], e);
      placed[i].blocks[e / kEdgesOfBlock].Add(Box::Round(from, to));
    }
    const double out = std::max((Vec2::Constant(low) - placed[i].box.low).maxCoeff(),
                                (placed[i].box.high - Vec2::Constant(1 - low)).maxCoeff());
    if (out > 0) found.push_back({static_cast<std::int32_t>(i), -1, out});
  }
  ForEachNearPair(boxes, distance, [&](std::int32_t a, std::int32_t b) {
    if (bodies[a].tile != bodies[b].tile || execution.IsCancelled()) return;
    double nearest = SquareOfLeastDistance(outlines[a], placed[a], outlines[b], placed[b], distance);
    if (nearest == distance * distance && (IsInside(placed[a].points[0], outlines[b], placed[b]) ||
                                           IsInside(placed[b].points[0], outlines[a], placed[a]))) {
      nearest = 0;
    }
    if (nearest < distance * distance) found.push_back({a, b, distance - std::sqrt(nearest)});
  });
  return found;
}

}  // namespace planish
