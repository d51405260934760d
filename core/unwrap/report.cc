#include <algorithm>
#include <cmath>
#include <map>
#include <utility>

#include "absl/strings/str_cat.h"
#include "absl/strings/str_format.h"
#include "core/base/status_macros.h"
#include "core/base/timer.h"
#include "core/mesh/angles.h"
#include "core/mesh/diagnosis.h"
#include "core/unwrap/distortion.h"
#include "core/unwrap/seam_figures.h"
#include "core/unwrap/steps.h"
#include "core/unwrap/widening.h"

namespace planish {
namespace {

void WarnOfPadding(const Job& job, const Charts& charts, const Atlas& atlas, std::vector<UnwrapWarning>* warnings) {
  const int wanted = job.options.atlas.padding;
  if (charts.count() < 2 || !job.options.pack || atlas.padding >= wanted) return;
  warnings->push_back(
      {"PADDING_NOT_KEPT",
       absl::StrFormat("there is room for %.3g texels between charts, not for the %d asked for; give more texels or "
                       "tiles",
                       atlas.padding, wanted),
       {{"padding", absl::StrFormat("%g", atlas.padding)}}});
}

void WarnOfPrecision(const Delivery& delivery, std::vector<UnwrapWarning>* warnings) {
  if (delivery.lost <= 0) return;
  const bool is_double = delivery.precision == Precision::kDouble;
  warnings->push_back(
      {"UV_PRECISION",
       absl::StrCat("rounding to float flips or collapses ", Counted(delivery.lost, "triangle", "triangles"),
                    ", the scale varies too much; ",
                    is_double ? "the UV are delivered as double" : "float was asked for, double would keep them"),
       {{"count", absl::StrCat(delivery.lost)}},
       delivery.lost_faces});
}

// Warns if rounding to float, which keeps every triangle, still raises the energy noticeably.
void WarnOfCoarseFloat(UnwrapResult* result) {
  constexpr double kNegligible = 1e-4;   // energy per angle: a hundredth of the angle
  constexpr double kWorthSaying = 1e-3;  // of the energy before rounding
  double energy = 0, angles = 0;
  for (const ChartReport& chart : result->charts) {
    energy += chart.flatten->energy;
    angles += 3.0 * static_cast<double>(chart.triangles);
  }
  const double solved = energy / angles, lost = result->quality.abf_energy - solved;
  if (result->precision != Precision::kFloat || lost <= kNegligible || lost <= kWorthSaying * solved) return;
  result->warnings.push_back(
      {"UV_PRECISION",
       absl::StrFormat(
           "rounding to float raises the ABF energy of an angle from %.3g to %.3g, as the scale varies much; "
           "--precision=double keeps it",
           solved, result->quality.abf_energy),
       {{"abf_energy_lost", absl::StrFormat("%g", lost)}}});
}

// Finds overlaps within each group that is laid out separately: charts that were not packed or are a draft lie on top
// of each other, and so do stacked atlases.
Overlaps OverlapsInAtlases(const Job& job, const Charts& charts, bool is_draft, const CornerUv& uv,
                           const OrientationFaults& orientation) {
  const UnwrapOptions& options = job.options;
  const bool are_packed = options.pack && !is_draft;
  const bool stacked = !options.face_atlas.empty() && options.layout == AtlasLayout::kStacked;
  if (are_packed && !stacked) {
    return CheckOverlaps(charts.Opposite(job.mesh), uv, orientation, job.execution, charts.ignored);
  }
  std::map<std::int32_t, std::vector<const MappedChart*>> layers;
  for (const MappedChart& mapped : charts.charts) {
    layers[are_packed ? AtlasOf(options, mapped.chart.faces.front()) : std::ssize(layers)].push_back(&mapped);
  }
  Overlaps all;
  for (const auto& [number, layer] : layers) {
    if (job.execution.IsCancelled()) break;
    const Overlaps found = OverlapsWithin(layer, uv, charts.ignored, job.execution);
    all.pairs += found.pairs;
    all.limited |= found.limited;
    for (const std::int32_t f : found.faces) {
      if (all.faces.size() < kMaxNamed) all.faces.push_back(f);
    }
  }
  return all;
}

// `face_chart`: see UnwrapResult::face_chart.
double RelativeSeamLength(const Mesh& mesh, const Charts& charts, const std::vector<std::int32_t>& face_chart) {
  if (!(charts.total_area > 0)) return 0;  // SeamPolicy::kNone
  const std::vector<std::int32_t> opposite = charts.Opposite(mesh);
  std::vector<std::int32_t> ends;
  for (std::int32_t c = 0; c < std::ssize(opposite); ++c) {
    if (opposite[c] < 0 && face_chart[c / 3] >= 0) ends.push_back(c);
  }
  return SeamLength(mesh, ends, [](std::int32_t) { return false; }) / std::sqrt(charts.total_area);
}

// Adds the number of faces and the efficiency of each atlas.
std::vector<AtlasReport> AtlasReports(const Job& job, const Charts& charts, const Atlas& atlas, const CornerUv& uv) {
  std::map<std::int32_t, AtlasReport> by_number = atlas.atlases;
  const std::vector<std::int32_t>& face_atlas = job.options.face_atlas;
  for (std::size_t f = 0; f < face_atlas.size(); ++f) {
    AtlasReport& report = by_number.at(face_atlas[f]);
    ++report.faces;
    if (charts.is_ignored(f)) continue;
    report.packing_efficiency += std::abs(DoubleArea(TriangleOf(uv, static_cast<std::int64_t>(f)))) / 2;
  }
  std::vector<AtlasReport> reports;
  for (auto& [number, report] : by_number) {
    report.packing_efficiency /= report.tiles;
    reports.push_back(report);
  }
  return reports;
}

// The face of a chart with the most stretch.
std::int32_t MostStretched(const Job& job, const Charts& charts, const Chart& chart, const CornerUv& uv) {
  std::int32_t worst = chart.faces.front();
  double most = -1;
  for (const std::int32_t f : chart.faces) {
    if (charts.is_ignored(f)) continue;
    MapSums own;
    own.Add(TriangleOf(uv, f).data(), TriangleOf(job.mesh.positions, job.mesh.faces[f]).data());
    const double stretch = own.surface_area > 0 ? own.stretch / own.surface_area : 0;
    if (stretch > most) worst = f, most = stretch;
  }
  return worst;
}

// Warns of the stretch of single charts and, if densities differ, of the whole map.
void WarnOfStretch(const Job& job, const Charts& charts, const std::vector<MapSums>& own, const MapSums& all,
                   const CornerUv& uv, std::vector<UnwrapWarning>* warnings) {
  const bool is_much = all.StretchL2() > kMuchStretch && job.options.face_weights.empty();
  std::vector<double> stretch;
  std::vector<std::int32_t> worst;
  for (std::int32_t i = 0; i < charts.count(); ++i) {
    MapSums in_all = own[i];
    if (all.surface_area > 0) in_all.uv_area = own[i].surface_area * all.uv_area / all.surface_area;
    stretch.push_back(is_much ? std::max(own[i].StretchL2(), in_all.StretchL2()) : own[i].StretchL2());
    const Chart& chart = charts.charts[i].chart;
    worst.push_back(stretch.back() > kMuchStretch ? MostStretched(job, charts, chart, uv) : -1);
  }
  WarnOfMuchStretch(stretch, worst, job.options.seams.policy, warnings);
}

}  // namespace

Overlaps OverlapsWithin(const std::vector<const MappedChart*>& charts, const CornerUv& uv,
                        const std::vector<char>& ignored, const Execution& execution) {
  std::vector<std::int32_t> faces, opposite;
  CornerUv own;
  std::vector<char> own_ignored;
  for (const MappedChart* const mapped : charts) {
    const auto first = static_cast<std::int32_t>(opposite.size());
    for (const std::int32_t c : OppositeWithClosedSlits(mapped->chart, mapped->map.closed_slits)) {
      opposite.push_back(c < 0 ? -1 : first + c);
    }
    for (const std::int32_t f : mapped->chart.faces) {
      faces.push_back(f);
      own.insert(own.end(), uv.begin() + 6 * std::ptrdiff_t{f}, uv.begin() + 6 * std::ptrdiff_t{f} + 6);
      if (!ignored.empty()) own_ignored.push_back(ignored[f]);
    }
  }
  const OrientationFaults orientation = CheckOrientations(own, execution, own_ignored);
  Overlaps overlaps = CheckOverlaps(opposite, own, orientation, execution, own_ignored);
  for (std::int32_t& f : overlaps.faces) f = faces[f];
  return overlaps;
}

absl::StatusOr<Delivery> Deliver(Job* job, const Charts& charts, CornerUv uv) {
  Timer timer;
  Delivery delivery;
  delivery.stopped = job->execution.IsStopRequested();
  PLANISH_RETURN_IF_ERROR(job->Enter(UnwrapStage::kVerify));
  delivery.orientation = CheckOrientations(uv, job->execution, charts.ignored);
  delivery.precision = Precision::kDouble;
  if (job->options.precision != Precision::kDouble) {
    const OrientationFaults& exact = delivery.orientation;
    CornerUv rounded = RoundToFloat(uv, job->options.pack, job->execution);
    OrientationFaults after = CheckOrientations(rounded, job->execution, charts.ignored);
    const auto lost = [&exact](const OrientationFaults& faults) {
      return std::max<std::int64_t>(faults.flipped + faults.degenerate - exact.flipped - exact.degenerate, 0);
    };
    if (job->options.pack && lost(after) > 0) {
      // Near v = 0 floats are finer if 1 - v need not be a float, too.
      CornerUv finer = RoundToFloat(uv, false, job->execution);
      OrientationFaults of_finer = CheckOrientations(finer, job->execution, charts.ignored);
      if (lost(of_finer) < lost(after)) {
        rounded = std::move(finer);
        after = std::move(of_finer);
      }
    }
    delivery.lost = lost(after);
    if (delivery.lost > 0) delivery.lost_faces = after.faces;
    if (delivery.lost == 0 || job->options.precision == Precision::kFloat) {
      delivery.precision = Precision::kFloat;
      delivery.orientation = std::move(after);
      uv = std::move(rounded);
    }
  }
  delivery.uv = std::move(uv);
  if (job->execution.IsCancelled()) return absl::CancelledError("cancelled");
  job->seconds.verify += timer.Restart();
  return delivery;
}

absl::Status FindOverlaps(Job* job, const Charts& charts, bool is_draft, Delivery* delivery) {
  Timer timer;
  delivery->overlaps = OverlapsInAtlases(*job, charts, is_draft, delivery->uv, delivery->orientation);
  if (job->execution.IsCancelled()) return absl::CancelledError("cancelled");
  job->seconds.verify += timer.Restart();
  return absl::OkStatus();
}

namespace {

// The first face of each polygon with different UV on the two sides of a diagonal, in the order of polygons.
std::vector<std::int32_t> TornPolygons(const Charts& charts, const std::vector<std::int32_t>& polygon,
                                       const CornerUv& uv) {
  std::vector<std::int32_t> first_faces;
  if (polygon.empty() || !charts.surface) return first_faces;
  const TriMesh& mesh = *charts.surface->mesh;
  std::vector<char> is_torn(polygon.size(), 0);
  for (std::int32_t c = 0; c < std::ssize(polygon) * 3; ++c) {
    if (is_torn[polygon[c / 3]]) continue;
    const std::int32_t d = CornerAcross(mesh, c);
    if (d < c || polygon[d / 3] != polygon[c / 3]) continue;
    const bool is_whole = UvOf(uv, FlatLinks::Next(c)) == UvOf(uv, FlatLinks::Prev(d)) &&
                          UvOf(uv, FlatLinks::Prev(c)) == UvOf(uv, FlatLinks::Next(d));
    if (is_whole) continue;
    is_torn[polygon[c / 3]] = 1;
    first_faces.push_back(c / 3);
  }
  return first_faces;
}

}  // namespace

absl::StatusOr<UnwrapResult> Report(Job* job, const Charts& charts, const Atlas& atlas, Delivery delivery) {
  Timer timer;
  UnwrapResult result;
  result.warnings = std::move(job->warnings);
  if (const std::int64_t isolated = CountIsolatedVertices(job->mesh); isolated > 0) {
    result.warnings.push_back({"ISOLATED_VERTICES",
                               absl::StrCat(Counted(isolated, "vertex has", "vertices have"), " no face and no UV"),
                               {{"count", absl::StrCat(isolated)}}});
  }
  WarnOfPadding(*job, charts, atlas, &result.warnings);
  WarnOfPrecision(delivery, &result.warnings);
  for (const MappedChart& mapped : charts.charts) {
    for (const std::int32_t f : mapped.chart.faces) {
      const bool is_widened = !charts.least_angle.empty() && charts.least_angle[f] > 0;
      // With other policies the scale may vary so much that faces of any shape become small: IsThin() says
      // nothing then.
      const bool may_be_thin = job->options.seams.policy == SeamPolicy::kAuto && !charts.is_ignored(f);
      if (is_widened ||
          (may_be_thin && IsThin(job->mesh, delivery.uv, atlas.scale, delivery.precision, mapped.chart, f))) {
        result.widened.push_back(f);
      }
    }
  }
  std::sort(result.widened.begin(), result.widened.end());
  WarnOfWidened(result.widened, job->polygons, delivery.precision, &result.warnings);
  result.tiles = atlas.tiles;
  result.texture_size = atlas.texture_size;
  result.padding = atlas.padding;
  if (job->options.pack) result.texels_per_unit = atlas.scale * atlas.texture_size;
  // Atlas::scale does not include the enlargement of a single chart.
  if (!job->packs()) result.texels_per_unit *= charts.charts.front().chart.enlargement;
  result.uv = std::move(delivery.uv);
  result.precision = delivery.precision;
  result.face_chart = charts.FaceChart(job->mesh);
  DistortionSums all;
  std::vector<MapSums> own_maps;
  result.charts.reserve(charts.charts.size());
  for (const MappedChart& mapped : charts.charts) {
    const Chart& chart = mapped.chart;
    const Eigen::VectorXd measured = charts.AnglesOf(job->mesh, chart, job->execution);
    const DistortionSums own =
        MeasureDistortion(job->mesh, chart.faces, measured, MakeTargetAngles(*chart.topology, measured, job->execution),
                          result.uv, charts.ignored, job->execution);
    all.Add(own);
    own_maps.push_back(own.map);
    result.charts.push_back(
        {chart.topology->num_faces(), mapped.map.flatten, mapped.map.is_barycentric, own.map.StretchL2()});
  }
  WarnOfDensity(*job, charts, atlas, result.uv, &result.warnings);
  all.Fill(&result.quality);
  if (job->execution.IsCancelled()) return absl::CancelledError("cancelled");
  result.atlases = AtlasReports(*job, charts, atlas, result.uv);
  int tiles = result.atlases.empty() ? result.tiles : 0;
  for (const AtlasReport& each : result.atlases) tiles += each.charts > 0 ? each.tiles : 0;
  result.quality.packing_efficiency /= std::max(tiles, 1);
  result.quality.seam_length = RelativeSeamLength(job->mesh, charts, result.face_chart);
  const SeamFigures figures = MeasureSeams(job->mesh, result.uv, job->execution);
  result.quality.visible_seam_length = figures.visible_length;
  result.quality.seam_turn_deg = figures.turn_deg;
  result.quality.seam_symmetry = figures.symmetry;
  result.quality.flipped = delivery.orientation.flipped;
  result.quality.degenerate = delivery.orientation.degenerate;
  result.quality.overlapping = delivery.overlaps.pairs;
  // Energies before and after rounding are comparable only without such faces: those without area count in only one of
  // the energies, and widened ones keep other angles.
  if (charts.ignored.empty() && charts.least_angle.empty()) WarnOfCoarseFloat(&result);
  if (delivery.stopped) WarnOfStop(result.charts, &result.warnings);
  const SeamOptions& seams = job->options.seams;
  WarnOfCharts(result.charts, seams.policy == SeamPolicy::kAuto ? job->options.MaxStretch() : 0, delivery.stopped,
               &result.warnings);
  if (seams.policy != SeamPolicy::kAuto) WarnOfStretch(*job, charts, own_maps, all.map, result.uv, &result.warnings);
  WarnOfFaults(delivery.orientation, delivery.overlaps, &result.warnings);
  WarnOfTornPolygons(TornPolygons(charts, job->options.face_polygon, result.uv), &result.warnings);
  result.seconds = job->seconds;
  result.seconds.verify += timer.Restart();
  return result;
}

}  // namespace planish
