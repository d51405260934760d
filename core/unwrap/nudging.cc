// Rounding collapses a face that is only a few units in the last place thick, and makes an outline that touches itself
// overlap, but only at some positions. A chart with such a fault at its packed position is moved slightly. If moving
// does not remove the fault, the chart is cut and the atlas is packed again. Drafts rotate each chart several times,
// and so find such charts earlier.
#include <algorithm>
#include <cmath>
#include <numbers>
#include <utility>
#include <vector>

#include "core/base/portable_math.h"
#include "core/mesh/predicates.h"
#include "core/unwrap/steps.h"

namespace planish {
namespace {

constexpr int kNudges = 16;            // places tried for a chart
constexpr int kShakes = 8;             // rotations tried by a draft
constexpr std::int64_t kFewFaces = 4;  // of a chart with more collapsed faces, some would collapse at any place

std::int64_t CountTurned(const Charts& charts, const Chart& chart, const CornerUv& uv) {
  return std::count_if(chart.faces.begin(), chart.faces.end(),
                       [&](std::int32_t f) { return !charts.is_ignored(f) && Orientation(TriangleOf(uv, f)) <= 0; });
}

// Points on a spiral, from 0 on.
Vec2 Nudge(int i) {
  const double angle = i * std::numbers::pi * (3 - std::sqrt(5.0)), length = kFreeMove * (i + 1) / kNudges;
  return length * Vec2(portable::Cos(angle), portable::Sin(angle));
}

// Moves a chart to the first place(i), i in [0, count), at which the delivered UV are as wanted. Otherwise returns
// false and leaves the chart in place.
template <typename Place, typename IsWanted>
bool MoveTo(int count, const Place& place, const IsWanted& is_wanted, const Job& job, MappedChart* mapped,
            Delivery* delivery) {
  const ChartPlacement before = *mapped->map.placement;
  const auto put = [&](const ChartPlacement& there) {
    mapped->map.placement = there;
    WriteUv(*mapped, delivery->precision, job.execution, &delivery->uv);
  };
  for (int i = 0; i < count; ++i) {
    put(place(i));
    if (is_wanted()) return true;
  }
  put(before);
  return false;
}

}  // namespace

void ShakeCharts(const Job& job, Charts* charts, Delivery* delivery) {
  if (!job.packs()) return;
  bool any = false;
  for (MappedChart& mapped : charts->charts) {
    if (job.execution.IsCancelled()) return;
    const auto is_turned = [&] { return CountTurned(*charts, mapped.chart, delivery->uv) > 0; };
    if (is_turned()) continue;
    const ChartPlacement before = *mapped.map.placement;
    const auto turned_about_a_corner = [&](int i) {
      const Vec2& pivot = mapped.map.positions.front();
      ChartPlacement place = before;
      place.angle += i + 1;
      place.offset += before(pivot) - place(pivot);
      return place;
    };
    any |= MoveTo(kShakes, turned_about_a_corner, is_turned, job, &mapped, delivery);
  }
  if (any) delivery->orientation = CheckOrientations(delivery->uv, job.execution, charts->ignored);
}

bool NudgeCharts(const Job& job, Charts* charts, Delivery* delivery) {
  if (!job.packs()) return false;
  const bool any_turned = delivery->orientation.flipped + delivery->orientation.degenerate > 0;
  const bool any_overlap = delivery->overlaps.pairs > 0;
  if (!any_turned && !any_overlap) return false;
  bool any = false;
  for (MappedChart& mapped : charts->charts) {
    if (job.execution.IsCancelled()) return false;
    const auto count_turned = [&] { return CountTurned(*charts, mapped.chart, delivery->uv); };
    const auto overlaps = [&] {
      return OverlapsWithin({&mapped}, delivery->uv, charts->ignored, job.execution).pairs > 0;
    };
    const std::int64_t turned = any_turned ? count_turned() : 0;
    if (turned > kFewFaces || (turned == 0 && !(any_overlap && overlaps()))) continue;
    const ChartPlacement before = *mapped.map.placement;
    const auto nudged = [&](int i) {
      ChartPlacement place = before;
      place.offset += Nudge(i);
      return place;
    };
    const auto is_sound = [&] { return count_turned() == 0 && !overlaps(); };
    any |= MoveTo(kNudges, nudged, is_sound, job, &mapped, delivery);
  }
  if (any) delivery->orientation = CheckOrientations(delivery->uv, job.execution, charts->ignored);
  return any;
}

}  // namespace planish
