#include "core/unwrap/chart_spacing.h"

#include <algorithm>
#include <cmath>
#include <map>
#include <utility>

#include "core/mesh/box_tree.h"
#include "core/mesh/predicates.h"

namespace planish {
namespace {

class SpacingSearch {
 public:
  SpacingSearch(const std::vector<OutlineSegment>& segments, const std::vector<std::int32_t>& tile,
                std::int64_t max_tests, const Execution& execution)
      : segments_(segments), tile_(tile), tree_(BoxesOf(segments), execution), tests_left_(max_tests) {}

  // The nearest pair within `reach`. Wider and wider, so that few segments are looked at where charts lie close.
  ChartPair Nearest(double reach) {
    constexpr double kFirst = 1.0 / 256, kWiden = 4;  // of the reach; each time
    ChartPair nearest;
    for (double radius = kFirst * reach; nearest.a < 0; radius *= kWiden) {
      radius = std::min(radius, reach);
      double best = radius;
      ForEachPair([&] { return best; },
                  [&](std::int32_t a, std::int32_t b, double distance) {
                    const bool is_first =
                        distance == nearest.distance && std::pair(a, b) < std::pair(nearest.a, nearest.b);
                    if (distance < nearest.distance || is_first) nearest = {a, b, distance};
                    best = std::min(best, distance);
                  });
      if (radius >= reach || IsLimited()) break;
    }
    return nearest;
  }

  std::vector<ChartPair> Within(double wanted) {
    std::map<std::pair<std::int32_t, std::int32_t>, double> found;
    ForEachPair([&] { return wanted; },
                [&](std::int32_t a, std::int32_t b, double distance) {
                  if (distance >= wanted) return;
                  const auto known = found.find({a, b});
                  if (known != found.end()) {
                    known->second = std::min(known->second, distance);
                  } else if (found.size() < kMaxNearPairs) {
                    found.emplace(std::pair(a, b), distance);
                  } else {
                    is_full_ = true;
                  }
                });
    std::vector<ChartPair> pairs;
    for (const auto& [charts, distance] : found) pairs.push_back({charts.first, charts.second, distance});
    return pairs;
  }

  bool IsLimited() const { return tests_left_ <= 0 || is_full_; }

 private:
  static std::vector<Box> BoxesOf(const std::vector<OutlineSegment>& segments) {
    std::vector<Box> boxes;
    boxes.reserve(segments.size());
    for (const OutlineSegment& s : segments) boxes.push_back(Box::Around(s.a, s.b));
    return boxes;
  }

  bool AreComparable(std::int32_t a, std::int32_t b) const {
    return a != b && (tile_[a] == tile_[b] || tile_[a] < 0 || tile_[b] < 0);
  }

  // visit(a, b, distance) for segments of two charts that are at most radius() apart, a < b.
  template <typename Radius, typename Visit>
  void ForEachPair(const Radius& radius, const Visit& visit) {
    for (std::size_t i = 0; i < segments_.size() && tests_left_ > 0; ++i) {
      tree_.ForEachMeeting(tree_.boxes()[i].Grown(radius()), [&](std::int32_t j) {
        if (--tests_left_ <= 0) return false;
        const OutlineSegment &s = segments_[i], &t = segments_[j];
        if (static_cast<std::size_t>(j) <= i || !AreComparable(s.chart, t.chart)) return true;
        const double distance = std::sqrt(SquaredDistance(s.a, s.b, t.a, t.b));
        if (distance <= radius()) visit(std::min(s.chart, t.chart), std::max(s.chart, t.chart), distance);
        return true;
      });
    }
  }

  const std::vector<OutlineSegment>& segments_;
  const std::vector<std::int32_t>& tile_;
  const BoxTree tree_;
  std::int64_t tests_left_;
  bool is_full_ = false;
};

}  // namespace

ChartSpacing FindChartSpacing(const std::vector<OutlineSegment>& segments, const std::vector<std::int32_t>& tile,
                              double reach, double wanted, std::int64_t max_tests, const Execution& execution) {
  ChartSpacing spacing;
  SpacingSearch search(segments, tile, max_tests, execution);
  spacing.nearest = search.Nearest(reach);
  if (wanted > 0) spacing.near = search.Within(wanted);
  spacing.limited = search.IsLimited() || execution.IsCancelled();
  return spacing;
}

}  // namespace planish
