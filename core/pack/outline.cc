#include "core/pack/outline.h"

#include <algorithm>
#include <cmath>
#include <limits>
#include <numbers>

#include "core/mesh/angles.h"
#include "core/mesh/half_edges.h"
#include "core/mesh/predicates.h"
#include "core/pack/pack.h"

namespace planish {

// Andrew's monotone chain, O(n log n).
std::vector<Vec2> ConvexHull(std::vector<Vec2> points) {
  const auto before = [](const Vec2& a, const Vec2& b) { return a.x() != b.x() ? a.x() < b.x() : a.y() < b.y(); };
  std::sort(points.begin(), points.end(), before);
  points.erase(std::unique(points.begin(), points.end()), points.end());
  if (points.size() < 3) return points;
  std::vector<Vec2> hull;
  for (const bool lower : {true, false}) {
    const std::size_t begin = hull.size();
    const std::size_t n = points.size();
    for (std::size_t i = 0; i < n; ++i) {
      const Vec2& p = points[lower ? i : n - 1 - i];
      while (hull.size() >= begin + 2 && Orientation(hull[hull.size() - 2], hull.back(), p) <= 0) hull.pop_back();
      hull.push_back(p);
    }
    hull.pop_back();
  }
  return hull;
}

double AreaWithin(const std::vector<Vec2>& polygon) {
  double doubled = 0;
  for (std::size_t i = 2; i < polygon.size(); ++i) doubled += DoubleArea(polygon[0], polygon[i - 1], polygon[i]);
  return doubled / 2;
}

namespace {

// Reorders edges so that each starts where the one before ends, loop by loop.
void OrderAlongLoops(std::size_t num_points, std::vector<std::array<std::int32_t, 2>>* edges) {
  const auto n = static_cast<std::int32_t>(edges->size());
  const Groups from =
      GroupByKey(n, static_cast<std::int64_t>(num_points), [&](std::int32_t e) { return (*edges)[e][0]; });
  std::vector<std::int32_t> next(from.begin.begin(), from.begin.end() - 1);  // the first unused edge from each point
  std::vector<char> used(n, 0);
  std::vector<std::array<std::int32_t, 2>> ordered;
  ordered.reserve(n);
  for (std::int32_t start = 0; start < n; ++start) {
    for (std::int32_t e = start; !used[e];) {
      used[e] = 1;
      ordered.push_back((*edges)[e]);
      std::int32_t& at = next[ordered.back()[1]];
      const std::int32_t end = from.begin[ordered.back()[1] + 1];
      while (at < end && used[from.item[at]]) ++at;
      if (at == end) break;
      e = from.item[at];
    }
  }
  *edges = std::move(ordered);
}

}  // namespace

// Uses rotating calipers.
HullRectangle LeastRectangle(const std::vector<Vec2>& hull) {
  HullRectangle best;
  double least = std::numeric_limits<double>::infinity();
  const std::size_t n = hull.size();
  // The corners farthest along the side, along its normal and against the side. They only move forward.
  std::size_t right = 0, top = 0, left = 0;
  for (std::size_t i = 0; i < n; ++i) {
    const Vec2 along = (hull[(i + 1) % n] - hull[i]).normalized(), normal(-along.y(), along.x());
    const auto advance = [&](std::size_t* at, const Vec2& direction) {
      for (std::size_t step = 0; step < n; ++step) {
        const std::size_t next = (*at + 1) % n;
        if ((hull[next] - hull[*at]).dot(direction) <= 0) break;
        *at = next;
      }
    };
    if (i == 0) right = 0;
    advance(&right, along);
    if (i == 0) top = right;
    advance(&top, normal);
    if (i == 0) left = top;
    advance(&left, -along);
    const double width = (hull[right] - hull[left]).dot(along), height = (hull[top] - hull[i]).dot(normal);
    if (!(width * height < least)) continue;
    least = width * height;
    best = {along, width, height};
  }
  return best;
}

Outline MakeOutline(const PackChart& chart) {
  Outline outline;
  // Without faces, each point becomes a face.
  std::vector<Face> points;
  for (std::int32_t v = 0; chart.faces.empty() && v < std::ssize(chart.positions); ++v) points.push_back({v, v, v});
  const std::vector<Face>& faces = chart.faces.empty() ? points : chart.faces;
  Box box;
  std::vector<char> is_reversed;  // per face: whether it runs clockwise
  is_reversed.reserve(faces.size());
  for (const Face& face : faces) {
    const std::array<Vec2, 3> triangle = TriangleOf(chart.positions, face);
    const double twice_area = DoubleArea(triangle);
    outline.area += std::abs(twice_area) / 2;
    is_reversed.push_back(twice_area < 0);
    for (const Vec2& p : triangle) box.Add(p);
  }
  if (faces.empty()) box.Add(Vec2::Zero());
  outline.centre = box.low + (box.high - box.low) / 2;

  std::vector<std::int32_t> local(chart.positions.size(), -1);
  const auto local_id = [&](std::int32_t v) {
    if (local[v] < 0) {
      local[v] = static_cast<std::int32_t>(outline.points.size());
      outline.points.push_back(chart.positions[v] - outline.centre);
    }
    return local[v];
  };
  // An edge with opposite half-edges on both sides is inside. Half-edges of reversed faces count in the other
  // direction.
  const EdgeGroups groups = GroupHalfEdges(faces, std::ssize(chart.positions));
  for (std::int32_t e = 0; e < groups.count(); ++e) {
    const std::int32_t first = groups[e][0];
    const auto [low, high] = std::minmax({Origin(faces, first), Target(faces, first)});
    std::int64_t forward = 0;
    for (const std::int32_t c : groups[e]) {
      forward += (Origin(faces, c) == low) != (is_reversed[c / 3] != 0) ? 1 : -1;
    }
    if (low == high) forward = 1;
    if (forward == 0) continue;
    const std::int32_t a = local_id(low), b = local_id(high);
    for (; forward > 0; --forward) outline.edges.push_back({a, b});
    for (; forward < 0; ++forward) outline.edges.push_back({b, a});
  }
  if (outline.edges.empty()) {  // all faces are folded onto each other
    for (std::int32_t c = 0; c < 3 * std::ssize(faces); ++c) {
      const std::int32_t from = local_id(faces[c / 3][c % 3]), to = local_id(faces[c / 3][Next(c % 3)]);
      is_reversed[c / 3] != 0 ? outline.edges.push_back({to, from}) : outline.edges.push_back({from, to});
    }
  }
  if (outline.edges.empty()) {
    outline.points.push_back(Vec2::Zero());
    outline.edges.push_back({0, 0});
  }
  OrderAlongLoops(outline.points.size(), &outline.edges);
  for (const Vec2& p : outline.points) outline.radius = std::max(outline.radius, p.norm());
  outline.hull = ConvexHull(outline.points);
  if (outline.hull.size() > 1) {
    const HullRectangle rectangle = LeastRectangle(outline.hull);
    outline.upright = -portable::Atan2(rectangle.along.y(), rectangle.along.x()) +
                      (rectangle.height > rectangle.width ? std::numbers::pi / 2 : 0);
  }
  // Frees spare memory, since there may be a hundred thousand charts of one triangle.
  outline.points.shrink_to_fit();
  outline.edges.shrink_to_fit();
  outline.hull.shrink_to_fit();
  return outline;
}

Outline Simplified(const Outline& outline, double tolerance) {
  constexpr std::size_t kLongestRun = 32;  // at most this many edges become one, which keeps the search linear
  Outline simple = outline;
  simple.points.clear();  // keeps the memory, which is enough
  simple.edges.clear();
  std::vector<std::int32_t> local(outline.points.size(), -1);
  const auto local_id = [&](std::int32_t v) {
    if (local[v] < 0) {
      local[v] = static_cast<std::int32_t>(simple.points.size());
      simple.points.push_back(outline.points[v]);
    }
    return local[v];
  };
  const auto& edges = outline.edges;
  double slack2 = outline.slack * outline.slack;
  for (std::size_t begin = 0; begin < edges.size();) {
    const Vec2& a = outline.points[edges[begin][0]];
    std::size_t last = begin;
    double slack2_of_run = 0;
    for (std::size_t e = begin + 1; e < std::min(edges.size(), begin + kLongestRun); ++e) {
      if (edges[e][0] != edges[e - 1][1]) break;
      const Vec2& b = outline.points[edges[e][1]];
      double farthest2 = 0;
      for (std::size_t k = begin; k < e && farthest2 <= tolerance * tolerance; ++k) {
        farthest2 = std::max(farthest2, SquaredDistanceToSegment(outline.points[edges[k][1]], a, b));
      }
      if (farthest2 > tolerance * tolerance) break;
      last = e;
      slack2_of_run = farthest2;
    }
    slack2 = std::max(slack2, slack2_of_run);
    simple.edges.push_back({local_id(edges[begin][0]), local_id(edges[last][1])});
    begin = last + 1;
  }
  simple.slack = std::sqrt(slack2);
  return simple;
}

void ScanLines::AddEdge(Vec2 from, Vec2 to, double offset) {
  const int change = from.y() > to.y() ? 1 : -1;  // the inside lies to the right of a descending edge
  if (change > 0) std::swap(from, to);
  const int end = Ceil(to.y() - offset);
  for (int y = Ceil(from.y() - offset); y < end; ++y) {
    const double t = (y + offset - from.y()) / (to.y() - from.y());
    const double x = from.x() + t * (to.x() - from.x());
    crossings_.push_back({y, Ceil(x - offset), change});
  }
}

void ScanLines::ForEachInside(const std::function<void(int y, int begin, int end)>& fill) {
  std::sort(crossings_.begin(), crossings_.end(),
            [](const Crossing& a, const Crossing& b) { return a.y != b.y ? a.y < b.y : a.x < b.x; });
  int winding = 0;
  for (std::size_t i = 0; i + 1 < crossings_.size(); ++i) {
    winding += crossings_[i].change;
    if (winding == 0 || crossings_[i + 1].y != crossings_[i].y) continue;
    fill(crossings_[i].y, crossings_[i].x, crossings_[i + 1].x);
  }
}

Box BoxAt(const Outline& outline, double angle) {
  const Rotation rotate(angle);
  Box box;
  for (const Vec2& p : outline.hull) box.Add(rotate(p));
  return box;
}

double AngleOfSmallestSquare(const Outline& outline) {
  const auto side = [&](double angle) {
    const Box box = BoxAt(outline, angle);
    return (box.high - box.low).maxCoeff();
  };
  // Between two angles at which a side of the hull is upright, the extents are sums of sines with one maximum each. A
  // scan finds the best interval, a golden-section search its minimum.
  constexpr int kScan = 360;
  const double step = std::numbers::pi / 2 / kScan;
  double best = side(outline.upright), best_angle = outline.upright;
  for (int i = 0; i < kScan; ++i) {
    const double value = side(i * step);
    if (value < best) {
      best = value;
      best_angle = i * step;
    }
  }
  double low = best_angle - step, high = best_angle + step;
  const double golden = (std::sqrt(5.0) - 1) / 2;
  for (int i = 0; i < 40; ++i) {
    const double a = high - golden * (high - low), b = low + golden * (high - low);
    if (side(a) < side(b)) {
      high = b;
    } else {
      low = a;
    }
  }
  const double refined = (low + high) / 2;
  return side(refined) < best ? refined : best_angle;
}

double PlaceInUnitSquare(std::vector<Vec2> outline, std::vector<Vec2>* points, const Execution& execution) {
  const HullRectangle rectangle = LeastRectangle(ConvexHull(std::move(outline)));
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
