#include <optional>
#include <utility>
#include <vector>

#include "absl/status/status.h"
#include "core/base/status_macros.h"
#include "core/charts/seam_cost.h"
#include "core/mesh/near_symmetry.h"
#include "core/unwrap/steps.h"

namespace planish {
namespace {

// Shares of the usual work of ImproveSeams(): for the folded mesh, and for the charts that are made like its charts.
constexpr double kWorkOnFolded = 0.5, kWorkOnLike = 0.5;

// The share of the area in charts that are stretched beyond the limit.
double StretchedShare(const Job& job, const Charts& charts, const ChartEstimates& estimates) {
  double stretched = 0;
  for (std::int32_t i = 0; i < std::ssize(charts.segmentation->charts()); ++i) {
    if (!estimates.has(i) || !(estimates.of(i).stretch > job.options.MaxStretch())) continue;
    for (const std::int32_t f : charts.segmentation->charts()[i]) stretched += charts.surface->area[f];
  }
  return stretched / charts.total_area;
}

// Per face of a folded mesh: the mean visibility of the faces that are like it or like its mirror image. Without such
// faces, the mean of all.
std::vector<float> VisibilityOf(const FoldedMesh& folded, const std::vector<float>& visibility) {
  const auto half = static_cast<std::int32_t>(folded.mesh.num_faces() / 2);
  struct Sum {
    double sum = 0, count = 0;
    void Add(double value) {
      sum += value;
      ++count;
    }
  };
  std::vector<Sum> sums(half);
  Sum all;
  for (std::size_t f = 0; f < visibility.size(); ++f) {
    all.Add(visibility[f]);
    if (folded.like[f] >= 0) sums[folded.like[f] % half].Add(visibility[f]);
  }
  std::vector<float> mean;
  for (std::int32_t f = 0; f < 2 * half; ++f) {
    const Sum& of = sums[f % half].count > 0 ? sums[f % half] : all;
    mean.push_back(static_cast<float>(of.sum / of.count));
  }
  return mean;
}

}  // namespace

absl::StatusOr<double> SegmentFolded(Job* job, const GivenSeams& seams, const Execution& execution, Charts* charts) {
  constexpr std::int64_t kFewest = 500;  // faces: smaller meshes would take much longer
  if (job->is_folded || job->mesh.num_faces() < kFewest || !seams.part.empty() ||
      !charts->surface->crowded_edges.empty())
    return 0;
  std::optional<FoldedMesh> folded =
      FoldNearlySymmetric(job->mesh, seams.polygon, job->options.tuning.folded_faces, job->execution);
  if (job->execution.IsCancelled()) return absl::CancelledError("cancelled");
  if (!folded || job->execution.IsStopRequested()) return 0;
  UnwrapOptions options = job->options;
  options.face_polygon = std::move(folded->polygon);
  options.tuning.glue_estimates *= kWorkOnFolded;
  options.tuning.dart_estimates *= kWorkOnFolded;
  options.tuning.crumb_estimates *= kWorkOnFolded;
  options.tuning.move_estimates *= kWorkOnFolded;
  UnwrapControl control = job->control;
  control.on_progress = nullptr;
  std::optional<Segmentation> like;
  {
    Job half = {folded->mesh, options, control, execution, Polygons(folded->mesh.num_faces(), options.face_polygon)};
    half.is_folded = true;
    half.visibility = VisibilityOf(*folded, job->Visibility());
    const absl::StatusOr<Charts> made = Segment(&half);
    if (absl::IsCancelled(made.status())) return made.status();
    if (!made.ok() || !made->are_alike || job->execution.IsStopRequested()) return 0;
    charts->folded_cost = made->cost;
    like.emplace(Segmentation::Like(*charts->surface, *made->segmentation, std::move(folded->like), job->execution));
  }
  if (job->execution.IsCancelled()) return absl::CancelledError("cancelled");
  charts->segmentation.emplace(*std::move(like));
  charts->segmentation->DropEmpty();
  MeasureAtlases(*job, charts);
  const SeamCost cost(*charts->surface, job->Visibility(), job->options.tuning, job->execution);
  ChartEstimates estimates(*charts->segmentation, ChartTuning(job->options), job->execution);
  charts->search_work = kWorkOnLike;
  charts->are_mended = true;
  const absl::StatusOr<double> mended = ImproveSeams(job, cost, execution.Part(1, 1), &estimates, charts);
  charts->are_mended = false;
  charts->drawn_area = 0;
  charts->atlas_size.clear();
  PLANISH_RETURN_IF_ERROR(mended.status());
  constexpr double kMostStretched = 0.1;
  if (!job->execution.IsStopRequested() && StretchedShare(*job, *charts, estimates) <= kMostStretched) {
    return folded->share;
  }
  charts->segmentation.reset();
  charts->folded_cost.reset();
  charts->search_work = 1;
  return 0;
}

}  // namespace planish
