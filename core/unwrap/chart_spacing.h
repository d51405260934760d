// Distances between the charts of a map: exact distances of their outlines, not rasterized.
#pragma once

#include <cstdint>
#include <limits>
#include <vector>

#include "core/base/execution.h"
#include "core/mesh/mesh.h"

namespace planish {

// An edge of a chart's outline, in the plane of the map.
struct OutlineSegment {
  Vec2 a, b;
  std::int32_t chart;
};

struct ChartPair {
  std::int32_t a = -1, b = -1;  // charts, a < b
  double distance = std::numeric_limits<double>::infinity();
};

struct ChartSpacing {
  ChartPair nearest;            // the nearest pair; infinite distance if no pair is within `reach`
  std::vector<ChartPair> near;  // nearer than `wanted`, ascending by charts; at most kMaxNearPairs
  bool limited = false;         // the search ended early: there may be other and nearer pairs
};
inline constexpr std::size_t kMaxNearPairs = 1000;

// Finds distances up to `reach`, and all pairs of charts nearer than `wanted` (0: lists none), in the map's unit.
// Compares charts with the same `tile[chart]`; a chart with tile -1 is compared with all others. Intersecting segments
// have distance 0; for a chart inside another one, the distance between their outlines counts. O(n log n) for n
// segments that are not crowded within `reach`; the search ends after `max_tests` pairs of boxes.
ChartSpacing FindChartSpacing(const std::vector<OutlineSegment>& segments, const std::vector<std::int32_t>& tile,
                              double reach, double wanted, std::int64_t max_tests, const Execution& execution = {});

}  // namespace planish
