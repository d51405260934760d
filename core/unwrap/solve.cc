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

constexpr std::int32_t kLargeChart = 30'000;  // faces; smaller charts are solved on one thread

// Calls body(chart, execution, whether on the calling thread) for each chart, in this order, largest first; large
// charts use the whole team.
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

// Whether the chart will be cut because of its solve, even if its map is sound (Refine()).
bool IsCutAnyway(const Job& job, const MappedChart& mapped) {
  return job.options.seams.policy == SeamPolicy::kAuto && mapped.chart.faces.size() > 1 &&
         (!mapped.map.flatten->converged || mapped.map.flatten->barrier > 0);
}

// Computes layout and faults. If faces are too thin, solves the chart again with these widened. `of_triangle`: the
// shared solve, for a chart that was not solved by itself.
absl::Status Finish(const ChartSolve& solve, const std::shared_ptr<const FlattenSummary>& of_triangle,
                    MappedChart* mapped) {
  const auto& [job, charts, number, limits, execution, reports] = solve;
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
      PLANISH_ASSIGN_OR_RETURN(Flattening flattening,
                               FlattenWith(solve, job->options.flatten.boundary, limits.solve, mapped));
      PLANISH_ASSIGN_OR_RETURN(mapped->map, LayOutChart(job->mesh, mapped->chart, std::move(flattening), execution));
    }
  }
  if (job->options.seams.policy == SeamPolicy::kNone && !mapped->map.flatten->stopped) return absl::OkStatus();
  if (IsCutAnyway(*job, *mapped) && mapped->is_worth_cutting && !execution.IsStopRequested()) {
    mapped->faults.is_injective = false;  // unknown, so assumed faulty
    return absl::OkStatus();
  }
  mapped->faults = FindFaults(job->mesh, mapped->chart, mapped->map, charts.ignored, charts.resolution, execution);
  // If more seams are allowed, they are better: for 200 maps that overlapped themselves, maps with a convex outline
  // were all stretched too far, and cost ten times as much as a cut.
  if (limits.other_map > 0 && !execution.IsStopRequested()) MapWithFixedBorders(solve, mapped);
  return absl::OkStatus();
}

// The shared summary of all charts that are is_triangle_as_measured(); null without such charts.
absl::StatusOr<std::shared_ptr<const FlattenSummary>> SolveTriangles(Job* job, const std::vector<std::int32_t>& todo,
                                                                     Charts* charts) {
  const auto first = std::find_if(todo.begin(), todo.end(),
                                  [&](std::int32_t i) { return charts->charts[i].chart.is_triangle_as_measured(); });
  if (first == todo.end()) return nullptr;
  const Execution execution = job->execution.ForOneThread();
  const ChartSolve solve = {job, *charts, *first, {}, execution, /*reports=*/true};
  PLANISH_ASSIGN_OR_RETURN(Flattening flattening,
                           FlattenWith(solve, job->options.flatten.boundary, 0, &charts->charts[*first]));
  return std::make_shared<const FlattenSummary>(std::move(flattening.summary));
}

// Records widened faces, so that parts of the chart widen them too if it is cut.
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

WorkLimits WorkLimitsFor(const Job& job, const Charts& charts, const std::vector<std::int32_t>& todo) {
  const AtlasTuning& tuning = job.options.tuning;
  switch (job.options.seams.policy) {
    case SeamPolicy::kNone:
      return {.solve = tuning.most_work};
    case SeamPolicy::kKeep:
      return {.solve = tuning.most_work, .other_map = tuning.other_map_work};
    case SeamPolicy::kAuto:
      return {.solve = tuning.most_work, .gives_up = true};
    case SeamPolicy::kNeeded:
      break;
  }
  double faces = 0;
  for (const std::int32_t i : todo) faces += static_cast<double>(charts.charts[i].chart.faces.size());
  const double left = tuning.all_needed_work * static_cast<double>(job.mesh.num_faces()) - charts.work;
  // Work for at least one solve and one other map.
  if (left < static_cast<double>(tuning.needed_work + tuning.other_map_work) * faces) {
    return {.solve = tuning.needed_work, .gives_up = true};
  }
  return {.solve = tuning.needed_work, .other_map = tuning.other_map_work};
}

FlattenControl ControlOf(const ChartSolve& solve) {
  FlattenControl control = {solve.execution};
  if (solve.reports && solve.job->control.on_progress) {
    control.on_progress = [job = solve.job, number = solve.number](const FlattenProgress& progress) {
      job->progress.chart = number;
      job->progress.flatten = progress;
      job->control.on_progress(job->progress);
    };
  }
  return control;
}

absl::StatusOr<Flattening> FlattenWith(const ChartSolve& solve, BoundaryType boundary, std::int64_t most_work,
                                       MappedChart* mapped) {
  const auto& [job, charts, number, limits, execution, reports] = solve;
  FlattenControl control = ControlOf(solve);
  // The sides of a slit must coincide, or they would overlap.
  if (!mapped->chart.slits.empty()) control.flat_enough = job->options.flatten.tolerance;
  FlattenOptions options = job->options.flatten;
  options.boundary = boundary;
  control.most_work = mapped->is_worth_cutting ? most_work : job->options.tuning.most_work;
  // A chart that takes long is better cut and solved in parts.
  if (limits.gives_up && mapped->is_worth_cutting) {
    options.max_newton_iterations = std::min(options.max_newton_iterations, job->options.tuning.newton_steps);
    control.gives_up = !execution.IsStopRequested();
  }
  const Topology& topology = *mapped->chart.topology;
  const Eigen::VectorXd angles = AnglesToKeep(mapped->chart, charts.AnglesOf(job->mesh, mapped->chart, execution));
  const TargetAngles target = MakeTargetAngles(topology, angles, execution);
  if (execution.IsCancelled()) return absl::CancelledError("cancelled");
  absl::StatusOr<Flattening> flattening = FlattenAngles(topology, target, options, control);
  if (flattening.ok()) mapped->work += static_cast<double>(flattening->summary.work);
  return flattening;
}

absl::Status SolveCharts(Job* job, std::vector<std::int32_t> todo, Charts* charts) {
  Timer timer;
  const auto size = [&](std::int32_t i) { return charts->charts[i].chart.faces.size(); };
  std::stable_sort(todo.begin(), todo.end(), [&](std::int32_t i, std::int32_t j) { return size(i) > size(j); });
  const WorkLimits limits = WorkLimitsFor(*job, *charts, todo);
  // The solve itself reports the new stage, with its first residual.
  job->progress.stage = UnwrapStage::kSolve;
  job->progress.stage_fraction = 0;
  job->progress.chart_count = charts->count();
  PLANISH_ASSIGN_OR_RETURN(const std::shared_ptr<const FlattenSummary> of_triangle, SolveTriangles(job, todo, charts));
  ForEachChart(job->execution, *charts, todo, [&](std::int32_t i, const Execution& execution, bool reports) {
    MappedChart& mapped = charts->charts[i];
    mapped.status = absl::OkStatus();
    mapped.work = 0;
    if (mapped.chart.is_triangle_as_measured()) return;
    const ChartSolve solve = {job, *charts, i, limits, execution, reports};
    auto flattening = FlattenWith(solve, job->options.flatten.boundary, limits.solve, &mapped);
    mapped.status = flattening.status();
    if (flattening.ok()) mapped.flattening = std::make_unique<Flattening>(*std::move(flattening));
  });
  job->seconds.solve += timer.Restart();
  PLANISH_RETURN_IF_ERROR(job->Enter(UnwrapStage::kLayout));
  ForEachChart(job->execution, *charts, todo, [&](std::int32_t i, const Execution& execution, bool reports) {
    MappedChart& mapped = charts->charts[i];
    if (mapped.status.ok()) {
      mapped.status = Finish({job, *charts, i, limits, execution, reports}, of_triangle, &mapped);
    }
  });
  for (const std::int32_t i : todo) charts->work += charts->charts[i].work * static_cast<double>(size(i));
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
