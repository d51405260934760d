#include <algorithm>
#include <cmath>
#include <functional>
#include <limits>
#include <numeric>
#include <span>
#include <utility>

#include "core/base/radix_sort.h"
#include "core/base/status_macros.h"
#include "core/base/timer.h"
#include "core/mesh/angles.h"
#include "core/mesh/box_tree.h"
#include "core/mesh/half_edges.h"
#include "core/mesh/predicates.h"
#include "core/pack/necks.h"
#include "core/unwrap/distortion.h"
#include "core/unwrap/steps.h"
#include "core/unwrap/widening.h"

namespace planish {
namespace {

// WidenCharts() calls that are left, at least, after charts were cut because some faces collapsed even when widened.
constexpr int kWideningsOfParts = 4;

// Per face of a chart with these faces of the surface: the number of its group. The faces of a group must stay
// together.
std::vector<std::int32_t> UncutGroups(const Surface& surface, const std::vector<std::int32_t>& opposite,
                                      const std::vector<std::int32_t>& faces, std::int32_t* count) {
  return ConnectedPieces(static_cast<std::int32_t>(faces.size()), count, [&](std::int32_t f, int k) {
    const std::int32_t o = opposite[3 * f + k];
    return o >= 0 && surface.is_uncut(HalfEdgeOf(*surface.mesh, 3 * faces[f] + k)) ? o / 3 : -1;
  });
}

// Reorders `part`, which has a value per face of `chart`, to the order of the faces in the segmentation.
std::vector<std::int32_t> InOrderOf(const Segmentation& segmentation, std::int32_t number, const Chart& chart,
                                    const std::vector<std::int32_t>& part) {
  const std::vector<std::int32_t>& faces = segmentation.charts()[number];
  std::vector<std::int32_t> ordered(part.size());
  for (std::size_t f = 0; f < part.size(); ++f) {
    ordered[std::lower_bound(faces.begin(), faces.end(), chart.faces[f]) - faces.begin()] = part[f];
  }
  return ordered;
}

// Per face of a disc: the mean of the centres of all faces in its group (UncutGroups()).
std::vector<Vec2> Middles(const FlatMesh& disc, const std::vector<std::int32_t>& group, std::int32_t groups,
                          const std::vector<Vec2>& positions) {
  std::vector<Vec2> sum(groups, Vec2::Zero());
  std::vector<double> members(groups, 0);
  for (std::size_t f = 0; f < disc.faces.size(); ++f) {
    const auto [a, b, c] = TriangleOf(positions, disc.faces[f]);
    sum[group[f]] += (a + b + c) / 3;
    ++members[group[f]];
  }
  std::vector<Vec2> middle;
  for (const std::int32_t g : group) middle.push_back(sum[g] / members[g]);
  return middle;
}

// Cuts a disc along chords: per face, the number of its piece. Neighbours are in one piece if the segment between their
// middles crosses no chord. Pieces are numbered by their lowest faces.
std::vector<std::int32_t> Pieces(const FlatMesh& disc, const std::vector<Vec2>& middle,
                                 const std::vector<std::pair<Vec2, Vec2>>& chords, std::int32_t* count) {
  const auto corners = static_cast<std::int32_t>(disc.opposite.size());
  std::vector<char> crossed(corners, 0);
  for (const auto& [a, b] : chords) {
    const Box box = Box::Around(a, b);
    for (std::int32_t c = 0; c < corners; ++c) {
      const std::int32_t o = disc.opposite[c];
      if (o < c) continue;
      const Vec2 &p = middle[c / 3], &q = middle[o / 3];
      if (p != q && Box::Around(p, q).Meets(box) && SegmentsMeet(a, b, p, q)) crossed[c] = crossed[o] = 1;
    }
  }
  return ConnectedPieces(corners / 3, count, [&](std::int32_t f, int k) {
    const std::int32_t c = 3 * f + k;
    return disc.opposite[c] < 0 || crossed[c] ? -1 : disc.opposite[c] / 3;
  });
}

// Merges all but the `most` largest pieces into the neighbour with the longest common border, the smallest piece first.
void MergeCrumbs(const FlatMesh& disc, const std::vector<Vec2>& positions, std::size_t most, std::int32_t count,
                 std::vector<std::int32_t>* piece) {
  std::vector<double> area(count, 0);
  for (std::size_t f = 0; f < disc.faces.size(); ++f) {
    area[(*piece)[f]] += std::abs(DoubleArea(TriangleOf(positions, disc.faces[f])));
  }
  const std::vector<std::int32_t> order =
      SortedIndices(count, [&](std::int32_t a, std::int32_t b) { return area[a] < area[b]; });
  for (std::size_t i = 0; i + most < order.size(); ++i) {
    std::vector<double> border(count, 0);
    for (std::int32_t c = 0; c < std::ssize(disc.opposite); ++c) {
      const std::int32_t o = disc.opposite[c];
      if ((*piece)[c / 3] != order[i] || o < 0 || (*piece)[o / 3] == order[i]) continue;
      // Adds a tiny length, so that a neighbour counts even if all common edges have length 0 in the map.
      const Vec2 edge = positions[Target(disc.faces, c)] - positions[Origin(disc.faces, c)];
      border[(*piece)[o / 3]] += edge.norm() + std::numeric_limits<double>::min();
    }
    const auto to = static_cast<std::int32_t>(std::max_element(border.begin(), border.end()) - border.begin());
    std::replace(piece->begin(), piece->end(), order[i], to);
  }
}

// Per face of a disc: its part, from 0 on; empty if the disc is to stay whole. Cuts run along these chords of its map,
// from face to face, and never between faces that must be glued; parts are connected.
std::vector<std::int32_t> PartAlong(const std::vector<std::pair<Vec2, Vec2>>& chords, const FlatMesh& disc,
                                    const std::vector<Vec2>& middle, const std::vector<Vec2>& positions) {
  std::int32_t count = 0;
  std::vector<std::int32_t> piece = Pieces(disc, middle, chords, &count);
  MergeCrumbs(disc, positions, chords.size() + 1, count, &piece);
  if (NumberByFirst(count, &piece) < 2) return {};
  return piece;
}

// Per face, in the order of the segmentation: its part. Each face that is flipped or collapsed as delivered becomes a
// part together with its group, and so does each connected piece of the other faces. Empty if that makes only one part.
std::vector<std::int32_t> PartTurned(const Charts& charts, std::int32_t number, const CornerUv& uv) {
  const Chart& chart = charts.charts[number].chart;
  const Topology& topology = *chart.topology;
  std::int32_t groups = 0, parts = 0;
  const std::vector<std::int32_t> group = UncutGroups(*charts.surface, topology.opposite, chart.faces, &groups);
  std::vector<char> is_alone(groups, 0);
  for (std::int32_t f = 0; f < topology.num_faces(); ++f) {
    if (!charts.is_ignored(chart.faces[f]) && Orientation(TriangleOf(uv, chart.faces[f])) <= 0) is_alone[group[f]] = 1;
  }
  const std::vector<std::int32_t> part = ConnectedPieces(topology.num_faces(), &parts, [&](std::int32_t f, int k) {
    const std::int32_t o = topology.opposite[3 * f + k];
    if (o < 0 || group[o / 3] == group[f]) return o < 0 ? -1 : o / 3;
    return is_alone[group[f]] || is_alone[group[o / 3]] ? -1 : o / 3;
  });
  if (parts < 2 || std::find(is_alone.begin(), is_alone.end(), 1) == is_alone.end()) return {};
  return InOrderOf(*charts.segmentation, number, chart, part);
}

// The charts that pack better in parts, by their estimates. If that makes too many charts, the charts with the largest
// gain. Cuts run across arms and necks of the map (core/pack/necks.h).
std::vector<Segmentation::Cut> ChartsToPart(const Job& job, const NeckOptions& options, const ChartEstimates& estimates,
                                            Charts* charts) {
  const Segmentation& segmentation = *charts->segmentation;
  const auto count = static_cast<std::int32_t>(segmentation.charts().size());
  std::vector<std::vector<Neck>> necks(count);
  std::vector<double> gains;
  for (std::int32_t i = 0; i < count && !job.execution.IsCancelledAt(i); ++i) {
    necks[i] = FindNecks(estimates.of(i).points, options);
    for (const Neck& neck : necks[i]) gains.push_back(neck.gain);
  }
  const AtlasTuning& tuning = job.options.tuning;
  const auto most = static_cast<std::size_t>(std::max(
      static_cast<double>(charts->surface->num_faces()) / tuning.cut_faces - count, tuning.cut_growth * count));
  double least_gain = options.least_gain;
  if (gains.size() > most) {
    std::sort(gains.begin(), gains.end(), std::greater<>());
    least_gain = std::nextafter(gains[most], std::numeric_limits<double>::infinity());
  }
  std::vector<Segmentation::Cut> cuts;
  for (std::int32_t i = 0; i < count && !job.execution.IsCancelledAt(i); ++i) {
    const std::vector<Vec2>& points = estimates.of(i).points;
    std::vector<std::pair<Vec2, Vec2>> chords;
    for (const Neck& neck : necks[i]) {
      if (neck.gain >= least_gain) chords.emplace_back(points[neck.from], points[neck.to]);
    }
    if (chords.empty()) continue;
    const std::vector<std::int32_t>& faces = segmentation.charts()[i];
    std::vector<std::pair<std::int32_t, std::int32_t>> slits;
    const FlatMesh disc = ChartMesh(segmentation.gluing(), faces, &charts->place, &slits);
    std::int32_t groups = 0;
    const std::vector<std::int32_t> group = UncutGroups(*charts->surface, disc.opposite, faces, &groups);
    const std::vector<Vec2> positions = estimates.Positions(i, disc);
    std::vector<std::int32_t> part = PartAlong(chords, disc, Middles(disc, group, groups, positions), positions);
    if (!part.empty()) cuts.push_back({i, -1, -1, std::move(part)});
  }
  return cuts;
}

// Whether a chart is one polygon of three triangles or more. Two triangles of a polygon unfold side by side; more of
// them may unfold onto each other.
bool IsOnePolygon(const Job& job, const Chart& chart) {
  const std::vector<std::int32_t>& polygon = job.options.face_polygon;
  if (polygon.empty() || chart.faces.size() < 3) return false;
  return std::all_of(chart.faces.begin(), chart.faces.end(),
                     [&](std::int32_t f) { return polygon[f] == polygon[chart.faces.front()]; });
}

// Cuts, and returns whether that made new charts; `todo` then lists the charts to solve.
absl::StatusOr<bool> Split(Job* job, const std::vector<Segmentation::Cut>& cuts, std::vector<std::int32_t>* todo,
                           Charts* charts) {
  if (cuts.empty()) return false;
  Timer timer;
  PLANISH_RETURN_IF_ERROR(job->Enter(UnwrapStage::kCharts));
  *todo = charts->segmentation->Split(cuts, job->execution);
  if (job->execution.IsCancelled()) return absl::CancelledError("cancelled");
  charts->charts.resize(charts->segmentation->charts().size());
  for (const std::int32_t i : *todo) ExtractChart(i, job->execution, charts);
  job->seconds.charts += timer.Restart();
  return !todo->empty();
}

// Whether a chart is stretched too far, or too long for the packer.
bool IsUnwieldy(const Job& job, const Charts& charts, const std::vector<std::int32_t>& faces, double stretch,
                double extent) {
  const SeamOptions& seams = job.options.seams;
  const AtlasTuning& tuning = job.options.tuning;
  if (faces.size() < 2 || seams.policy != SeamPolicy::kAuto) return false;
  double area = 0;
  for (const std::int32_t f : faces) area += charts.surface->area[f];
  const auto [whole, longest] = charts.atlas_size.at(AtlasOf(job.options, faces.front()));
  constexpr double kAll = 0.999;
  double most_extent = area < tuning.whole_area * whole ? tuning.max_extent : tuning.most_extent;
  if (!job.options.IsForPacker() && area > kAll * whole) most_extent = tuning.seams_most_extent;
  const bool is_long = extent > std::max(most_extent * std::sqrt(whole), tuning.longer_than_face * longest);
  return stretch > job.options.MaxStretch() || (job.options.pack && is_long);
}

// Root mean square stretch of a chart without the faces that the report names as thinner than the type can hold.
double StretchAsDelivered(const Job& job, const Charts& charts, const Atlas& atlas, const Delivery& delivery,
                          const Chart& chart) {
  MapSums sums;
  for (std::int32_t i = 0; i < chart.topology->num_faces(); ++i) {
    const std::int32_t f = chart.faces[i];
    if (chart.is_widened(i) || charts.is_ignored(f)) continue;
    if (IsThin(job.mesh, delivery.uv, atlas.scale, delivery.precision, chart, f)) continue;
    sums.Add(TriangleOf(delivery.uv, f).data(), TriangleOf(job.mesh.positions, job.mesh.faces[f]).data());
  }
  return sums.StretchL2();
}

}  // namespace

bool IsToSplit(const Job& job, const Charts& charts, const MappedChart& mapped) {
  const ChartMap& map = mapped.map;
  const ChartFaults& faults = mapped.faults;
  const absl::Status& status = mapped.status;
  // After a stop request a chart is cut only if it must be. With a barrier, triangles may be so small that rounding
  // collapses them where the chart is placed.
  if (job.execution.IsStopRequested()) return !status.ok() || !faults.is_injective || map.flatten->barrier > 0;
  const SeamOptions& seams = job.options.seams;
  // Where seams are given, a barrier alone is no reason for another seam.
  const bool is_sound =
      status.ok() && map.flatten->converged &&
      (map.flatten->barrier == 0 || (seams.policy == SeamPolicy::kNeeded && faults.stretch <= kMostStretchForBorders));
  return !is_sound || !faults.is_injective ||
         IsUnwieldy(job, charts, mapped.chart.faces, faults.stretch, faults.extent);
}

bool IsToSplit(const Job& job, const Charts& charts, std::int32_t i, const ChartEstimate& estimate) {
  const std::vector<std::int32_t>& faces = charts.segmentation->charts()[i];
  if (charts.ReductionOf(faces) < 1) return false;
  return estimate.face >= 0 || IsUnwieldy(job, charts, faces, estimate.stretch, ExtentOf(estimate.points));
}

absl::Status RefineEstimated(const Job& job, const Execution& execution, ChartEstimates* estimates, Charts* charts,
                             bool are_known) {
  // Parts of the time: the first pass looks at all charts, later ones at the charts that were cut.
  constexpr double kFirstPass = 0.6, kLaterPass = 0.5;
  constexpr std::size_t kBatchFaces = 50'000;  // estimated side by side, before progress is reported
  double begin = 0, share = kFirstPass;
  Segmentation& segmentation = *charts->segmentation;
  std::vector<std::int32_t> todo(segmentation.charts().size());
  std::iota(todo.begin(), todo.end(), 0);
  bool are_parted = !job.options.IsForPacker() || todo.size() < 2;
  while (!todo.empty() && !job.execution.IsStopRequested()) {
    std::vector<Segmentation::Cut> cuts;
    std::size_t faces = 0, done = 0;
    for (const std::int32_t i : todo) faces += segmentation.charts()[i].size();
    for (std::size_t next = 0; next < todo.size();) {
      if (job.execution.IsCancelled()) return absl::CancelledError("cancelled");
      execution.Report(begin + share * static_cast<double>(done) / static_cast<double>(faces));
      const std::size_t first = next;
      for (std::size_t batch = 0; next < todo.size() && batch < kBatchFaces; ++next) {
        batch += segmentation.charts()[todo[next]].size();
        done += segmentation.charts()[todo[next]].size();
      }
      const std::span<const std::int32_t> of_batch(todo.data() + first, next - first);
      if (!are_known) estimates->Update(of_batch, execution);
      if (job.execution.IsCancelled()) return absl::CancelledError("cancelled");
      for (const std::int32_t i : of_batch) {
        const ChartEstimate& estimate = estimates->of(i);
        if (IsToSplit(job, *charts, i, estimate)) cuts.push_back({i, estimate.face, estimate.other_face});
      }
    }
    if (cuts.empty() && !std::exchange(are_parted, true)) {
      cuts = ChartsToPart(job, NecksOf(*charts, job.options), *estimates, charts);
    }
    todo = cuts.empty() ? std::vector<std::int32_t>() : segmentation.Split(cuts, job.execution);
    are_known = false;
    begin += share;
    share = kLaterPass * (1 - begin);
  }
  return job.execution.IsCancelled() ? absl::CancelledError("cancelled") : absl::OkStatus();
}

const PackerCuts& PackerCutsFor(const UnwrapOptions& options) {
  const AtlasTuning& tuning = options.tuning;
  return options.atlas.effort == PackEffort::kBest ? tuning.best_packer_cuts : tuning.packer_cuts;
}

NeckOptions NecksOf(const Charts& charts, const UnwrapOptions& options) {
  std::int32_t count = 0;
  for (const std::vector<std::int32_t>& faces : charts.segmentation->charts()) count += faces.empty() ? 0 : 1;
  const double allowed = (options.MaxStretch() - 1) / 0.05;
  const PackerCuts& cuts = PackerCutsFor(options);
  const double gain = cuts.hull_gain + cuts.few_hull_gain / count;
  return {gain * allowed * allowed * charts.drawn_area / count, cuts.cut_width * std::sqrt(charts.drawn_area)};
}

absl::StatusOr<bool> Refine(Job* job, std::vector<std::int32_t>* todo, Charts* charts) {
  std::vector<Segmentation::Cut> cuts;
  for (const std::int32_t i : *todo) {
    const MappedChart& mapped = charts->charts[i];
    if (!job->may_split() || mapped.chart.faces.size() < 2 || !IsToSplit(*job, *charts, mapped)) continue;
    Segmentation::Cut cut = {i, mapped.faults.face, mapped.faults.other_face};
    if (IsOnePolygon(*job, mapped.chart)) {
      // A polygon is torn only if its map overlaps itself, or if its solve failed.
      if (mapped.status.ok() && mapped.faults.is_injective) continue;
      cut.part = Indices(mapped.chart.faces.size());
    }
    cuts.push_back(std::move(cut));
    charts->given_up += mapped.map.flatten != nullptr && !mapped.map.flatten->converged;
  }
  return Split(job, cuts, todo, charts);
}

absl::StatusOr<bool> RefineDelivered(Job* job, const Atlas& atlas, const Delivery& delivery,
                                     std::vector<std::int32_t>* todo, Charts* charts) {
  if (!job->may_split() || job->execution.IsStopRequested()) return false;
  const std::int64_t turned = delivery.orientation.flipped + delivery.orientation.degenerate;
  const SeamOptions& seams = job->options.seams;
  std::vector<Segmentation::Cut> cuts;
  for (std::int32_t i = 0; i < charts->count(); ++i) {
    const Chart& chart = charts->charts[i].chart;
    if (chart.faces.size() < 2) continue;
    Segmentation::Cut cut = {i};
    if (turned > 0) cut.part = PartTurned(*charts, i, delivery.uv);
    if (cut.part.empty() && delivery.overlaps.pairs > 0) {
      const Overlaps found = OverlapsWithin({&charts->charts[i]}, delivery.uv, charts->ignored, job->execution);
      if (found.faces.size() >= 2) cut = {i, found.faces[0], found.faces[1]};
      if (found.faces.size() >= 2 && IsOnePolygon(*job, chart)) cut.part = Indices(chart.faces.size());
    }
    bool is_faulty = !cut.part.empty() || cut.face >= 0;
    if (!is_faulty && seams.policy == SeamPolicy::kAuto) {
      is_faulty =
          StretchAsDelivered(*job, *charts, atlas, delivery, chart) > kStretchTolerance * job->options.MaxStretch();
    }
    if (is_faulty) cuts.push_back(std::move(cut));
  }
  PLANISH_ASSIGN_OR_RETURN(const bool goes_on, Split(job, cuts, todo, charts));
  // Leaves some calls of WidenCharts() for the new charts.
  if (goes_on) charts->widenings = std::min(charts->widenings, kMostWidenings - kWideningsOfParts);
  return goes_on;
}

}  // namespace planish
