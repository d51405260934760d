#include "tests/bench/uv_islands.h"

#include <algorithm>
#include <set>
#include <utility>

#include "core/mesh/box_tree.h"
#include "core/mesh/half_edges.h"
#include "core/mesh/predicates.h"

namespace planish::bench {
namespace {

Vec2 At(const CornerUv& uv, std::int32_t corner) {
  return {uv[2 * corner], uv[2 * corner + 1]};
}
std::int32_t OriginCorner(std::int32_t c) {
  return 3 * (c / 3) + Next(c % 3);
}
std::int32_t TargetCorner(std::int32_t c) {
  return 3 * (c / 3) + Prev(c % 3);
}

struct Segment {
  Vec2 a, b;
  std::int32_t chart;
};

double Distance(const Vec2& p, const Segment& s) {
  const Vec2 along = s.b - s.a;
  const double squared = along.squaredNorm();
  const double t = squared > 0 ? std::clamp((p - s.a).dot(along) / squared, 0.0, 1.0) : 0;
  return (p - s.a - t * along).norm();
}

double Distance(const Segment& s, const Segment& t) {
  if (SegmentsMeet(s.a, s.b, t.a, t.b)) return 0;
  return std::min({Distance(s.a, t), Distance(s.b, t), Distance(t.a, s), Distance(t.b, s)});
}

}  // namespace

UvIslands FindUvIslands(const Mesh& mesh, const CornerUv& uv, const std::vector<char>& ignored) {
  UvIslands islands;
  islands.opposite.assign(3 * mesh.faces.size(), -1);
  const EdgeGroups edges = GroupHalfEdges(mesh.faces, mesh.num_vertices());
  const auto joins = [&](std::int32_t c, std::int32_t d) {
    return Origin(mesh.faces, c) == Target(mesh.faces, d) && At(uv, OriginCorner(c)) == At(uv, TargetCorner(d)) &&
           At(uv, TargetCorner(c)) == At(uv, OriginCorner(d));
  };
  for (std::int32_t e = 0; e < edges.count(); ++e) {
    for (std::int32_t i = edges.begin[e]; i < edges.begin[e + 1]; ++i) {
      const std::int32_t c = edges.item[i];
      for (std::int32_t j = i + 1; j < edges.begin[e + 1] && islands.opposite[c] < 0; ++j) {
        const std::int32_t d = edges.item[j];
        if (ignored[c / 3] || ignored[d / 3] || islands.opposite[d] >= 0 || !joins(c, d)) continue;
        islands.opposite[c] = d;
        islands.opposite[d] = c;
      }
    }
  }
  islands.chart.assign(mesh.faces.size(), -1);
  for (std::int32_t first = 0; first < static_cast<std::int32_t>(mesh.faces.size()); ++first) {
    if (ignored[first] || islands.chart[first] >= 0) continue;
    std::vector<std::int32_t> pending = {first};
    islands.chart[first] = islands.count;
    while (!pending.empty()) {
      const std::int32_t f = pending.back();
      pending.pop_back();
      for (std::int32_t c = 3 * f; c < 3 * f + 3; ++c) {
        const std::int32_t neighbour = islands.opposite[c] / 3;
        if (islands.opposite[c] < 0 || islands.chart[neighbour] >= 0) continue;
        islands.chart[neighbour] = islands.count;
        pending.push_back(neighbour);
      }
    }
    ++islands.count;
  }
  return islands;
}

std::int64_t CountTooNear(const UvIslands& islands, const CornerUv& uv, double distance) {
  std::vector<Segment> segments;
  std::vector<Box> boxes;
  for (std::int32_t c = 0; c < static_cast<std::int32_t>(islands.opposite.size()); ++c) {
    if (islands.chart[c / 3] < 0 || islands.opposite[c] >= 0) continue;
    segments.push_back({At(uv, OriginCorner(c)), At(uv, TargetCorner(c)), islands.chart[c / 3]});
    Box box;
    box.Add(segments.back().a);
    box.Add(segments.back().b);
    boxes.push_back(box);
  }
  const BoxTree tree(boxes);
  std::set<std::pair<std::int32_t, std::int32_t>> near;
  for (std::size_t i = 0; i < segments.size(); ++i) {
    Box reach = boxes[i];
    reach.low -= Vec2::Constant(distance);
    reach.high += Vec2::Constant(distance);
    tree.ForEachMeeting(reach, [&](std::int32_t j) {
      if (segments[i].chart < segments[j].chart && Distance(segments[i], segments[j]) < distance) {
        near.insert({segments[i].chart, segments[j].chart});
      }
      return true;
    });
  }
  return static_cast<std::int64_t>(near.size());
}

}  // namespace planish::bench
