#include "core/unwrap/unwrap.h"

#include <numeric>
#include <utility>

#include "absl/strings/str_cat.h"
#include "core/base/error.h"
#include "core/base/status_macros.h"
#include "core/mesh/diagnosis.h"
#include "core/unwrap/steps.h"
#include "core/unwrap/warnings.h"

namespace planish {
namespace {

// Maps the charts in `todo`, and those that they are cut into until each map is sound. That ends: a cut makes more
// charts, and a chart of one triangle, or polygon, is not cut.
absl::Status SolveAndRefine(Job* job, std::vector<std::int32_t> todo, Charts* charts) {
  bool goes_on = true;
  while (goes_on) {
    PLANISH_RETURN_IF_ERROR(SolveCharts(job, todo, charts));
    PLANISH_ASSIGN_OR_RETURN(goes_on, Refine(job, &todo, charts));
  }
  if (!std::exchange(charts->are_joined, true)) PLANISH_RETURN_IF_ERROR(JoinCharts(job, charts));
  for (const MappedChart& mapped : charts->charts) PLANISH_RETURN_IF_ERROR(mapped.status);
  return absl::OkStatus();
}

// Charts that are no discs and are mapped with a slit.
std::int64_t CountSlit(const Charts& charts) {
  std::int64_t slit = 0;
  for (const MappedChart& mapped : charts.charts) slit += mapped.map.closed_slits.size() < mapped.chart.slits.size();
  return slit;
}

// What becomes of the charts after a stop: STOPPED_EARLY if there is no valid map.
absl::Status CheckStopped(const Job& job, const absl::Status& made, const Charts& charts) {
  if (!job.execution.IsStopRequested()) return made;
  const auto error = [](const std::string& detail, const std::map<std::string, std::string>& metadata) {
    return MakeError(absl::StatusCode::kAborted, "STOPPED_EARLY",
                     absl::StrCat("stopped before there was a valid map to keep: ", detail), metadata);
  };
  if (ErrorInfoOf(made).reason == "SOLVER_FAILED") return error(std::string(made.message()), {});
  PLANISH_RETURN_IF_ERROR(made);
  std::int64_t turned = 0;
  for (const MappedChart& mapped : charts.charts) {
    if (mapped.map.flatten->stopped) turned += mapped.faults.turned;
  }
  if (turned == 0) return absl::OkStatus();
  return error(absl::StrCat(Counted(turned, "triangle is", "triangles are"), " still flipped or without area"),
               {{"count", absl::StrCat(turned)}});
}

}  // namespace

absl::StatusOr<UnwrapResult> Unwrap(const Mesh& mesh, const UnwrapOptions& options, const UnwrapControl& control) {
  PLANISH_RETURN_IF_ERROR(options.Validate());
  PLANISH_RETURN_IF_ERROR(options.ValidateSeams(mesh.num_faces()));
  PLANISH_RETURN_IF_ERROR(options.ValidateFaces(mesh.num_faces()));
  ThreadTeam team(options.threads);
  Job job = {mesh, options, control, {&team, control.cancel, control.stop}};
  PLANISH_ASSIGN_OR_RETURN(Charts charts, Segment(&job));
  const int first_count = charts.count();
  std::vector<std::int32_t> todo(first_count);
  std::iota(todo.begin(), todo.end(), 0);
  while (true) {
    PLANISH_RETURN_IF_ERROR(CheckStopped(job, SolveAndRefine(&job, std::move(todo), &charts), charts));
    PLANISH_ASSIGN_OR_RETURN(Atlas atlas, PackCharts(&job, &charts));
    PLANISH_ASSIGN_OR_RETURN(Delivery delivery, Deliver(&job, charts, std::move(atlas.uv)));
    if (WidenCharts(&job, atlas, delivery, &todo, &charts)) continue;
    PLANISH_ASSIGN_OR_RETURN(const bool goes_on, RefineDelivered(&job, delivery, &todo, &charts));
    if (goes_on) continue;
    if (options.seams.policy == SeamPolicy::kNeeded) {
      WarnOfAddedSeams(CountSlit(charts), charts.count() - first_count, &job.warnings);
    }
    return Report(&job, charts, atlas, std::move(delivery));
  }
}

}  // namespace planish
