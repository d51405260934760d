#include "core/unwrap/seam_search.h"

#include <algorithm>
#include <utility>

#include "core/base/status_macros.h"
#include "core/mesh/symmetry.h"

namespace planish {
namespace {

constexpr double kGoesOn = 1e-3;  // in units of the cost: gain of a round that is worth another round

}  // namespace

SeamSearch::SeamSearch(Job* job, const SeamCost& cost, const Execution& execution, ChartEstimates* estimates,
                       Charts* charts)
    : job_(*job),
      tuning_(job->options.tuning),
      surface_(*charts->surface),
      cost_(cost),
      charts_(*charts),
      segmentation_(*charts->segmentation),
      estimates_(*estimates),
      router_(segmentation_, cost, tuning_),
      execution_(execution),
      area_(segmentation_.charts().size(), 0.0),
      version_(area_.size(), 0) {
  for (std::int32_t i = 0; i < count(); ++i) Measure(i);
}

absl::StatusOr<double> SeamSearch::Run() {
  std::vector<std::int32_t> unknown;
  for (std::int32_t i = 0; i < count() && GoesOn(); ++i) {
    if (!segmentation_.charts()[i].empty() && !estimates_.has(i)) unknown.push_back(i);
  }
  if (GoesOn()) estimates_.Update(unknown, job_.execution);
  const double faces = surface_.num_faces() + std::min<double>(surface_.num_faces(), tuning_.thorough_faces);
  const bool glues = !charts_.are_mended;
  glue_left_ = glues ? charts_.search_work * tuning_.glue_estimates * faces : 0;
  dart_left_ = glues ? charts_.search_work * tuning_.dart_estimates * faces : 0;
  crumb_left_ = glues ? charts_.search_work * tuning_.crumb_estimates * faces : 0;
  move_left_ = charts_.search_work * tuning_.move_estimates * faces;
  all_left_ = glue_left_ + dart_left_ + move_left_ + crumb_left_;
  for (round_ = 0; round_ < tuning_.seam_rounds && GoesOn(); ++round_) {
    double gain = 0;
    if (glues) {
      gain += Glue();
      const double of_darts = SewDarts();
      if (of_darts > 0) gain += of_darts + Glue();
    }
    gain += Move();
    if (!(gain > kGoesOn)) break;
  }
  if (glues) GlueCrumbs();
  if (job_.execution.IsCancelled()) return absl::CancelledError("cancelled");
  charts_.image.clear();
  charts_.mirror.reset();
  estimates_.DropEmpty();
  segmentation_.DropEmpty();
  for (std::int32_t i = 0; i < count(); ++i) Measure(i);
  double cost = 0;
  for (std::int32_t i = 0; i < count() && estimates_.has(i); ++i) cost += CostOf(i);
  for (const SeamPath& path : SeamPaths(segmentation_)) cost += cost_.OfPath(path.half_edges);
  return cost;
}

void SeamSearch::Measure(std::int32_t i) {
  area_[i] = 0;
  for (const std::int32_t f : segmentation_.charts()[i]) area_[i] += surface_.area[f];
}

bool SeamSearch::MayBeSound(std::int32_t i) const {
  const std::vector<std::int32_t>& faces = segmentation_.charts()[i];
  const bool is_stretched = faces.size() > 1 && estimates_.of(i).stretch > job_.options.MaxStretch();
  return !is_stretched && charts_.ReductionOf(faces) == 1;
}

HalfedgeHandle SeamSearch::ImageOf(HalfedgeHandle h) const {
  const TriMesh& mesh = *surface_.mesh;
  const HalfedgeHandle o = mesh.opposite_halfedge_handle(h);
  if (const std::int32_t c = charts_.mirror->corner[CornerOf(mesh, h)]; c >= 0) return HalfEdgeOf(mesh, c);
  const std::int32_t c = mesh.is_boundary(o) ? -1 : charts_.mirror->corner[CornerOf(mesh, o)];
  const HalfedgeHandle image = c < 0 ? HalfedgeHandle() : mesh.opposite_halfedge_handle(HalfEdgeOf(mesh, c));
  return image.is_valid() && mesh.is_boundary(image) ? HalfedgeHandle() : image;
}

std::vector<HalfedgeHandle> SeamSearch::ImageOf(std::span<const HalfedgeHandle> path) const {
  std::vector<HalfedgeHandle> image;
  for (std::size_t i = path.size(); i-- > 0;) {
    image.push_back(charts_.mirror ? ImageOf(path[i]) : HalfedgeHandle());
    if (!image.back().is_valid()) return {};
  }
  return image;
}

bool SeamSearch::Meet(std::span<const HalfedgeHandle> path, std::span<const HalfedgeHandle> other) {
  std::vector<int> edges;
  for (const HalfedgeHandle h : path) edges.push_back(h.idx() / 2);
  std::sort(edges.begin(), edges.end());
  return std::any_of(other.begin(), other.end(),
                     [&](HalfedgeHandle h) { return std::binary_search(edges.begin(), edges.end(), h.idx() / 2); });
}

std::int32_t SeamSearch::ChartOf(HalfedgeHandle h) const {
  return segmentation_.chart()[segmentation_.gluing().mesh().face_handle(h).idx()];
}

std::int64_t SeamSearch::Versions(std::int32_t i, std::int32_t j) const {
  std::int64_t versions = 0;
  for (const std::int32_t k : {i, j, ImageOf(i), ImageOf(j)}) versions += k < 0 ? 0 : version_[k];
  return versions;
}

bool SeamSearch::HasFailed(BorderKey key, std::int32_t i, std::int32_t j) const {
  const auto found = failed_.find(key);
  if (found == failed_.end()) return false;
  const Tried& tried = found->second;
  const bool is_large = surface_.num_faces() > tuning_.thorough_faces;
  return (is_large && tried.round == round_) ||
         (tried.chart == i && tried.other == j && tried.versions == Versions(i, j));
}

absl::StatusOr<double> ImproveSeams(Job* job, const SeamCost& cost, const Execution& execution,
                                    ChartEstimates* estimates, Charts* charts) {
  return SeamSearch(job, cost, execution, estimates, charts).Run();
}

}  // namespace planish
