#include "core/unwrap/chart_spacing.h"

#include <algorithm>
#include <cmath>
#include <map>
#include <utility>

#include "core/mesh/box_tree.h"
#include "core/mesh/predicates.h"

namespace planish {

ChartSpacing FindChartSpacing(const std::vector<OutlineSegment>& segments, const std::vector<std::int32_t>& tile,
                              double reach, double wanted, std::int64_t max_tests, const Execution& execution) {
  std::vector<Box> boxes;
  boxes.reserve(segments.size());
  for (const OutlineSegment& s : segments) boxes.push_back(Box::Around(s.a, s.b));
  const BoxTree tree(std::move(boxes), execution);
  std::int64_t tests_left = max_tests;
  // Calls visit(a, b, distance) for segments of two charts a < b that are at most `radius` apart. visit may reduce the
  // radius.
  const auto for_each_pair = [&](const double& radius, const auto& visit) {
    for (std::size_t i = 0; i < segments.size() && tests_left > 0; ++i) {
      tree.ForEachMeeting(tree.boxes()[i].Grown(radius), [&](std::int32_t j) {
        if (--tests_left <= 0) return false;
        if (static_cast<std::size_t>(j) <= i) return true;
        const OutlineSegment &s = segments[i], &t = segments[j];
        const std::int32_t one = tile[s.chart], other = tile[t.chart];
        if (s.chart == t.chart || (one != other && one >= 0 && other >= 0)) return true;
        const double distance = std::sqrt(SquaredDistance(s.a, s.b, t.a, t.b));
        if (distance <= radius) visit(std::min(s.chart, t.chart), std::max(s.chart, t.chart), distance);
        return true;
      });
    }
  };
  ChartSpacing spacing;
  // Widens the radius step by step, so that few segments are tested if charts are close.
  constexpr double kFirst = 1.0 / 256, kWiden = 4;  // relative to `reach`; factor of each step
  ChartPair& nearest = spacing.nearest;
  for (double radius = kFirst * reach;; radius *= kWiden) {
    double best = std::min(radius, reach);
    for_each_pair(best, [&](std::int32_t a, std::int32_t b, double distance) {
      const bool is_first = distance == nearest.distance && std::pair(a, b) < std::pair(nearest.a, nearest.b);
      if (distance < nearest.distance || is_first) nearest = {a, b, distance};
      best = std::min(best, distance);
    });
    if (nearest.a >= 0 || radius >= reach || tests_left <= 0) break;
  }
  std::map<std::pair<std::int32_t, std::int32_t>, double> found;
  if (wanted > 0) {
    for_each_pair(wanted, [&](std::int32_t a, std::int32_t b, double distance) {
      if (distance >= wanted) return;
      const auto known = found.find({a, b});
      if (known != found.end()) {
        known->second = std::min(known->second, distance);
      } else if (found.size() < kMaxNearPairs) {
        found.emplace(std::pair(a, b), distance);
      } else {
        spacing.limited = true;
      }
    });
  }
  for (const auto& [charts, distance] : found) spacing.near.push_back({charts.first, charts.second, distance});
  spacing.limited |= tests_left <= 0 || execution.IsCancelled();
  return spacing;
}

}  // namespace planish
