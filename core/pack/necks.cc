#include "core/pack/necks.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <limits>
#include <queue>
#include <utility>

#include "core/base/radix_sort.h"
#include "core/mesh/angles.h"
#include "core/mesh/predicates.h"
#include "core/pack/outline.h"

namespace planish {
namespace {

constexpr std::size_t kMostPoints = 64;  // of a part; only these are considered

// A part of the outline: indices of points, counter-clockwise.
using Part = std::vector<std::int32_t>;

// The points that describe a part's shape best: repeatedly adds the point farthest from the lines between those chosen
// so far (Ramer, Douglas and Peucker). Indices into the part, ascending.
std::vector<std::int32_t> Characteristic(const std::vector<Vec2>& outline, const Part& part) {
  const auto n = static_cast<std::int32_t>(part.size());
  struct Stretch {
    std::int32_t begin, end, farthest;
    double square;
    bool operator<(const Stretch& o) const { return square != o.square ? square < o.square : begin > o.begin; }
  };
  const auto at = [&](std::int32_t i) -> const Vec2& { return outline[part[i == n ? 0 : i]]; };
  const auto measure = [&](std::int32_t begin, std::int32_t end) {
    Stretch stretch = {begin, end, -1, -1};
    for (std::int32_t i = begin + 1; i < end; ++i) {
      const double square = SquaredDistanceToSegment(at(i), at(begin), at(end));
      if (square > stretch.square) stretch.square = square, stretch.farthest = i;
    }
    return stretch;
  };
  std::vector<std::int32_t> chosen = {0};
  std::priority_queue<Stretch> stretches;
  stretches.push(measure(0, n));
  while (!stretches.empty() && chosen.size() < kMostPoints) {
    const Stretch stretch = stretches.top();
    stretches.pop();
    if (!(stretch.square > 0)) break;
    chosen.push_back(stretch.farthest);
    for (const Stretch& half : {measure(stretch.begin, stretch.farthest), measure(stretch.farthest, stretch.end)}) {
      if (half.farthest >= 0) stretches.push(half);
    }
  }
  std::sort(chosen.begin(), chosen.end());
  return chosen;
}

// A convex hull to which points are added one by one.
class GrowingHull {
 public:
  void Clear() {
    hull_.clear();
    doubled_area_ = 0;
  }

  void Add(const Vec2& p) {
    const std::size_t n = hull_.size();
    if (n < 3) {
      if (n < 2 || DoubleArea(hull_[0], hull_[1], p) != 0) {
        hull_.push_back(p);
        if (n < 2) return;
        const double doubled = DoubleArea(hull_[0], hull_[1], p);
        if (doubled < 0) std::swap(hull_[1], hull_[2]);
        doubled_area_ = std::abs(doubled);
      } else if ((p - hull_[0]).squaredNorm() > (hull_[1] - hull_[0]).squaredNorm()) {
        hull_[1] = p;
      }
      return;
    }
    // The sides that p sees from outside form a chain. p replaces the chain's inner points.
    const auto next = [&](std::size_t i) { return i + 1 == n ? 0 : i + 1; };
    const auto outside = [&](std::size_t i) { return -DoubleArea(hull_[i], hull_[next(i)], p); };
    std::size_t first = 0;
    while (first < n && !(outside(first) > 0)) ++first;
    if (first == n) return;
    if (first == 0) {
      std::size_t back = n;
      while (back > 1 && outside(back - 1) > 0) --back;
      first = back % n;
    }
    std::size_t end = first;
    do {
      doubled_area_ += std::max(0.0, outside(end));
      end = next(end);
    } while (end != first && outside(end) > 0);
    std::rotate(hull_.begin(), hull_.begin() + static_cast<std::ptrdiff_t>(end), hull_.end());
    hull_.resize(n - (end + n - first - 1) % n);
    hull_.push_back(p);
  }

  double Area() const { return doubled_area_ / 2; }
  // Whether p is a corner of the hull.
  bool HasCorner(const Vec2& p) const { return std::find(hull_.begin(), hull_.end(), p) != hull_.end(); }

 private:
  std::vector<Vec2> hull_;  // counter-clockwise
  double doubled_area_ = 0;
};

// Whether the open segment between points i and j of a polygon lies inside.
bool IsInside(const std::vector<Vec2>& polygon, std::size_t i, std::size_t j) {
  const std::size_t n = polygon.size();
  const Vec2 &a = polygon[i], &b = polygon[j];
  const auto opens_towards = [&](std::size_t k, const Vec2& to) {
    const Vec2 &before = polygon[(k + n - 1) % n], &p = polygon[k], &after = polygon[(k + 1) % n];
    const bool left_of_next = Orientation(p, after, to) > 0, left_of_last = Orientation(before, p, to) > 0;
    return Orientation(before, p, after) > 0 ? left_of_next && left_of_last : left_of_next || left_of_last;
  };
  if (!opens_towards(i, b) || !opens_towards(j, a)) return false;
  for (std::size_t k = 0; k < n; ++k) {
    const std::size_t next = (k + 1) % n;
    if (k == i || k == j || next == i || next == j) continue;
    if (SegmentsMeet(a, b, polygon[k], polygon[next])) return false;
  }
  return true;
}

// For each point of a polygon, the corners of its hull before and after it; both are the point itself if it is a
// corner.
std::vector<std::array<std::size_t, 2>> CornersAround(const std::vector<Vec2>& polygon, const GrowingHull& hull) {
  const std::size_t n = polygon.size();
  std::vector<std::size_t> corners;
  for (std::size_t i = 0; i < n; ++i) {
    if (hull.HasCorner(polygon[i])) corners.push_back(i);
  }
  std::vector<std::array<std::size_t, 2>> around(n);
  for (std::size_t c = 0; c < corners.size(); ++c) {
    const std::size_t first = corners[c], end = c + 1 < corners.size() ? corners[c + 1] : corners[0] + n;
    around[first] = {first, first};
    for (std::size_t i = first + 1; i < end; ++i) around[i % n] = {first, end % n};
  }
  return around;
}

// The best cut of a part, as indices into the part; from = -1 if every cut gains too little.
Neck BestNeck(const std::vector<Vec2>& outline, const Part& part, const NeckOptions& options) {
  const std::vector<std::int32_t> chosen = Characteristic(outline, part);
  const std::size_t n = chosen.size();
  if (n < 4) return {};
  std::vector<Vec2> polygon;
  polygon.reserve(n);
  for (const std::int32_t i : chosen) polygon.push_back(outline[part[i]]);
  GrowingHull all;
  for (const Vec2& p : polygon) all.Add(p);
  const double whole = all.Area();
  if (!(whole - AreaWithin(polygon) > options.least_gain)) return {};  // no cut can gain more
  // The hull of a part holds the corners of the whole hull on its side and the two ends of the cut. So a cut gains at
  // most the triangles between its ends and the corners next to them. A cut within one pocket gains at most what it
  // cuts off.
  const std::vector<std::array<std::size_t, 2>> around = CornersAround(polygon, all);
  std::vector<double> pocket;
  for (std::size_t i = 0; i < n; ++i) {
    pocket.push_back(std::abs(DoubleArea(polygon[around[i][0]], polygon[i], polygon[around[i][1]])) / 2);
  }
  const auto cost = [&](std::size_t i, std::size_t j) { return options.width * (polygon[j] - polygon[i]).norm(); };
  const auto most_gain = [&](std::size_t i, std::size_t j) {
    if (around[i] != around[j]) return pocket[i] + pocket[j] - cost(i, j);
    const auto [before, after] = around[i];
    const bool is_i_first = (i + n - before) % n < (j + n - before) % n;
    const Vec2 &p = polygon[is_i_first ? i : j], &q = polygon[is_i_first ? j : i];
    return std::abs(DoubleArea(polygon[before], p, q) + DoubleArea(polygon[before], q, polygon[after])) / 2 -
           cost(i, j);
  };
  // Hull areas, grown both ways from each point in a pocket: forth[i][k] is the area for the k + 1 points from i on,
  // back[i][k] for the k + 1 points up to i.
  std::vector<std::vector<double>> forth(n), back(n);
  GrowingHull growing;
  const auto grow_from = [&](std::size_t i) {
    if (!forth[i].empty()) return;
    for (const bool onwards : {true, false}) {
      std::vector<double>& hulls = onwards ? forth[i] : back[i];
      hulls.reserve(n);
      growing.Clear();
      std::size_t at = i;
      for (std::size_t k = 0; k < n; ++k) {
        growing.Add(polygon[at]);
        hulls.push_back(growing.Area());
        at = onwards ? (at + 1 == n ? 0 : at + 1) : (at == 0 ? n - 1 : at - 1);
      }
    }
  };
  struct Candidate {
    double most_gain;
    std::size_t i, j;
    bool operator<(const Candidate& o) const { return most_gain > o.most_gain; }
  };
  std::vector<Candidate> candidates;
  for (std::size_t i = 0; i < n; ++i) {
    for (std::size_t j = i + 2; j < n && j + 1 < n + i; ++j) {
      const double most = most_gain(i, j);
      if (most > options.least_gain) candidates.push_back({most, i, j});
    }
  }
  std::stable_sort(candidates.begin(), candidates.end());
  Neck best;
  best.gain = options.least_gain;
  for (const auto& [most, i, j] : candidates) {
    if (!(most > best.gain)) break;
    const std::size_t inner = j - i, outer = n - inner;
    const bool from_i = pocket[i] >= pocket[j];
    grow_from(from_i ? i : j);
    const double hulls = from_i ? forth[i][inner] + back[i][outer] : forth[j][outer] + back[j][inner];
    const double gain = whole - hulls - cost(i, j);
    if (gain > best.gain && IsInside(polygon, i, j)) best = {chosen[i], chosen[j], gain};
  }
  return best;
}

}  // namespace

std::vector<Neck> FindNecks(const std::vector<Vec2>& outline, const NeckOptions& options) {
  std::vector<Neck> necks;
  // Parts, and the gain of the cut that made each.
  std::vector<std::pair<Part, double>> open = {{Indices(outline.size()), std::numeric_limits<double>::infinity()}};
  while (!open.empty()) {
    const auto [part, most] = std::move(open.back());
    open.pop_back();
    const Neck best = BestNeck(outline, part, options);
    if (best.from < 0) continue;
    const auto [from, to] = std::minmax(part[best.from], part[best.to]);
    const double gain = std::min(most, best.gain);
    necks.push_back({from, to, gain});
    Part inner(part.begin() + best.from, part.begin() + best.to + 1);
    Part outer(part.begin(), part.begin() + best.from + 1);
    outer.insert(outer.end(), part.begin() + best.to, part.end());
    open.emplace_back(std::move(inner), gain);
    open.emplace_back(std::move(outer), gain);
  }
  return necks;
}

}  // namespace planish
