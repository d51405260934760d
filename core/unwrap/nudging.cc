// Rounding collapses a face that is a few units of the last place thick, and lets an outline cross itself that touches
// itself, in some places and not in others. A chart with such a fault where the packer has put it is moved by a hair.
// One for which that does not help is cut and packed again; drafts find such charts beforehand, since they try several
// turns.
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

constexpr int kNudges = 16;            // places that are tried for a chart
constexpr int kShakes = 8;             // turns that a draft tries
constexpr std::int64_t kFewFaces = 4;  // of a chart with more faces that collapse, some would wherever it lies

// Otherwise charts have places of their own, which they keep.
bool ArePacked(const Job& job) {
  return job.options.pack && job.options.seams.policy != SeamPolicy::kNone;
}

// The UV of the chart's corners as they are delivered.
void WriteUv(const MappedChart& mapped, Precision precision, CornerUv* uv) {
  const Chart& chart = mapped.chart;
  for (std::int32_t f = 0; f < chart.topology->num_faces(); ++f) {
    for (int k = 0; k < 3; ++k) {
      Vec2 p = (*mapped.map.placement)(mapped.map.positions[chart.topology->faces[f][k]]);
      if (precision == Precision::kFloat) p = p.cast<float>().cast<double>();
      SetUv(3 * chart.faces[f] + k, p, uv);
    }
  }
}

std::int64_t CountTurned(const Charts& charts, const Chart& chart, const CornerUv& uv) {
  return std::count_if(chart.faces.begin(), chart.faces.end(),
                       [&](std::int32_t f) { return !charts.is_ignored(f) && Orientation(TriangleOf(uv, f)) <= 0; });
}

// On a spiral, from 0 on.
Vec2 Nudge(int i) {
  const double angle = i * std::numbers::pi * (3 - std::sqrt(5.0)), length = kFreeMove * (i + 1) / kNudges;
  return length * Vec2(portable::Cos(angle), portable::Sin(angle));
}

}  // namespace

void ShakeCharts(const Job& job, Charts* charts, Delivery* delivery) {
  if (!ArePacked(job)) return;
  bool any = false;
  for (MappedChart& mapped : charts->charts) {
    if (job.execution.IsCancelled()) return;
    if (CountTurned(*charts, mapped.chart, delivery->uv) > 0) continue;
    ChartPlacement& place = *mapped.map.placement;
    const ChartPlacement before = place;
    const Vec2 pivot = mapped.map.positions.front();
    bool is_turned = false;
    for (int i = 1; i <= kShakes && !is_turned; ++i) {
      place.angle = before.angle + i;
      place.offset += before(pivot) - place(pivot);
      WriteUv(mapped, delivery->precision, &delivery->uv);
      is_turned = CountTurned(*charts, mapped.chart, delivery->uv) > 0;
    }
    any |= is_turned;
    if (is_turned) continue;
    place = before;
    WriteUv(mapped, delivery->precision, &delivery->uv);
  }
  if (any) delivery->orientation = CheckOrientations(delivery->uv, job.execution, charts->ignored);
}

bool NudgeCharts(const Job& job, Charts* charts, Delivery* delivery) {
  if (!ArePacked(job)) return false;
  const bool any_turned = delivery->orientation.flipped + delivery->orientation.degenerate > 0;
  if (!any_turned && delivery->overlaps.pairs == 0) return false;
  bool any = false;
  for (MappedChart& mapped : charts->charts) {
    if (job.execution.IsCancelled()) return false;
    CornerUv& uv = delivery->uv;
    const auto overlaps = [&] { return OverlapsWithin({&mapped}, uv, charts->ignored, job.execution).pairs > 0; };
    const std::int64_t turned = any_turned ? CountTurned(*charts, mapped.chart, uv) : 0;
    if (turned > kFewFaces || (turned == 0 && (delivery->overlaps.pairs == 0 || !overlaps()))) continue;
    ChartPlacement& place = *mapped.map.placement;
    const Vec2 before = place.offset;
    bool is_sound = false;
    for (int i = 0; i < kNudges && !is_sound; ++i) {
      place.offset = before + Nudge(i);
      WriteUv(mapped, delivery->precision, &uv);
      is_sound = CountTurned(*charts, mapped.chart, uv) == 0 && !overlaps();
    }
    any |= is_sound;
    if (is_sound) continue;
    place.offset = before;
    WriteUv(mapped, delivery->precision, &uv);
  }
  if (any) delivery->orientation = CheckOrientations(delivery->uv, job.execution, charts->ignored);
  return any;
}

}  // namespace planish
