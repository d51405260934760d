#include "core/unwrap/verify.h"

#include <algorithm>
#include <atomic>
#include <iterator>
#include <set>
#include <span>
#include <utility>

#include "core/mesh/box_tree.h"
#include "core/mesh/half_edges.h"
#include "core/mesh/predicates.h"

namespace planish {

CornerUv RoundToFloat(const CornerUv& uv, bool flips, const Execution& execution) {
  CornerUv rounded(uv.size());
  execution.ForEach(static_cast<std::int64_t>(uv.size()), [&](std::int64_t i) {
    // Floats below 0.5 are closer to each other than those above, so 1 - v might not be a float: rounds 1 - v there.
    rounded[i] = flips && i % 2 == 1 && uv[i] < 0.5 ? 1 - static_cast<double>(static_cast<float>(1 - uv[i]))
                                                    : static_cast<double>(static_cast<float>(uv[i]));
  });
  return rounded;
}

OrientationFaults CheckOrientations(const CornerUv& uv, const Execution& execution, const std::vector<char>& ignored) {
  const auto check = [&](std::int64_t f, OrientationFaults* faults) {
    const int orientation = !ignored.empty() && ignored[f] ? 1 : Orientation(TriangleOf(uv, f));
    if (orientation > 0) return;
    ++(orientation < 0 ? faults->flipped : faults->degenerate);
    if (faults->faces.size() < kMaxNamed) faults->faces.push_back(static_cast<std::int32_t>(f));
  };
  return execution.SumUp<OrientationFaults>(std::ssize(uv) / 6, check);
}

void OrientationFaults::Add(const OrientationFaults& other) {
  flipped += other.flipped;
  degenerate += other.degenerate;
  const std::size_t room = std::min(kMaxNamed - faces.size(), other.faces.size());
  faces.insert(faces.end(), other.faces.begin(), other.faces.begin() + room);
}

namespace {

Vec2 From(const CornerUv& uv, std::int32_t c) {
  return UvOf(uv, 3 * (c / 3) + Next(c % 3));
}
Vec2 To(const CornerUv& uv, std::int32_t c) {
  return UvOf(uv, 3 * (c / 3) + Prev(c % 3));
}

struct Outlines : Loops {
  std::vector<std::int32_t> loop_of;   // of each item
  std::vector<std::int32_t> chart_of;  // of each loop; set by FindCharts()
  std::int32_t num_charts = 0;
};

void FindCharts(const std::vector<std::int32_t>& opposite, Outlines* outlines) {
  const std::vector<std::int32_t> chart =
      ConnectedPieces(static_cast<std::int32_t>(opposite.size() / 3), &outlines->num_charts,
                      [&](std::int32_t f, int k) { return opposite[3 * f + k] < 0 ? -1 : opposite[3 * f + k] / 3; });
  for (std::int32_t i = 0; i < outlines->count(); ++i) outlines->chart_of.push_back(chart[(*outlines)[i][0] / 3]);
}

bool DoNotMeet(const Outlines& outlines, const CornerUv& uv, const BoxTree& tree, std::atomic<std::int64_t>* tests_left,
               const Execution& execution) {
  const auto n = static_cast<std::int32_t>(outlines.item.size());
  const auto follower = [&](std::int32_t i) {
    const std::int32_t loop = outlines.loop_of[i];
    return i + 1 == outlines.begin[loop + 1] ? outlines.begin[loop] : i + 1;
  };
  std::atomic<bool> are_clear = true;
  execution.ForEach(n, [&](std::int64_t item) {
    if (!are_clear.load(std::memory_order_relaxed)) return;
    const auto i = static_cast<std::int32_t>(item);
    std::int64_t tests = 0;
    const std::int64_t left = *tests_left;
    const Vec2 from = From(uv, outlines.item[i]), to = To(uv, outlines.item[i]);
    const bool is_clear = tree.ForEachMeeting(tree.boxes()[i], [&](std::int32_t j) {
      if (++tests > left) return false;
      if (j <= i) return true;
      const Vec2 other_from = From(uv, outlines.item[j]), other_to = To(uv, outlines.item[j]);
      const bool follows = follower(i) == j, precedes = follower(j) == i;
      if (!follows && !precedes) return !SegmentsMeet(from, to, other_from, other_to);
      // Neighbours share an end; they intersect elsewhere only if one folds back onto the other.
      const Vec2 &a = follows ? from : other_from, &b = follows ? to : other_to, &c = follows ? other_to : to;
      return !(Orientation(a, b, c) == 0 && (b - a).dot(c - b) <= 0);
    });
    tests_left->fetch_sub(tests, std::memory_order_relaxed);
    if (!is_clear) are_clear = false;
  });
  return are_clear && !execution.IsCancelled();
}

// The orientation of a simple loop: 1 counter-clockwise, -1 clockwise, 0 if its lowest corner has no area. Determined
// at the leftmost of its lowest corners, as no other part of the loop is below it.
int SenseOf(const Outlines& outlines, std::int32_t loop, const CornerUv& uv) {
  const std::span<const std::int32_t> half_edges = outlines[loop];
  std::size_t lowest = 0;
  for (std::size_t i = 1; i < half_edges.size(); ++i) {
    const Vec2 p = From(uv, half_edges[i]), q = From(uv, half_edges[lowest]);
    if (p.y() < q.y() || (p.y() == q.y() && p.x() < q.x())) lowest = i;
  }
  const std::size_t before = (lowest + half_edges.size() - 1) % half_edges.size();
  return Orientation(From(uv, half_edges[before]), From(uv, half_edges[lowest]), To(uv, half_edges[lowest]));
}

// Whether one loop of each chart runs counter-clockwise and all others clockwise, as round holes. An inverted hole
// overlaps the faces round it, although its sides meet only at its corners.
bool HolesAreOpen(const Outlines& outlines, const CornerUv& uv) {
  std::vector<char> has_outer(outlines.num_charts, 0);
  for (std::int32_t loop = 0; loop < outlines.count(); ++loop) {
    const int sense = SenseOf(outlines, loop, uv);
    if (sense == 0 || (sense > 0 && has_outer[outlines.chart_of[loop]] != 0)) return false;
    if (sense > 0) has_outer[outlines.chart_of[loop]] = 1;
  }
  return true;
}

// Whether some chart lies inside another one: the outlines of other charts wind round a point of its outline. Also true
// after too many tests.
bool LiesInsideAnother(const Outlines& outlines, const CornerUv& uv, const BoxTree& tree,
                       std::atomic<std::int64_t>* tests_left, const Execution& execution) {
  std::vector<Box> box_of_chart(outlines.num_charts);
  for (std::size_t j = 0; j < tree.boxes().size(); ++j) {
    box_of_chart[outlines.chart_of[outlines.loop_of[j]]].Add(tree.boxes()[j]);
  }
  const BoxTree charts(std::move(box_of_chart), execution);
  std::vector<char> done(outlines.num_charts, 0);
  for (std::size_t loop = 0; loop < outlines.chart_of.size() && !execution.IsCancelled(); ++loop) {
    const std::int32_t chart = outlines.chart_of[loop];
    if (done[chart]) continue;
    done[chart] = 1;
    const Vec2 p = From(uv, outlines.item[outlines.begin[loop]]);
    const Box at = Box::Around(p, p);
    Box ray = at;
    // Only charts whose box holds the point p can wind round it.
    const auto may_hold = [&](std::int32_t other) { return other != chart && charts.boxes()[other].Meets(at); };
    charts.ForEachMeeting(at, [&](std::int32_t other) {
      if (other != chart) ray.Add(Vec2(charts.boxes()[other].high.x(), p.y()));
      return --*tests_left >= 0;
    });
    if (*tests_left < 0) return true;
    if (ray.high.x() == p.x()) continue;
    // Counts how often their outlines cross a ray to the right.
    int winding = 0;
    tree.ForEachMeeting(ray, [&](std::int32_t j) {
      if (--*tests_left < 0) return false;
      if (!may_hold(outlines.chart_of[outlines.loop_of[j]])) return true;
      const Vec2 from = From(uv, outlines.item[j]), to = To(uv, outlines.item[j]);
      if (from.y() <= p.y() && to.y() > p.y() && Orientation(from, to, p) > 0) ++winding;
      if (from.y() > p.y() && to.y() <= p.y() && Orientation(from, to, p) < 0) --winding;
      return true;
    });
    if (winding != 0 || *tests_left < 0) return true;
  }
  return false;
}

// Whether no outline of a chart intersects itself or another one, no edge inside a chart is torn (both sides have the
// same (u, v) at its ends), and no chart is inside the area of another. Exact. For maps whose triangles all have
// positive orientation. Also false after a cancellation or too many tests.
bool OutlinesAreApart(const std::vector<std::int32_t>& opposite, const CornerUv& uv, std::int64_t max_tests,
                      const Execution& execution) {
  const std::int64_t torn = execution.Count(std::ssize(opposite), [&](std::int32_t c) {
    const std::int32_t o = opposite[c];
    return o >= 0 && o < c && (From(uv, c) != To(uv, o) || To(uv, c) != From(uv, o));
  });
  if (torn > 0 || execution.IsCancelled()) return false;
  Outlines outlines = {BoundaryLoops(opposite), {}, {}};
  for (std::int32_t i = 0; i < outlines.count(); ++i) outlines.loop_of.resize(outlines.begin[i + 1], i);
  if (outlines.item.empty()) return false;
  std::vector<Box> boxes;
  boxes.reserve(outlines.item.size());
  for (const std::int32_t c : outlines.item) boxes.push_back(Box::Around(From(uv, c), To(uv, c)));
  const BoxTree tree(std::move(boxes), execution);
  std::atomic<std::int64_t> tests_left = max_tests;
  if (!DoNotMeet(outlines, uv, tree, &tests_left, execution)) return false;
  if (outlines.count() == 1) return true;  // no other loop can be inside this one
  FindCharts(opposite, &outlines);
  return HolesAreOpen(outlines, uv) && !LiesInsideAnother(outlines, uv, tree, &tests_left, execution) &&
         !execution.IsCancelled();
}

using Triangle = std::array<Vec2, 3>;  // counter-clockwise

// Stores face f in `triangle`, counter-clockwise. Returns whether the face has an area and is not marked in `ignored`.
bool HasInterior(const CornerUv& uv, const std::vector<char>& ignored, std::int32_t f, Triangle* triangle) {
  Triangle& t = *triangle = TriangleOf(uv, f);
  const int sign = Orientation(t);
  if (sign < 0) std::swap(t[1], t[2]);
  return sign != 0 && (ignored.empty() || !ignored[f]);
}

}  // namespace

// Tests every triangle against all later ones.
Overlaps FindOverlaps(const CornerUv& uv, std::int64_t max_tests, std::vector<std::int32_t>* pairs,
                      const Execution& execution, const std::vector<char>& ignored, std::int64_t max_pairs) {
  if (execution.IsCancelled()) return {0, true, {}};
  const auto num_faces = static_cast<std::int32_t>(uv.size() / 6);
  std::vector<Triangle> triangles(num_faces);
  std::vector<Box> boxes(num_faces);
  execution.ForEach(num_faces, [&](std::int32_t f) {
    if (!HasInterior(uv, ignored, f, &triangles[f])) return;
    for (const Vec2& p : triangles[f]) boxes[f].Add(p);
  });
  const BoxTree tree(std::move(boxes), execution);
  if (execution.IsCancelled()) return {0, true, {}};
  std::atomic<std::int64_t> pair_count = 0, test_count = 0;  // so far
  const auto is_at_limit = [&] { return pair_count >= max_pairs || test_count >= max_tests; };
  // Finds pairs of the faces in [begin, end) with later ones, until either count reaches its limit.
  const auto look = [&](std::int64_t begin, std::int64_t end, std::vector<std::int32_t>* found) {
    for (auto f = static_cast<std::int32_t>(begin); f < end && !execution.IsCancelled(); ++f) {
      if (is_at_limit()) return;
      const Box& box = tree.boxes()[f];
      if (!box.Meets(box)) continue;
      std::int64_t tests = 0;
      const std::int64_t tests_left = max_tests - test_count;
      tree.ForEachMeeting(box, [&](std::int32_t g) {
        if (++tests >= tests_left) return false;
        if (g <= f || !InteriorsMeet(triangles[f].data(), triangles[g].data())) return true;
        const std::int64_t before = pair_count.fetch_add(1, std::memory_order_relaxed);
        if (before >= max_pairs) return false;
        found->insert(found->end(), {f, g});
        return before + 1 < max_pairs;
      });
      test_count.fetch_add(tests, std::memory_order_relaxed);
    }
  };
  // Faces are tested in blocks, so that counting can stop early with the same result for any team.
  constexpr std::int64_t kBlock = 64, kBlocks = 64;
  Overlaps all;
  for (std::int64_t begin = 0; begin < num_faces && !all.limited; begin += kBlock * kBlocks) {
    const std::int64_t end = std::min<std::int64_t>(begin + kBlock * kBlocks, num_faces);
    const std::int64_t tests_before = test_count;
    std::array<std::vector<std::int32_t>, kBlocks> found;
    const auto look_at_block = [&](std::int64_t i, std::int64_t) {
      const std::int64_t from = std::min(begin + i * kBlock, end);
      look(from, std::min(from + kBlock, end), &found[i]);
    };
    execution.For(kBlocks, look_at_block, 1);
    all.limited = is_at_limit() || execution.IsCancelled();
    if (all.limited) {
      // The limit was reached within some block: repeats them one after the other.
      found = {};
      pair_count = all.pairs;
      test_count = tests_before;
      look(begin, end, &found[0]);
    }
    all.pairs = pair_count;
    for (const std::vector<std::int32_t>& faces : found) {
      for (const std::int32_t f : faces) {
        if (all.faces.size() < kMaxNamed) all.faces.push_back(f);
      }
      if (pairs != nullptr) pairs->insert(pairs->end(), faces.begin(), faces.end());
    }
  }
  return all;
}

// A vertical line sweeps over the triangles from left to right (Shamos and Hoey 1976) and holds those that it crosses,
// in their order along it. Left of the first place at which two interiors intersect, interiors are disjoint and their
// order is well defined. At that place the two triangles are neighbours on the line: one of them has just begun, or all
// triangles between them have just ended, since a convex shape does not narrow to a point and widen again. So it
// suffices to compare a triangle with its neighbours when it begins, and new neighbours when one ends. Exact, as
// VerticalOrder() is.
Overlaps FindOneOverlap(const CornerUv& uv, const Execution& execution, const std::vector<char>& ignored) {
  if (execution.IsCancelled()) return {0, true, {}};
  std::vector<Triangle> triangles(uv.size() / 6);
  std::vector<std::int32_t> events;  // 2 f: face f begins, 2 f + 1: it ends; in the order of the sweep
  for (std::int32_t f = 0; f < static_cast<std::int32_t>(triangles.size()); ++f) {
    if (HasInterior(uv, ignored, f, &triangles[f])) events.insert(events.end(), {2 * f, 2 * f + 1});
  }
  const auto place_of = [&](std::int32_t event) {
    const Triangle& t = triangles[event / 2];
    return event % 2 == 0 ? *std::min_element(t.begin(), t.end(), SweepsFirst)
                          : *std::max_element(t.begin(), t.end(), SweepsFirst);
  };
  // At a point, triangles end before others begin.
  std::sort(events.begin(), events.end(), [&](std::int32_t a, std::int32_t b) {
    const Vec2 p = place_of(a), q = place_of(b);
    if (p != q) return SweepsFirst(p, q);
    return a % 2 != b % 2 ? a % 2 > b % 2 : a < b;
  });
  std::vector<std::int32_t> meet;  // two faces whose interiors intersect, the last ones compared
  const auto is_below = [&](std::int32_t a, std::int32_t b) {
    if (a == b) return false;
    const int order = VerticalOrder(triangles[a].data(), triangles[b].data());
    if (order == 0) meet = {std::min(a, b), std::max(a, b)};
    return order < 0;
  };
  std::set<std::int32_t, decltype(is_below)> line(is_below);
  std::vector<decltype(line)::iterator> place(triangles.size());
  for (std::size_t i = 0; i < events.size() && meet.empty() && !execution.IsCancelledAt(i); ++i) {
    const std::int32_t f = events[i] / 2;
    if (events[i] % 2 == 0) {
      const auto [at, is_new] = line.insert(f);
      place[f] = at;
      // The order contradicts itself: the magnitudes differ too much for Orientation().
      if (!is_new && meet.empty()) meet = {std::min(f, *at), std::max(f, *at)};
    } else if (const auto next = line.erase(place[f]); next != line.begin() && next != line.end()) {
      is_below(*std::prev(next), *next);
    }
  }
  if (!meet.empty()) return {1, true, meet};
  return {0, execution.IsCancelled(), {}};
}

bool OutlinesProveNoOverlap(const std::vector<std::int32_t>& opposite, const CornerUv& uv,
                            const OrientationFaults& orientation, std::int64_t max_tests, const Execution& execution,
                            const std::vector<char>& ignored) {
  const bool all_upright =
      orientation.flipped == 0 && orientation.degenerate == 0 &&
      (ignored.empty() || execution.Count(static_cast<std::int64_t>(ignored.size()), [&](std::int64_t f) {
        return ignored[f] && Orientation(TriangleOf(uv, f)) <= 0;
      }) == 0);
  return all_upright && OutlinesAreApart(opposite, uv, max_tests, execution);
}

Overlaps CheckOverlaps(const std::vector<std::int32_t>& opposite, const CornerUv& uv,
                       const OrientationFaults& orientation, const Execution& execution,
                       const std::vector<char>& ignored, std::int64_t max_pairs) {
  // Enough tests for triangles of ordinary shapes. For others, as in a fan of needles, a sweep first finds out whether
  // there is an overlap at all. Only then are pairs counted, with enough tests for 2,000 triangles of any shape, all
  // against all.
  constexpr std::int64_t kTests = 2'000'000, kTestsPerFace = 64;
  const std::int64_t tests = kTestsPerFace * static_cast<std::int64_t>(uv.size() / 6);
  if (OutlinesProveNoOverlap(opposite, uv, orientation, tests, execution, ignored)) return {};
  const Overlaps overlaps = FindOverlaps(uv, tests, nullptr, execution, ignored, max_pairs);
  if (!overlaps.limited || overlaps.pairs >= max_pairs) return overlaps;
  const Overlaps one = overlaps.pairs > 0 ? overlaps : FindOneOverlap(uv, execution, ignored);
  if (one.pairs == 0 || max_pairs == 1) return one;
  const Overlaps counted = FindOverlaps(uv, tests + kTests, nullptr, execution, ignored, max_pairs);
  return counted.pairs > 0 ? counted : one;
}

}  // namespace planish
