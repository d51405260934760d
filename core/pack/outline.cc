#include "core/pack/outline.h"

#include <algorithm>
#include <cmath>
#include <limits>
#include <numbers>
#include <numeric>

#include "core/base/portable_math.h"
#include "core/mesh/predicates.h"
#include "core/pack/pack.h"

namespace planish {

// The chain of Andrew: O(n log n).
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

namespace {

double Cross(const Vec2& a, const Vec2& b) {
  return a.x() * b.y() - a.y() * b.x();
}

// Puts edges behind one another wherever one ends at the start of another: loop by loop.
void OrderAlongLoops(std::size_t points, std::vector<std::array<std::int32_t, 2>>* edges) {
  std::vector<std::size_t> begin_of(points + 1, 0);
  for (const auto& edge : *edges) ++begin_of[edge[0] + 1];
  std::partial_sum(begin_of.begin(), begin_of.end(), begin_of.begin());
  std::vector<std::size_t> from(edges->size()), next(begin_of.begin(), begin_of.end() - 1);
  for (std::size_t e = 0; e < edges->size(); ++e) from[next[(*edges)[e][0]]++] = e;
  std::copy(begin_of.begin(), begin_of.end() - 1, next.begin());  // the first edge at each point that is not used yet
  std::vector<char> used(edges->size(), 0);
  std::vector<std::array<std::int32_t, 2>> ordered;
  ordered.reserve(edges->size());
  for (std::size_t start = 0; start < edges->size(); ++start) {
    for (std::size_t e = start; !used[e];) {
      used[e] = 1;
      ordered.push_back((*edges)[e]);
      std::size_t& at = next[ordered.back()[1]];
      const std::size_t end = begin_of[ordered.back()[1] + 1];
      while (at < end && used[from[at]]) ++at;
      if (at == end) break;
      e = from[at];
    }
  }
  *edges = std::move(ordered);
}

double UprightAngle(const std::vector<Vec2>& hull) {
  const std::size_t n = hull.size();
  if (n < 2) return 0;
  double best_area = std::numeric_limits<double>::infinity(), best_angle = 0;
  // Farthest along the side, along its normal, and against the side; they only move on.
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
    if (width * height < best_area) {
      best_area = width * height;
      best_angle = -portable::Atan2(along.y(), along.x()) + (height > width ? std::numbers::pi / 2 : 0);
    }
  }
  return best_angle;
}

}  // namespace

Outline MakeOutline(const PackChart& chart) {
  Outline outline;
  // Half-edges, those of faces that turn the wrong way reversed; what has its opposite beside it is inside.
  struct HalfEdge {
    std::int32_t from, to;
  };
  std::vector<HalfEdge> half_edges;
  half_edges.reserve(3 * chart.faces.size());
  Box box;
  for (const Face& face : chart.faces) {
    const Vec2 &a = chart.positions[face[0]], &b = chart.positions[face[1]], &c = chart.positions[face[2]];
    const double twice_area = Cross(b - a, c - a);
    outline.area += std::abs(twice_area) / 2;
    for (const Vec2& p : {a, b, c}) box.Add(p);
    for (int k = 0; k < 3; ++k) {
      const std::int32_t from = face[k], to = face[Next(k)];
      half_edges.push_back(twice_area < 0 ? HalfEdge{to, from} : HalfEdge{from, to});
    }
  }
  if (chart.faces.empty()) {
    for (const Vec2& p : chart.positions) box.Add(p);
    for (std::int32_t i = 0; i < static_cast<std::int32_t>(chart.positions.size()); ++i) {
      half_edges.push_back({i, i});
    }
    if (chart.positions.empty()) box.Add(Vec2::Zero());
  }
  outline.centre = box.low + (box.high - box.low) / 2;

  // Those of an edge side by side, edges by their lower and then by their higher vertex: a few start at each vertex.
  const auto low_of = [](const HalfEdge& e) { return std::min(e.from, e.to); };
  const auto high_of = [](const HalfEdge& e) { return std::max(e.from, e.to); };
  std::vector<std::size_t> begin_of(chart.positions.size() + 1, 0);
  for (const HalfEdge& e : half_edges) ++begin_of[low_of(e) + 1];
  std::partial_sum(begin_of.begin(), begin_of.end(), begin_of.begin());
  std::vector<HalfEdge> sorted(half_edges.size());
  std::vector<std::size_t> next(begin_of.begin(), begin_of.end() - 1);
  for (const HalfEdge& e : half_edges) sorted[next[low_of(e)]++] = e;
  for (std::size_t v = 0; v + 1 < begin_of.size(); ++v) {
    std::sort(sorted.begin() + static_cast<std::ptrdiff_t>(begin_of[v]),
              sorted.begin() + static_cast<std::ptrdiff_t>(begin_of[v + 1]),
              [&](const HalfEdge& a, const HalfEdge& b) { return high_of(a) < high_of(b); });
  }
  std::vector<std::int32_t> local(chart.positions.size(), -1);
  const auto local_id = [&](std::int32_t v) {
    if (local[v] < 0) {
      local[v] = static_cast<std::int32_t>(outline.points.size());
      outline.points.push_back(chart.positions[v] - outline.centre);
    }
    return local[v];
  };
  for (std::size_t begin = 0; begin < sorted.size();) {
    const std::int32_t low = low_of(sorted[begin]), high = high_of(sorted[begin]);
    std::size_t end = begin;
    std::int64_t forward = 0;
    for (; end < sorted.size() && low_of(sorted[end]) == low && high_of(sorted[end]) == high; ++end) {
      forward += sorted[end].from < sorted[end].to ? 1 : -1;
    }
    if (low == high) {
      outline.edges.push_back({local_id(low), local_id(low)});
    } else {
      for (std::int64_t i = 0; i < std::abs(forward); ++i) {
        const std::int32_t a = local_id(low), b = local_id(high);
        outline.edges.push_back(forward > 0 ? std::array<std::int32_t, 2>{a, b} : std::array<std::int32_t, 2>{b, a});
      }
    }
    begin = end;
  }
  if (outline.edges.empty()) {  // faces that are folded onto each other
    for (const HalfEdge& e : half_edges) outline.edges.push_back({local_id(e.from), local_id(e.to)});
    if (outline.points.empty()) {
      outline.points.push_back(Vec2::Zero());
      outline.edges.push_back({0, 0});
    }
  }
  OrderAlongLoops(outline.points.size(), &outline.edges);
  for (const Vec2& p : outline.points) outline.radius = std::max(outline.radius, p.norm());
  outline.hull = ConvexHull(outline.points);
  outline.upright = UprightAngle(outline.hull);
  return outline;
}

Outline Simplified(const Outline& outline, double tolerance) {
  constexpr std::size_t kLongestRun = 32;  // edges that become one, at most: the search is linear then
  Outline simple = outline;
  simple.points.clear();  // their memory stays, and is enough
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

Box BoxAt(const Outline& outline, double angle) {
  const double c = portable::Cos(angle), s = portable::Sin(angle);
  Box box;
  for (const Vec2& p : outline.hull) box.Add(Vec2(c * p.x() - s * p.y(), s * p.x() + c * p.y()));
  return box;
}

double AngleOfSmallestSquare(const Outline& outline) {
  const auto side = [&](double angle) {
    const Box box = BoxAt(outline, angle);
    return (box.high - box.low).maxCoeff();
  };
  // Between two turns that bring a side of the hull upright the extents are sums of sines with one maximum each; a
  // scan finds the right valley, a golden section its bottom.
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

}  // namespace planish
