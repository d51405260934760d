#include <algorithm>
#include <memory>
#include <thread>
#include <utility>

#include "core/base/status_macros.h"
#include "core/base/timer.h"
#include "core/unwrap/steps.h"
#include "core/unwrap/widening.h"

namespace planish {
namespace {

constexpr std::int32_t kLargeChart = 30'000;  // faces; smaller ones are one thread's work

// body(chart, execution, whether it runs on the calling thread) for each, in this order, largest first: those that are
// worth it with the whole team.
template <typename Body>
void ForEachChart(const Execution& execution, const Charts& charts, const std::vector<std::int32_t>& todo,
                  const Body& body) {
  const int threads = execution.team == nullptr ? 1 : execution.team->size();
  const auto small = std::find_if(todo.begin(), todo.end(), [&](std::int32_t i) {
    return threads > 1 && static_cast<std::int32_t>(charts.charts[i].chart.faces.size()) < kLargeChart;
  });
  for (auto it = todo.begin(); it != small; ++it) body(*it, execution, true);
  if (small == todo.end()) return;
  const std::thread::id self = std::this_thread::get_id();
  execution.team->For(todo.end() - small, 1, [&](std::int64_t begin, std::int64_t end) {
    for (std::int64_t j = begin; j < end; ++j) {
      body(small[j], execution.ForOneThread(), std::this_thread::get_id() == self);
    }
  });
}

// Whether the chart will be cut because of its solve, whatever the map looks like (Refine()).
bool IsCutAnyway(const Job& job, const MappedChart& mapped) {
  return job.options.seams.policy == SeamPolicy::kAuto && mapped.chart.faces.size() > 1 &&
         (!mapped.map.flatten->converged || mapped.map.flatten->barrier > 0);
}

// Layout and faults. Where faces are too thin, the chart is solved again with these widened. `of_triangle`: the solve
// of a chart that has none of its own.
absl::Status Finish(Job* job, const Charts& charts, std::int32_t number,
                    const std::shared_ptr<const FlattenSummary>& of_triangle, MappedChart* mapped,
                    const Execution& execution) {
  if (mapped->flattening == nullptr) {
    PLANISH_ASSIGN_OR_RETURN(mapped->map, LayOutTriangle(job->mesh, mapped->chart, of_triangle, execution));
  } else {
    PLANISH_ASSIGN_OR_RETURN(mapped->map,
                             LayOutChart(job->mesh, mapped->chart, std::move(*mapped->flattening), execution));
    mapped->flattening.reset();
  }
  if (charts.grain > 0 && !IsCutAnyway(*job, *mapped)) {
    for (int i = 0; i < kMostWidenings; ++i) {
      if (!WidenInMap(job->mesh, mapped->map, charts.grain, charts.ignored, &mapped->chart)) break;
      PLANISH_ASSIGN_OR_RETURN(
          Flattening flattening,
          FlattenWith(job, charts, *mapped, number, job->options.flatten.boundary, execution, /*reports=*/false));
      PLANISH_ASSIGN_OR_RETURN(mapped->map, LayOutChart(job->mesh, mapped->chart, std::move(flattening), execution));
    }
  }
  if (!job->may_split() && !mapped->map.flatten->stopped) return absl::OkStatus();
  if (IsCutAnyway(*job, *mapped) && mapped->is_worth_cutting && !execution.IsStopRequested()) {
    mapped->faults.is_injective = false;  // for all that is known
    return absl::OkStatus();
  }
  mapped->faults = FindFaults(job->mesh, mapped->chart, mapped->map, charts.ignored, charts.resolution, execution);
  // Where more seams are welcome they are better: of 200 maps that ran over themselves, all were stretched too far by a
  // convex outline, at ten times the cost of a split.
  if (job->options.seams.policy == SeamPolicy::kNeeded && !execution.IsStopRequested()) {
    MapWithFixedBorders(job, charts, mapped, execution);
  }
  return absl::OkStatus();
}

// What the solve of each of these charts that is_triangle_as_measured() says; null if there are none.
absl::StatusOr<std::shared_ptr<const FlattenSummary>> SolveTriangles(Job* job, const std::vector<std::int32_t>& todo,
                                                                     const Charts& charts) {
  const auto first = std::find_if(todo.begin(), todo.end(),
                                  [&](std::int32_t i) { return charts.charts[i].chart.is_triangle_as_measured(); });
  if (first == todo.end()) return nullptr;
  PLANISH_ASSIGN_OR_RETURN(Flattening flattening,
                           FlattenWith(job, charts, charts.charts[*first], *first, job->options.flatten.boundary,
                                       job->execution.ForOneThread(), /*reports=*/true));
  return std::make_shared<const FlattenSummary>(std::move(flattening.summary));
}

// Parts of the chart widen the same faces, should it be cut.
void NoteWidened(const Chart& chart, std::int64_t num_faces, Charts* charts) {
  if (chart.least_angle.empty()) return;
  if (charts->least_angle.empty()) charts->least_angle.assign(num_faces, 0.0);
  for (std::size_t f = 0; f < chart.faces.size(); ++f) charts->least_angle[chart.faces[f]] = chart.least_angle[f];
}

}  // namespace

bool WidenCharts(Job* job, const Atlas& atlas, const Delivery& delivery, std::vector<std::int32_t>* todo,
                 Charts* charts) {
  const OrientationFaults& faults = delivery.orientation;
  if (faults.flipped + faults.degenerate == 0 || job->execution.IsStopRequested()) return false;
  if (charts->widenings == kMostWidenings) return false;
  todo->clear();
  for (std::int32_t i = 0; i < charts->count(); ++i) {
    Chart& chart = charts->charts[i].chart;
    if (WidenDelivered(job->mesh, delivery.uv, atlas.scale, delivery.precision, charts->ignored, &chart)) {
      todo->push_back(i);
    }
  }
  if (todo->empty()) return false;
  ++charts->widenings;
  return true;
}

absl::StatusOr<Flattening> FlattenWith(Job* job, const Charts& charts, const MappedChart& mapped, std::int32_t number,
                                       BoundaryType boundary, const Execution& execution, bool reports) {
  FlattenControl control = {execution};
  // The sides of a slit must come to lie on each other, or overlap.
  if (!mapped.chart.slits.empty()) control.flat_enough = job->options.flatten.tolerance;
  if (reports && job->control.on_progress) {
    control.on_progress = [job, number](const FlattenProgress& progress) {
      job->progress.chart = number;
      job->progress.flatten = progress;
      job->control.on_progress(job->progress);
    };
  }
  FlattenOptions options = job->options.flatten;
  options.boundary = boundary;
  // A chart that takes long is better cut, and solved in parts.
  if (job->options.seams.policy == SeamPolicy::kAuto && mapped.is_worth_cutting) {
    options.max_newton_iterations = std::min(options.max_newton_iterations, job->options.tuning.newton_steps);
    control.gives_up = !execution.IsStopRequested();
  }
  const Topology& topology = *mapped.chart.topology;
  const Eigen::VectorXd angles = AnglesToKeep(mapped.chart, charts.AnglesOf(job->mesh, mapped.chart, execution));
  const TargetAngles target = MakeTargetAngles(topology, angles, execution);
  if (execution.IsCancelled()) return absl::CancelledError("cancelled");
  return FlattenAngles(topology, target, options, control);
}

absl::Status SolveCharts(Job* job, std::vector<std::int32_t> todo, Charts* charts) {
  Timer timer;
  const auto size = [&](std::int32_t i) { return charts->charts[i].chart.faces.size(); };
  std::stable_sort(todo.begin(), todo.end(), [&](std::int32_t i, std::int32_t j) { return size(i) > size(j); });
  // The solve announces itself, with its first residual.
  job->progress.stage = UnwrapStage::kSolve;
  job->progress.stage_fraction = 0;
  job->progress.chart_count = charts->count();
  PLANISH_ASSIGN_OR_RETURN(const std::shared_ptr<const FlattenSummary> of_triangle, SolveTriangles(job, todo, *charts));
  ForEachChart(job->execution, *charts, todo, [&](std::int32_t i, const Execution& execution, bool reports) {
    MappedChart& mapped = charts->charts[i];
    mapped.status = absl::OkStatus();
    if (mapped.chart.is_triangle_as_measured()) return;
    auto flattening = FlattenWith(job, *charts, mapped, i, job->options.flatten.boundary, execution, reports);
    mapped.status = flattening.status();
    if (flattening.ok()) mapped.flattening = std::make_unique<Flattening>(*std::move(flattening));
  });
  job->seconds.solve += timer.Restart();
  PLANISH_RETURN_IF_ERROR(job->Enter(UnwrapStage::kLayout));
  ForEachChart(job->execution, *charts, todo, [&](std::int32_t i, const Execution& execution, bool) {
    MappedChart& mapped = charts->charts[i];
    if (mapped.status.ok()) mapped.status = Finish(job, *charts, i, of_triangle, &mapped, execution);
  });
  job->seconds.layout += timer.Restart();
  if (job->execution.IsCancelled()) return absl::CancelledError("cancelled");
  for (const std::int32_t i : todo) NoteWidened(charts->charts[i].chart, job->mesh.num_faces(), charts);
  for (const std::int32_t i : todo) {
    const bool split_helps = job->may_split() && size(i) > 1;
    const absl::Status& status = charts->charts[i].status;
    if (!status.ok() && !(split_helps && absl::IsInternal(status))) return status;
  }
  return absl::OkStatus();
}

}  // namespace planish
