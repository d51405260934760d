#include "core/unwrap/verify.h"

#include <algorithm>
#include <utility>

#include "core/mesh/box_tree.h"
#include "core/mesh/predicates.h"

namespace planish {
namespace {

constexpr std::size_t kMaxNamed = 16;
constexpr std::int32_t kInterruptInterval = 1024;

Vec2 Uv(const CornerUv& uv, std::int32_t corner) {
  return {uv[2 * corner], uv[2 * corner + 1]};
}

struct BoundaryEdge {
  Vec2 from, to;
};

// Half-edges without a neighbour in the plane, in the order in which they follow each other; empty if they are not one
// closed curve.
std::vector<BoundaryEdge> BoundaryCurve(const Topology& topology, const CornerUv& uv) {
  std::vector<std::int32_t> starting(topology.num_vertices, -1);  // boundary half-edge that starts at a vertex
  std::int32_t count = 0, first = -1;
  for (std::int32_t c = 0; c < topology.num_corners(); ++c) {
    const std::int32_t f = c / 3, from = 3 * f + Next(c % 3), to = 3 * f + Prev(c % 3);
    if (const std::int32_t o = topology.opposite[c]; o >= 0) {
      const std::int32_t g = o / 3, other_to = 3 * g + Next(o % 3), other_from = 3 * g + Prev(o % 3);
      // A seam in the plane: several charts, or one folded onto itself.
      if (Uv(uv, from) != Uv(uv, other_from) || Uv(uv, to) != Uv(uv, other_to)) return {};
      continue;
    }
    starting[topology.faces[f][Next(c % 3)]] = c;
    ++count;
    first = c;
  }
  std::vector<BoundaryEdge> curve;
  for (std::int32_t c = first; static_cast<std::int32_t>(curve.size()) < count;) {
    const std::int32_t f = c / 3;
    curve.push_back({Uv(uv, 3 * f + Next(c % 3)), Uv(uv, 3 * f + Prev(c % 3))});
    c = starting[topology.faces[f][Prev(c % 3)]];
    if (c == first) break;
  }
  if (static_cast<std::int32_t>(curve.size()) != count) return {};
  return curve;
}

bool IsSimple(const std::vector<BoundaryEdge>& curve) {
  const auto n = static_cast<std::int32_t>(curve.size());
  std::vector<Box> boxes(n);
  for (std::int32_t i = 0; i < n; ++i) {
    boxes[i].Add(curve[i].from);
    boxes[i].Add(curve[i].to);
  }
  const BoxTree tree(boxes);
  for (std::int32_t i = 0; i < n; ++i) {
    const bool clear = tree.ForEachMeeting(boxes[i], [&](std::int32_t j) {
      if (j <= i) return true;
      const bool follows = j == i + 1, closes = i == 0 && j == n - 1;
      if (!follows && !closes) return !SegmentsMeet(curve[i].from, curve[i].to, curve[j].from, curve[j].to);
      // Neighbours share a vertex; they meet elsewhere only if one folds back onto the other.
      const BoundaryEdge &before = follows ? curve[i] : curve[j], &after = follows ? curve[j] : curve[i];
      const bool collinear = Orientation(before.from, before.to, after.to) == 0;
      return !(collinear && (before.to - before.from).dot(after.to - after.from) <= 0);
    });
    if (!clear) return false;
  }
  return true;
}

}  // namespace

CornerUv RoundToFloat(const CornerUv& uv) {
  CornerUv rounded(uv.size());
  std::transform(uv.begin(), uv.end(), rounded.begin(),
                 [](double x) { return static_cast<double>(static_cast<float>(x)); });
  return rounded;
}

OrientationFaults CheckOrientations(const CornerUv& uv) {
  OrientationFaults faults;
  const auto num_faces = static_cast<std::int32_t>(uv.size() / 6);
  for (std::int32_t f = 0; f < num_faces; ++f) {
    const int orientation = Orientation(Uv(uv, 3 * f), Uv(uv, 3 * f + 1), Uv(uv, 3 * f + 2));
    if (orientation > 0) continue;
    ++(orientation < 0 ? faults.flipped : faults.degenerate);
    if (faults.faces.size() < kMaxNamed) faults.faces.push_back(f);
  }
  return faults;
}

Overlaps CheckOverlaps(const Topology& topology, const CornerUv& uv, const OrientationFaults& orientation,
                       const Interrupter* interrupter) {
  Overlaps overlaps;
  if (orientation.flipped == 0 && orientation.degenerate == 0) {
    const std::vector<BoundaryEdge> curve = BoundaryCurve(topology, uv);
    if (!curve.empty() && IsSimple(curve)) return overlaps;
  }

  const std::int32_t num_faces = topology.num_faces();
  std::vector<std::array<Vec2, 3>> triangles(num_faces);
  std::vector<Box> boxes(num_faces);
  std::vector<char> has_interior(num_faces);
  for (std::int32_t f = 0; f < num_faces; ++f) {
    auto& [a, b, c] = triangles[f];
    a = Uv(uv, 3 * f);
    b = Uv(uv, 3 * f + 1);
    c = Uv(uv, 3 * f + 2);
    const int sign = Orientation(a, b, c);
    if (sign < 0) std::swap(b, c);
    has_interior[f] = sign != 0;
    for (const Vec2& p : triangles[f]) boxes[f].Add(p);
  }
  const BoxTree tree(boxes);
  for (std::int32_t f = 0; f < num_faces && !overlaps.limited; ++f) {
    if (f % kInterruptInterval == 0 && IsInterrupted(interrupter)) overlaps.limited = true;
    if (!has_interior[f]) continue;
    tree.ForEachMeeting(boxes[f], [&](std::int32_t g) {
      if (g <= f || !has_interior[g] || !InteriorsMeet(triangles[f].data(), triangles[g].data())) return true;
      ++overlaps.pairs;
      if (overlaps.faces.size() < kMaxNamed) overlaps.faces.insert(overlaps.faces.end(), {f, g});
      overlaps.limited = overlaps.pairs >= kMaxOverlaps;
      return !overlaps.limited;
    });
  }
  return overlaps;
}

}  // namespace planish
