#include <array>
#include <utility>

#include "core/unwrap/barycentric.h"
#include "core/unwrap/hole_filling.h"
#include "core/unwrap/steps.h"
#include "core/unwrap/widening.h"

namespace planish {
namespace {

constexpr double kMostStretchOfAbf = 3;       // with a barrier; others are looked for beyond, that are so much better
constexpr double kMostStretchForHoles = 1.1;  // times that of the slit map: a tube had better be slit than be a ring
// Beyond, a convex outline takes many seconds (an active set of thousands), and so does a barycentric map.
constexpr std::int32_t kMostFacesForConvex = 10'000, kMostFacesForBarycentres = 200'000;

// A chart that may get another map.
struct Candidate {
  Job* job;
  MappedChart* mapped;
  const Execution& execution;
  Eigen::VectorXd measured;
  FlattenSummary summary;             // of the first solve
  std::optional<FilledChart> filled;  // if it is a piece of a plane with holes, which are slit open

  std::int32_t num_faces() const { return mapped->chart.topology.num_faces(); }
  bool is_slit() const { return mapped->map.closed_slits.size() < mapped->chart.slits.size(); }
  // The present map overlaps itself, or a barrier keeps it open and stretches it.
  bool is_no_use() const {
    return mapped->faults.does_overlap ||
           (mapped->map.flatten->barrier > 0 && mapped->faults.stretch > kMostStretchOfAbf);
  }
};

struct Fallback {
  bool (*applies)(const Candidate& candidate);
  absl::StatusOr<ChartMap> (*map)(const Candidate& candidate);
  double better;  // how many times less stretched than the present map, if that is sound
};

absl::StatusOr<ChartMap> MapByAbf(const Candidate& c) {
  return MapFilled(c.job->mesh, c.mapped->chart, *c.filled, c.measured, c.job->options.flatten, c.execution);
}

absl::StatusOr<ChartMap> MapByMeans(const Candidate& c) {
  return MapByBarycentres(c.job->mesh, c.mapped->chart, c.filled ? &*c.filled : nullptr, c.measured, c.summary,
                          c.execution);
}

// A convex outline cannot run over itself.
absl::StatusOr<ChartMap> MapConvex(const Candidate& c) {
  auto convex = FlattenWith(c.job, *c.mapped, 0, BoundaryType::kConvex, c.execution, false);
  if (!convex.ok()) return convex.status();
  return LayOutChart(c.job->mesh, c.mapped->chart, *std::move(convex), c.execution);
}

// In the order in which they are tried. A chart whose holes have been filled needs no slit; once it has such a map, the
// search ends.
const std::array<Fallback, 4> kFallbacks = {{
    // ABF of the chart with its holes filled, if they can be.
    {[](const Candidate& c) { return c.filled.has_value(); }, MapByAbf, 1 / kMostStretchForHoles},
    // A barycentric map of that.
    {[](const Candidate& c) { return c.filled.has_value() && c.num_faces() <= kMostFacesForBarycentres; }, MapByMeans,
     1 / kMostStretchForHoles},
    // ABF with a convex outline, where the caller has not asked for that anyway.
    {[](const Candidate& c) {
       return c.is_no_use() && c.job->options.flatten.boundary == BoundaryType::kFree &&
              c.num_faces() <= kMostFacesForConvex;
     },
     MapConvex, 1},
    // A barycentric map within the slit outline.
    {[](const Candidate& c) { return c.is_no_use() && !c.filled && c.num_faces() <= kMostFacesForBarycentres; },
     MapByMeans, kMostStretchOfAbf},
}};

}  // namespace

void MapWithFixedBorders(Job* job, const Charts& charts, MappedChart* mapped, const Execution& execution) {
  Candidate candidate = {job, mapped, execution, {}, *mapped->map.flatten, std::nullopt};
  if (!candidate.is_slit() && !candidate.is_no_use()) return;
  candidate.measured = AnglesToKeep(job->mesh, mapped->chart, execution);
  if (candidate.is_slit()) candidate.filled = FillHoles(job->mesh, mapped->chart, execution);
  for (const Fallback& fallback : kFallbacks) {
    if (!fallback.applies(candidate)) continue;
    const bool is_sound = !mapped->faults.does_overlap && mapped->faults.stretch <= kMostStretchForBorders;
    const double most = is_sound ? mapped->faults.stretch / fallback.better : kMostStretchForBorders;
    absl::StatusOr<ChartMap> map = fallback.map(candidate);
    if (!map.ok() || !map->flatten->converged) continue;
    const ChartFaults faults = FindFaults(job->mesh, mapped->chart, *map, charts.ignored, charts.resolution, execution);
    if (faults.does_overlap || faults.stretch > most) continue;
    mapped->map = *std::move(map);
    mapped->faults = faults;
    if (candidate.filled && fallback.map != MapConvex) return;
  }
}

}  // namespace planish
