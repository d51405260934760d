#include <algorithm>
#include <array>
#include <bit>
#include <cmath>
#include <limits>
#include <map>
#include <memory>
#include <optional>
#include <utility>

#include "absl/strings/str_cat.h"
#include "core/base/error.h"
#include "core/base/radix_sort.h"
#include "core/base/status_macros.h"
#include "core/base/timer.h"
#include "core/charts/seam_cost.h"
#include "core/charts/steps.h"
#include "core/mesh/angles.h"
#include "core/mesh/diagnosis.h"
#include "core/mesh/import.h"
#include "core/mesh/tri_mesh.h"
#include "core/mesh/visibility.h"
#include "core/unwrap/holes.h"
#include "core/unwrap/long_needles.h"
#include "core/unwrap/steps.h"
#include "core/unwrap/widening.h"

namespace planish {
namespace {

// For SeamPolicy::kKeep: PIECE_NOT_A_DISC unless every piece is a disc, or a planar piece with holes.
absl::Status CheckPieces(const Mesh& mesh, const Charts& charts) {
  std::vector<std::int32_t> first_faces;
  for (const MappedChart& mapped : charts.charts) {
    const Chart& chart = mapped.chart;
    if (chart.slits.empty() || HoledPieceOf(mesh, chart)) continue;
    first_faces.push_back(*std::min_element(chart.faces.begin(), chart.faces.end()));
  }
  if (first_faces.empty()) return absl::OkStatus();
  const std::int64_t count = std::ssize(first_faces);
  return MakeError(absl::StatusCode::kInvalidArgument, "PIECE_NOT_A_DISC",
                   absl::StrCat(Counted(count, "piece", "pieces"),
                                " between the given seams cannot lie flat without another seam (closed, or with a "
                                "handle); give more seams, or allow them to be added (--seams=needed)"),
                   {{"count", absl::StrCat(count)}, {"faces", FirstFaces(first_faces)}});
}

// Per face: numbers that differ where charts must end because of atlases and weights. Empty: nowhere.
std::vector<std::int32_t> PartOfFaces(const UnwrapOptions& options) {
  const std::vector<float>& weights = options.face_weights;
  const bool by_weight = !weights.empty() && options.seams.policy != SeamPolicy::kKeep;
  if (!by_weight) return options.face_atlas;
  std::map<std::pair<std::int32_t, float>, std::int32_t> numbers;
  std::vector<std::int32_t> part(weights.size());
  for (std::int32_t f = 0; f < std::ssize(part); ++f) {
    const std::pair key(AtlasOf(options, f), weights[f]);
    part[f] = numbers.emplace(key, static_cast<std::int32_t>(numbers.size())).first->second;
  }
  return part;
}

// The area of the surface, each face scaled by its weight over the least weight.
double WeightedArea(const Surface& surface, const std::vector<float>& weights) {
  double area = 0;
  const double least = weights.empty() ? 1 : *std::min_element(weights.begin(), weights.end());
  for (std::int32_t f = 0; f < surface.num_faces(); ++f) {
    const double weight = weights.empty() ? 1 : weights[f] / least;
    area += surface.area[f] * weight * weight;
  }
  return area;
}

// The approximate rounding unit of UV in the allowed tiles, in units of the surface. Charts are assumed to fill a part
// of the tiles. The unit is largest at the far end of a row of tiles; `last_digit` is the unit of numbers from 1/2
// to 1.
double Resolution(const UnwrapOptions& options, double area, double last_digit) {
  constexpr double kFilled = 0.5;
  const int tiles = options.pack ? options.atlas.tiles : 1;
  int last = tiles;
  if (options.layout == AtlasLayout::kUdim) {
    for (const std::int32_t atlas : options.face_atlas) last = std::max(last, (atlas + 1) * tiles);
  }
  const auto columns = static_cast<unsigned>(std::min(last, 10));
  return last_digit * std::bit_ceil(columns) * std::sqrt(area / (kFilled * tiles));
}

// Whether some face is thinner in the map than half of the rounding unit, so that the type cannot hold it.
bool HasThinner(const Mesh& mesh, const Charts& charts, double resolution) {
  const Surface& surface = *charts.surface;
  for (std::int32_t f = 0; f < surface.num_faces(); ++f) {
    if (!surface.takes_part[f] || surface.is_flat[f]) continue;
    const double longest = LongestEdge(TriangleOf(mesh.positions, mesh.faces[f]));
    const double reduction = charts.reduction.empty() ? 1 : charts.reduction[f];
    if (2 * surface.area[f] * reduction < resolution / 2 * longest) return true;
  }
  return false;
}

// The fraction of the stage that is done after MakeSurface(), the segmentation, ImproveSeams() and RefineEstimated().
constexpr double kSurfaceShare = 0.15, kSegmentShare = 0.52, kImproveShare = 0.85, kRefineShare = 0.92;

// If less of the surface than kMostlyMirrored has a mirror image, or if the surface is small, charts are also made
// without symmetry. Both sides are cut alike if the cost (charts/seam_cost.h) is at most kMirrorWorth times the cost
// without symmetry. If the sides have different triangles (SegmentFolded()), it is at most kFoldedWorth times, and
// large surfaces are compared only if the cost is more than that many times the cost for the folded mesh.
constexpr double kMostlyMirrored = 0.99, kMirrorWorth = 1.5, kFoldedWorth = 1.3;
constexpr std::int32_t kSmall = 2'000;  // faces: the second search takes little time

// Where charts end at edges of more than two faces, joins other pairs of faces, and merges charts across them.
void RejoinCharts(const Job& job, Charts* charts) {
  if (job.execution.IsCancelled() || job.execution.IsStopRequested()) return;
  const Segmentation& before = *charts->segmentation;
  const std::vector<std::array<std::int32_t, 2>> pairs = PairsToRejoin(before.gluing(), before.chart());
  if (pairs.empty()) return;
  auto surface = std::make_unique<const Surface>(Rejoin(job.mesh, *charts->surface, pairs));
  const Execution silent = job.execution.Part(kSegmentShare, kSegmentShare);  // there is little to do
  Segmentation after(*surface, before, FirstStretch(job.options), silent);
  charts->segmentation.emplace(std::move(after));
  charts->surface = std::move(surface);
}

// The cost of a slit along the edge that this corner faces: its length, reduced where the surface bends, since that
// hides a seam. Infinite inside a polygon.
double SlitCost(const Surface& surface, std::int32_t corner) {
  constexpr double kSharpCost = 0.1;  // where it bends by a right angle or more
  const HalfedgeHandle h = HalfEdgeOf(*surface.mesh, corner);
  if (surface.is_uncut(h)) return std::numeric_limits<double>::infinity();
  return surface.length(h) * (1 - (1 - kSharpCost) * std::clamp(1 - surface.bend_cosine(h), 0.0, 1.0));
}

constexpr std::size_t kFewestToCut = 3;

// Whether there is an edge inside of the chart at which it may be cut.
bool CanBeParted(const Surface& surface, const Chart& chart) {
  for (std::int32_t c = 0; c < chart.topology->num_corners(); ++c) {
    if (chart.topology->opposite[c] < 0) continue;
    if (!surface.is_uncut(HalfEdgeOf(*surface.mesh, 3 * chart.faces[c / 3] + c % 3))) return true;
  }
  return false;
}

}  // namespace

void MeasureAtlases(const Job& job, Charts* charts) {
  const UnwrapOptions& options = job.options;
  const Surface& surface = *charts->surface;
  std::map<std::int32_t, Charts::AtlasSize>& sizes = charts->atlas_size;
  for (std::int32_t f = 0; f < surface.num_faces(); ++f) {
    const double reduction = charts->reduction.empty() ? 1 : charts->reduction[f];
    const double area = surface.area[f] * reduction * reduction;
    charts->drawn_area += area;
    sizes[AtlasOf(options, f)].area += area;
  }
  for (std::int32_t i = 0; i < job.polygons.count(); ++i) {
    std::int32_t first = -1;
    job.polygons.ForEachFace(i, [&](std::int32_t f) { first = first < 0 && surface.takes_part[f] ? f : first; });
    if (first < 0) continue;
    const double reduction = charts->reduction.empty() ? 1 : charts->reduction[first];
    Charts::AtlasSize& size = sizes[AtlasOf(options, first)];
    size.longest = std::max(size.longest, reduction * SizeOfPolygon(job.mesh, job.polygons, i).length);
  }
  if (options.layout == AtlasLayout::kStacked) return;
  Charts::AtlasSize most;
  for (const auto& [atlas, size] : sizes) {
    most = {std::max(most.area, size.area), std::max(most.longest, size.longest)};
  }
  for (auto& [atlas, size] : sizes) size = most;
}

AtlasTuning ChartTuning(const UnwrapOptions& options) {
  AtlasTuning tuning = options.tuning;
  if (options.seams.prefer == SeamPreference::kSeams) {
    tuning.widest = tuning.seams_widest;
    tuning.widest_tip = tuning.seams_widest_tip;
    tuning.map_tolerance = tuning.seams_map_tolerance;
  }
  return tuning;
}

double FirstStretch(const UnwrapOptions& options) {
  const double most = options.MaxStretch();
  return options.seams.prefer == SeamPreference::kSeams ? std::min(most, options.tuning.seams_first_stretch) : most;
}

absl::Status Job::Enter(UnwrapStage stage) {
  if (execution.IsCancelled()) return absl::CancelledError("cancelled");
  if (progress.stage != stage) progress.stage_fraction = 0;
  progress.stage = stage;
  if (control.on_progress) control.on_progress(progress);
  return absl::OkStatus();
}

void Job::Reach(double fraction) {
  constexpr double kWorthTelling = 0.005;
  if (progress.stage != UnwrapStage::kCharts || fraction < progress.stage_fraction + kWorthTelling) return;
  progress.stage_fraction = std::min(fraction, 1.0);
  if (control.on_progress) control.on_progress(progress);
}

const std::vector<float>& Job::Visibility() {
  if (visibility.empty()) visibility = FaceVisibility(mesh, execution);
  return visibility;
}

std::vector<std::int32_t> Charts::FaceChart(const Mesh& mesh) const {
  std::vector<std::int32_t> face_chart(mesh.faces.size(), -1);
  for (std::int32_t i = 0; i < count(); ++i) {
    for (const std::int32_t f : charts[i].chart.faces) face_chart[f] = i;
  }
  return face_chart;
}

Eigen::VectorXd Charts::AnglesOf(const Mesh& mesh, const Chart& chart, const Execution& execution) const {
  if (!surface) return MeasuredAngles(mesh, chart.faces, execution);
  Eigen::VectorXd angles(chart.topology->num_corners());
  execution.ForEach(chart.topology->num_faces(), [&](std::int64_t f) {
    const std::array<HalfedgeHandle, 3> half_edges = HalfEdgesOf(*surface->mesh, FaceHandle(chart.faces[f]));
    for (int k = 0; k < 3; ++k) angles[3 * f + k] = surface->angle[half_edges[k].idx()];
  });
  return angles;
}

double Charts::ReductionOf(const std::vector<std::int32_t>& faces) const {
  double least = 1;
  if (reduction.empty()) return least;
  for (const std::int32_t f : faces) least = std::min(least, reduction[f]);
  return least;
}

std::vector<std::int32_t> Charts::Opposite(const Mesh& mesh) const {
  std::vector<std::int32_t> opposite(3 * mesh.faces.size(), -1);
  for (const MappedChart& mapped : charts) {
    const Chart& chart = mapped.chart;
    const std::vector<std::int32_t> own = OppositeWithClosedSlits(chart, mapped.map.closed_slits);
    for (std::size_t c = 0; c < own.size(); ++c) {
      if (own[c] >= 0) opposite[3 * chart.faces[c / 3] + c % 3] = 3 * chart.faces[own[c] / 3] + own[c] % 3;
    }
  }
  return opposite;
}

absl::StatusOr<Charts> Segment(Job* job) {
  Timer timer;
  PLANISH_RETURN_IF_ERROR(job->Enter(UnwrapStage::kCharts));
  const SeamOptions& seams = job->options.seams;
  Charts charts;
  if (seams.policy == SeamPolicy::kNone) {
    PLANISH_ASSIGN_OR_RETURN(const FlatImport disc, ImportDisc(job->mesh, job->execution));
    charts.charts.resize(1);
    charts.charts[0].chart = MakeChart(disc.mesh, Indices(disc.mesh.faces.size()), {}, job->execution);
    job->seconds.charts = timer.Restart();
    return charts;
  }
  const bool by_stretch = seams.policy == SeamPolicy::kAuto;
  std::vector<char> needles;
  if (by_stretch && job->options.pack) needles = FindLongNeedles(job->mesh, job->polygons, job->options.tuning);
  const GivenSeams given = {seams.corners, seams.uncut_corners,       seams.hard_edge_degrees,
                            needles,       PartOfFaces(job->options), job->options.face_polygon};
  PLANISH_ASSIGN_OR_RETURN(Surface surface, MakeSurface(job->mesh, given, job->execution));
  job->execution.Report(kSurfaceShare);
  std::vector<char> without_area(surface.num_faces());
  for (std::int32_t f = 0; f < surface.num_faces(); ++f) {
    charts.total_area += surface.area[f];
    without_area[f] = !surface.takes_part[f] || surface.is_flat[f];
  }
  if (std::find(without_area.begin(), without_area.end(), 1) != without_area.end()) {
    charts.ignored = std::move(without_area);
  }
  const double drawn_area = WeightedArea(surface, job->options.face_weights);
  const double of_float = Resolution(job->options, drawn_area, 0x1p-24);
  const double of_solve = Resolution(job->options, drawn_area, std::ldexp(1.0, -kDigitsOfSolve));
  const double of_double = Resolution(job->options, drawn_area, 0x1p-53);
  charts.grain = job->options.precision == Precision::kFloat ? of_float : of_solve;
  WarnOfSurface(surface, job->polygons, charts.ignored, &job->warnings);
  charts.surface = std::make_unique<const Surface>(std::move(surface));
  const bool by_seams = by_stretch && seams.prefer == SeamPreference::kSeams;
  const auto segment = [&](const Execution& execution) {
    charts.segmentation.emplace(*charts.surface, by_stretch ? Segmentation::Kind::kStretch : Segmentation::Kind::kWhole,
                                FirstStretch(job->options), execution, ChartTuning(job->options));
    if (by_stretch) RejoinCharts(*job, &charts);
  };
  const Execution merging = job->execution.Part(kSurfaceShare, kSegmentShare);
  double mirrored = 0;  // share of the surface
  if (by_seams) {
    PLANISH_ASSIGN_OR_RETURN(mirrored, SegmentMirrored(job, given, merging, &charts));
  }
  const bool is_folded = charts.folded_cost.has_value();
  bool is_compared =
      !job->is_folded && ((mirrored < kMostlyMirrored && !is_folded) || charts.surface->num_faces() <= kSmall);
  if (is_compared && !charts.surface->crowded_edges.empty()) {  // RejoinCharts() changes the surface
    mirrored = 0;
    charts.image.clear();
    charts.mirror.reset();
  }
  charts.are_alike = mirrored > 0;
  if (mirrored == 0) segment(merging);
  if (job->execution.IsCancelled()) return absl::CancelledError("cancelled");
  if (!needles.empty()) {
    charts.reduction = ReduceLongNeedles(job->mesh, job->polygons, needles, charts.segmentation->charts(), job->options,
                                         &job->warnings);
  }
  MeasureAtlases(*job, &charts);
  if (by_stretch) {
    auto estimates = std::make_unique<ChartEstimates>(*charts.segmentation, ChartTuning(job->options), job->execution);
    if (by_seams) {
      const Execution silent = job->execution.Part(kSegmentShare, kSegmentShare);
      std::optional<SeamCost> seam_cost;
      const auto improve = [&](const Execution& execution, ChartEstimates* of) -> absl::StatusOr<double> {
        PLANISH_RETURN_IF_ERROR(RefineEstimated(*job, silent, of, &charts));
        if (!charts.image.empty()) charts.image.resize(charts.segmentation->charts().size(), -1);
        if (job->execution.IsStopRequested() || charts.segmentation->charts().empty()) return 0.0;
        if (!seam_cost) {
          seam_cost.emplace(*charts.surface, job->Visibility(), job->options.tuning, job->execution);
          if (job->execution.IsCancelled()) return absl::CancelledError("cancelled");
        }
        return ImproveSeams(job, *seam_cost, execution, of, &charts);
      };
      PLANISH_ASSIGN_OR_RETURN(const double cost,
                               improve(job->execution.Part(kSegmentShare, kImproveShare), estimates.get()));
      charts.cost = cost;
      is_compared = is_compared || (is_folded && cost > kFoldedWorth * *charts.folded_cost);
      if (mirrored > 0 && is_compared && !job->execution.IsStopRequested()) {
        Segmentation alike = *std::move(charts.segmentation);
        charts.search_work = 1;
        segment(silent);
        if (job->execution.IsCancelled()) return absl::CancelledError("cancelled");
        auto other_estimates =
            std::make_unique<ChartEstimates>(*charts.segmentation, ChartTuning(job->options), job->execution);
        PLANISH_ASSIGN_OR_RETURN(const double other_cost, improve(silent, other_estimates.get()));
        if (cost <= (is_folded ? kFoldedWorth : kMirrorWorth) * other_cost) {
          charts.segmentation.emplace(std::move(alike));
        } else {
          charts.are_alike = false;
          charts.cost = other_cost;
          estimates = std::move(other_estimates);
        }
      }
    }
    const Execution refining = job->execution.Part(by_seams ? kImproveShare : kSegmentShare, kRefineShare);
    const bool are_known = by_seams && !job->execution.IsStopRequested() && !charts.segmentation->charts().empty();
    PLANISH_RETURN_IF_ERROR(RefineEstimated(*job, refining, estimates.get(), &charts, are_known));
    refining.Report(1);
    if (!by_seams) PLANISH_RETURN_IF_ERROR(JoinEstimated(job, estimates.get(), &charts));
  }
  // Where faces are too thin for float and double may be delivered, no chart is cut beforehand because float would make
  // it overlap: the faces are widened until float holds them, or the UV are double.
  const bool is_double = job->options.precision == Precision::kDouble ||
                         (job->options.precision == Precision::kAuto && HasThinner(job->mesh, charts, of_float));
  charts.resolution = is_double ? of_double : of_float;
  charts.charts.resize(charts.segmentation->charts().size());
  charts.slits_are_moved = !by_stretch;
  for (std::int32_t i = 0; i < charts.count(); ++i) ExtractChart(i, job->execution, &charts);
  if (seams.policy == SeamPolicy::kKeep) PLANISH_RETURN_IF_ERROR(CheckPieces(job->mesh, charts));
  job->seconds.charts = timer.Restart();
  return charts;
}

void ExtractChart(std::int32_t i, const Execution& execution, Charts* charts) {
  const Gluing& gluing = charts->segmentation->gluing();
  const std::vector<std::int32_t>& faces = charts->segmentation->charts()[i];
  charts->charts[i] = {};
  Chart& chart = charts->charts[i].chart;
  std::vector<std::pair<std::int32_t, std::int32_t>> slits;
  FlatMesh disc = ChartMesh(gluing, faces, &charts->place, &slits);
  if (charts->slits_are_moved) {
    const auto cost = [&](std::int32_t c) { return SlitCost(*charts->surface, 3 * faces[c / 3] + c % 3); };
    SlitAlongShortPaths(cost, &disc, &slits);
  }
  chart = MakeChart(disc, faces, slits, execution.ForOneThread());
  charts->charts[i].is_worth_cutting = chart.faces.size() >= kFewestToCut && CanBeParted(*charts->surface, chart);
  chart.enlargement = charts->ReductionOf(chart.faces);
  if (charts->least_angle.empty()) return;
  for (const std::int32_t f : chart.faces) chart.least_angle.push_back(charts->least_angle[f]);
}

}  // namespace planish
