#include <memory>
#include <optional>
#include <utility>

#include "core/base/status_macros.h"
#include "core/mesh/symmetry.h"
#include "core/unwrap/steps.h"

namespace planish {

absl::StatusOr<double> SegmentMirrored(Job* job, GivenSeams seams, const Execution& execution, Charts* charts) {
  if (!seams.corners.empty() || !seams.uncut_corners.empty() || seams.hard_edge_degrees > 0 || !seams.kind.empty()) {
    return 0;
  }
  std::optional<Mirror> mirror = FindMirror(job->mesh, seams.polygon, job->execution);
  if (job->execution.IsStopRequested()) return 0;
  if (!mirror) return SegmentFolded(job, seams, execution, charts);
  seams.polygon = mirror->polygon;
  seams.part.resize(job->mesh.faces.size(), 0);
  for (std::int32_t f = 0; f < std::ssize(seams.part); ++f) {
    constexpr std::int32_t kSides = 3;
    seams.part[f] = kSides * seams.part[f] + static_cast<std::int32_t>(mirror->side[f]);
  }
  PLANISH_ASSIGN_OR_RETURN(Surface surface, MakeSurface(job->mesh, seams, job->execution));
  for (std::int32_t f = 0; f < surface.num_faces(); ++f) {
    if (mirror->side[f] == Mirror::Side::kSecond) surface.takes_part[f] = 0;
  }
  constexpr double kMerging = 0.9;  // of the time
  Charts half;
  half.surface = std::make_unique<const Surface>(std::move(surface));
  MeasureAtlases(*job, &half);
  half.segmentation.emplace(*half.surface, Segmentation::Kind::kStretch, FirstStretch(job->options),
                            execution.Part(0, kMerging), ChartTuning(job->options));
  if (job->execution.IsCancelled()) return absl::CancelledError("cancelled");
  ChartEstimates estimates(*half.segmentation, ChartTuning(job->options), job->execution);
  PLANISH_RETURN_IF_ERROR(RefineEstimated(*job, execution.Part(kMerging, 1), &estimates, &half));
  const auto count = static_cast<std::int32_t>(half.segmentation->charts().size());
  charts->segmentation.emplace(Segmentation::Mirrored(*charts->surface, *half.segmentation, *mirror));
  const std::vector<std::vector<std::int32_t>>& all = charts->segmentation->charts();
  std::vector<std::int32_t> number(all.size(), -1);  // once empty charts have been dropped
  std::int32_t next = 0;
  for (std::size_t i = 0; i < all.size(); ++i) number[i] = all[i].empty() ? -1 : next++;
  charts->image.assign(next, -1);
  for (std::int32_t i = 0; i < count; ++i) {
    if (all[i].empty()) continue;
    if (mirror->side[all[i].front()] == Mirror::Side::kAcross) charts->image[number[i]] = number[i];
    if (all[count + i].empty()) continue;
    charts->image[number[i]] = number[count + i];
    charts->image[number[count + i]] = number[i];
  }
  charts->segmentation->DropEmpty();
  const double share = mirror->share;
  charts->mirror = std::move(mirror);
  return share;
}

}  // namespace planish
