#include "core/unwrap/chart_set.h"

#include <algorithm>
#include <cmath>
#include <numeric>
#include <thread>
#include <utility>

#include "absl/strings/str_cat.h"
#include "absl/strings/str_join.h"
#include "core/base/error.h"
#include "core/base/status_macros.h"
#include "core/base/timer.h"
#include "core/mesh/angles.h"
#include "core/mesh/disc_check.h"
#include "core/mesh/rows.h"
#include "core/unwrap/barycentric.h"
#include "core/unwrap/hole_filling.h"
#include "core/unwrap/partition.h"
#include "core/unwrap/warnings.h"

namespace planish {
namespace {

constexpr std::int32_t kLargeChart = 30'000;    // faces; smaller ones are one thread's work
constexpr int kMaxRounds = 12;                  // of splitting
constexpr double kStretchSlack = 1.01;          // an estimate is not a map
constexpr double kMostStretchForBorders = 100;  // root mean square, to keep the borders that were given
constexpr double kMostStretchOfAbf = 3;         // with a barrier; others are looked for beyond, that are so much better
constexpr double kMostStretchForHoles = 1.1;    // times that of the slit map: a tube had better be slit than be a ring
// Beyond, a convex outline takes many seconds (an active set of thousands), and so does a barycentric map.
constexpr std::int32_t kMostFacesForConvex = 10'000, kMostFacesForBarycentres = 200'000;
constexpr double kNegligibleArea = 1e-4;  // of all; such a chart's stretch is not worth a split

constexpr double kMaxExtent = 1.4;  // of the side of the square that all charts would fill; longer ones hardly fit,
constexpr double kWholeArea = 0.6;  // unless they are most of it

}  // namespace

ChartSet::ChartSet(const Mesh& mesh, const UnwrapOptions& options, const UnwrapControl& control,
                   const Execution& execution)
    : mesh_(mesh), options_(options), control_(control), execution_(execution) {}

bool ChartSet::MaySplit() const {
  return options_.seams.policy == SeamPolicy::kAuto || options_.seams.policy == SeamPolicy::kNeeded;
}

absl::Status ChartSet::Enter(UnwrapStage stage) {
  if (execution_.IsStopped()) return absl::CancelledError("cancelled");
  progress_.stage = stage;
  if (control_.on_progress) control_.on_progress(progress_);
  return absl::OkStatus();
}

absl::Status ChartSet::Cut(std::vector<UnwrapWarning>* warnings) {
  if (options_.seams.policy == SeamPolicy::kNone) {
    PLANISH_ASSIGN_OR_RETURN(Topology topology, CheckDisc(mesh_, execution_));
    charts_.push_back(MakeChart(topology));
    disc_opposite_ = std::move(topology.opposite);
    return absl::OkStatus();
  }
  PLANISH_RETURN_IF_ERROR(CheckElements(mesh_, execution_));
  surface_ = MakeSurface(
      mesh_, {options_.seams.corners, options_.seams.uncut_corners, options_.seams.hard_edge_degrees}, execution_);
  if (execution_.IsStopped()) return absl::CancelledError("cancelled");
  std::int64_t without_area = 0;
  for (std::int32_t f = 0; f < surface_->num_faces(); ++f) {
    total_area_ += surface_->area[f];
    without_area += !surface_->takes_part[f] || surface_->is_flat[f];
  }
  if (without_area == surface_->num_faces()) {
    return MakeError(absl::StatusCode::kInvalidArgument, "MESH_FACE_DEGENERATE",
                     absl::StrCat("none of the ", without_area, " faces has an area; there is nothing to flatten"),
                     {{"count", absl::StrCat(without_area)}});
  }
  if (without_area > 0) {
    ignored_.resize(surface_->num_faces());
    for (std::int32_t f = 0; f < surface_->num_faces(); ++f) {
      ignored_[f] = !surface_->takes_part[f] || surface_->is_flat[f];
    }
  }
  WarnOfSurface(*surface_, ignored_, warnings);
  const bool by_stretch = options_.seams.policy == SeamPolicy::kAuto;
  segmentation_.emplace(*surface_, by_stretch ? Segmentation::Kind::kStretch : Segmentation::Kind::kWhole,
                        options_.seams.max_stretch, execution_);
  if (execution_.IsStopped()) return absl::CancelledError("cancelled");
  PLANISH_RETURN_IF_ERROR(CheckPieces());
  charts_.resize(segmentation_->charts().size());
  for (std::size_t i = 0; i < charts_.size(); ++i) {
    charts_[i] = MakeChart(segmentation_->gluing(), segmentation_->charts()[i], execution_.ForOneThread());
  }
  return absl::OkStatus();
}

// With SeamPolicy::kKeep every piece must be a disc as it is.
absl::Status ChartSet::CheckPieces() const {
  if (options_.seams.policy != SeamPolicy::kKeep) return absl::OkStatus();
  std::vector<std::int32_t> first_faces;
  for (std::int32_t i = 0; i < static_cast<std::int32_t>(segmentation_->charts().size()); ++i) {
    if (segmentation_->HasSlit(i)) first_faces.push_back(segmentation_->charts()[i].front());
  }
  if (first_faces.empty()) return absl::OkStatus();
  const std::size_t count = first_faces.size();
  if (first_faces.size() > 16) first_faces.resize(16);
  return MakeError(absl::StatusCode::kInvalidArgument, "PIECE_NOT_A_DISC",
                   absl::StrCat(count, count == 1 ? " piece" : " pieces",
                                " between the given seams cannot lie flat without another seam (closed, with several "
                                "boundary loops or with a handle): at face ",
                                absl::StrJoin(first_faces, ", "), "; give more seams, or allow them to be added"),
                   {{"count", absl::StrCat(count)}, {"faces", absl::StrJoin(first_faces, ",")}});
}

absl::StatusOr<Flattening> ChartSet::Flatten(std::int32_t i, BoundaryType boundary, const Execution& execution,
                                             bool reports) {
  FlattenControl control;
  control.interrupter = execution.interrupter;
  control.stop = execution.hurry;
  // The sides of a slit must come to lie on each other, or overlap.
  if (!charts_[i].slits.empty()) control.flat_enough = options_.flatten.tolerance;
  control.team = execution.team;
  if (reports && control_.on_progress) {
    control.on_progress = [this, i](const FlattenProgress& progress) {
      progress_.chart = i;
      progress_.flatten = progress;
      control_.on_progress(progress_);
    };
  }
  const Chart& chart = charts_[i];
  Eigen::VectorXd measured =
      surface_ ? Gather(chart, surface_->angle.data()) : Gather(chart, MeasuredAngles(mesh_, execution).data());
  return FlattenChart(chart, std::move(measured), OptionsWith(boundary), control, execution);
}

FlattenOptions ChartSet::OptionsWith(BoundaryType boundary) const {
  FlattenOptions options = options_.flatten;
  options.boundary = boundary;
  return options;
}

absl::Status ChartSet::Finish(std::int32_t i, const Execution& execution) {
  const Chart& chart = charts_[i];
  PLANISH_ASSIGN_OR_RETURN(maps_[i], LayOutChart(mesh_, chart, std::move(flattenings_[i]), execution));
  if (!MaySplit() && !maps_[i].flatten.stopped) return absl::OkStatus();
  faults_[i] = FindFaults(mesh_, chart, maps_[i], ignored_, execution);
  if (execution.IsHurried()) return absl::OkStatus();
  // Where more seams are welcome they are better: of 200 maps that ran over themselves, all were stretched too far by a
  // convex outline, at ten times the cost of a split.
  if (options_.seams.policy == SeamPolicy::kNeeded) KeepBorders(i, execution);
  return absl::OkStatus();
}

void ChartSet::KeepBorders(std::int32_t i, const Execution& execution) {
  const Chart& chart = charts_[i];
  const bool is_slit = maps_[i].closed_slits.size() < chart.slits.size();
  const auto is_poor = [&] { return maps_[i].flatten.barrier > 0 && faults_[i].stretch > kMostStretchOfAbf; };
  if (!is_slit && !faults_[i].does_overlap && !is_poor()) return;
  const Eigen::VectorXd measured = Gather(chart, surface_->angle.data());
  const FlattenSummary summary = maps_[i].flatten;
  // Takes a map that does not overlap and is stretched no more than `most`.
  const auto take = [&](absl::StatusOr<ChartMap> map, double most) {
    if (!map.ok() || !map->flatten.converged) return false;
    const ChartFaults faults = FindFaults(mesh_, chart, *map, ignored_, execution);
    if (faults.does_overlap || faults.stretch > most) return false;
    maps_[i] = *std::move(map);
    faults_[i] = faults;
    return true;
  };
  // Of a map in place of the present one, that is `better` times less stretched if that is sound.
  const auto most_stretch = [&](double better) {
    const bool is_sound = !faults_[i].does_overlap && faults_[i].stretch <= kMostStretchForBorders;
    return is_sound ? faults_[i].stretch / better : kMostStretchForBorders;
  };
  const bool is_large = static_cast<std::int32_t>(chart.faces.size()) > kMostFacesForBarycentres;
  const std::optional<FilledChart> filled = is_slit ? FillHoles(mesh_, chart, execution) : std::nullopt;
  if (filled) {
    FlattenControl control;
    control.interrupter = execution.interrupter;
    control.stop = execution.hurry;
    control.team = execution.team;
    const double most = most_stretch(1 / kMostStretchForHoles);
    if (take(MapFilled(mesh_, chart, *filled, measured, options_.flatten, control, execution), most)) return;
    if (!is_large && take(MapByBarycentres(mesh_, chart, &*filled, measured, summary, execution), most)) return;
  }
  if (!faults_[i].does_overlap && !is_poor()) return;
  // A convex outline cannot run over itself.
  const bool is_small = static_cast<std::int32_t>(chart.faces.size()) <= kMostFacesForConvex;
  if (options_.flatten.boundary == BoundaryType::kFree && is_small) {
    absl::StatusOr<Flattening> convex = Flatten(i, BoundaryType::kConvex, execution, false);
    if (convex.ok()) take(LayOutChart(mesh_, chart, *std::move(convex), execution), most_stretch(1));
  }
  if (is_large || filled || (!faults_[i].does_overlap && !is_poor())) return;
  take(MapByBarycentres(mesh_, chart, nullptr, measured, summary, execution), most_stretch(kMostStretchOfAbf));
}

template <typename Body>
void ChartSet::ForEachChart(const std::vector<std::int32_t>& charts, const Body& body) {
  const int threads = execution_.team == nullptr ? 1 : execution_.team->size();
  const auto small = std::find_if(charts.begin(), charts.end(), [&](std::int32_t i) {
    return threads > 1 && static_cast<std::int32_t>(charts_[i].faces.size()) < kLargeChart;
  });
  for (auto it = charts.begin(); it != small; ++it) body(*it, execution_, true);
  if (small == charts.end()) return;
  const std::thread::id self = std::this_thread::get_id();
  execution_.team->For(charts.end() - small, 1, [&](std::int64_t begin, std::int64_t end) {
    for (std::int64_t j = begin; j < end; ++j) {
      body(small[j], execution_.ForOneThread(), std::this_thread::get_id() == self);
    }
  });
}

absl::Status ChartSet::MapAll(std::vector<std::int32_t> charts, UnwrapSeconds* seconds) {
  Timer timer;
  std::stable_sort(charts.begin(), charts.end(),
                   [&](std::int32_t i, std::int32_t j) { return charts_[i].faces.size() > charts_[j].faces.size(); });
  flattenings_.resize(charts_.size());
  maps_.resize(charts_.size());
  faults_.resize(charts_.size());
  statuses_.resize(charts_.size());
  // The solve announces itself, with its first residual.
  progress_.stage = UnwrapStage::kSolve;
  progress_.chart_count = count();
  ForEachChart(charts, [&](std::int32_t i, const Execution& execution, bool reports) {
    absl::StatusOr<Flattening> flattening = Flatten(i, options_.flatten.boundary, execution, reports);
    statuses_[i] = flattening.status();
    if (flattening.ok()) flattenings_[i] = *std::move(flattening);
  });
  seconds->solve += timer.Restart();
  PLANISH_RETURN_IF_ERROR(Enter(UnwrapStage::kLayout));
  ForEachChart(charts, [&](std::int32_t i, const Execution& execution, bool) {
    if (statuses_[i].ok()) statuses_[i] = Finish(i, execution);
  });
  seconds->layout += timer.Restart();
  if (execution_.IsStopped()) return absl::CancelledError("cancelled");
  for (const std::int32_t i : charts) {
    const bool split_helps = MaySplit() && charts_[i].faces.size() > 1;
    if (!statuses_[i].ok() && !(split_helps && absl::IsInternal(statuses_[i]))) return statuses_[i];
  }
  return absl::OkStatus();
}

std::vector<Segmentation::Cut> ChartSet::ChartsToSplit(const std::vector<std::int32_t>& charts) const {
  std::vector<Segmentation::Cut> split;
  if (!MaySplit()) return split;
  for (const std::int32_t i : charts) {
    if (charts_[i].faces.size() < 2) continue;
    const ChartMap& map = maps_[i];
    // Once stopped a chart is cut only if it must be. A barrier keeps triangles open, but so small that they may
    // collapse where the chart goes.
    if (execution_.IsHurried()) {
      if (!statuses_[i].ok() || faults_[i].does_overlap || map.flatten.barrier > 0) {
        split.push_back({i, faults_[i].face, faults_[i].other_face});
      }
      continue;
    }
    // Where seams are given, an angle that a barrier keeps from vanishing is no reason for another one by itself.
    const bool is_sound = statuses_[i].ok() && map.flatten.converged &&
                          (map.flatten.barrier == 0 || (options_.seams.policy == SeamPolicy::kNeeded &&
                                                        faults_[i].stretch <= kMostStretchForBorders));
    double area = 0;
    for (const std::int32_t f : charts_[i].faces) area += surface_->area[f];
    const bool is_stretched = options_.seams.policy == SeamPolicy::kAuto && area > kNegligibleArea * total_area_ &&
                              faults_[i].stretch > kStretchSlack * options_.seams.max_stretch;
    const bool is_long = area < kWholeArea * total_area_ && faults_[i].extent > kMaxExtent * std::sqrt(total_area_);
    const bool is_awkward = options_.seams.policy == SeamPolicy::kAuto && options_.pack && is_long;
    if (!is_sound || faults_[i].does_overlap || is_stretched || is_awkward) {
      split.push_back({i, faults_[i].face, faults_[i].other_face});
    }
  }
  return split;
}

absl::Status ChartSet::CheckStopped(const absl::Status& made) const {
  if (!execution_.IsHurried()) return made;
  const auto error = [](const std::string& detail, const std::map<std::string, std::string>& metadata) {
    return MakeError(absl::StatusCode::kAborted, "STOPPED_EARLY",
                     absl::StrCat("stopped before there was a valid map to keep: ", detail), metadata);
  };
  if (ErrorInfoOf(made).reason == "SOLVER_FAILED") return error(std::string(made.message()), {});
  PLANISH_RETURN_IF_ERROR(made);
  std::int64_t turned = 0;
  for (int i = 0; i < count(); ++i) {
    if (maps_[i].flatten.stopped) turned += faults_[i].turned;
  }
  if (turned == 0) return absl::OkStatus();
  return error(absl::StrCat(Counted(turned, "triangle is", "triangles are"), " still flipped or without area"),
               {{"count", absl::StrCat(turned)}});
}

std::vector<Segmentation::Cut> ChartSet::ChartsToPart() const {
  std::vector<Segmentation::Cut> parts;
  for (std::int32_t i = 0; i < count(); ++i) {
    const std::vector<std::int32_t> part = PartAtNecks(*surface_, charts_[i], maps_[i], total_area_, count());
    if (part.empty()) continue;
    Segmentation::Cut cut = {i};
    cut.part.resize(part.size());
    const std::vector<std::int32_t>& faces = segmentation_->charts()[i];
    for (std::size_t f = 0; f < part.size(); ++f) {
      cut.part[std::lower_bound(faces.begin(), faces.end(), charts_[i].faces[f]) - faces.begin()] = part[f];
    }
    parts.push_back(std::move(cut));
  }
  return parts;
}

absl::Status ChartSet::Make(std::vector<UnwrapWarning>* warnings, UnwrapSeconds* seconds) {
  return CheckStopped(MakeMaps(warnings, seconds));
}

absl::Status ChartSet::MakeMaps(std::vector<UnwrapWarning>* warnings, UnwrapSeconds* seconds) {
  Timer timer;
  PLANISH_RETURN_IF_ERROR(Enter(UnwrapStage::kCharts));
  PLANISH_RETURN_IF_ERROR(Cut(warnings));
  seconds->charts = timer.Restart();
  std::vector<std::int32_t> todo(charts_.size());
  std::iota(todo.begin(), todo.end(), 0);
  const int first_count = count();
  bool parted = false;
  for (int round = 0;; ++round) {
    PLANISH_RETURN_IF_ERROR(MapAll(todo, seconds));
    std::vector<Segmentation::Cut> split = ChartsToSplit(todo);
    timer.Restart();
    const bool may_part = options_.seams.policy == SeamPolicy::kAuto && options_.pack && !execution_.IsHurried();
    if (split.empty() && may_part && count() > 1 && !parted) {
      parted = true;
      split = ChartsToPart();
    }
    if (split.empty() || round == kMaxRounds) break;
    PLANISH_RETURN_IF_ERROR(Enter(UnwrapStage::kCharts));
    todo = segmentation_->Split(split, execution_);
    if (execution_.IsStopped()) return absl::CancelledError("cancelled");
    charts_.resize(segmentation_->charts().size());
    for (const std::int32_t i : todo) {
      charts_[i] = MakeChart(segmentation_->gluing(), segmentation_->charts()[i], execution_.ForOneThread());
    }
    seconds->charts += timer.Restart();
  }
  for (const absl::Status& status : statuses_) PLANISH_RETURN_IF_ERROR(status);
  if (options_.seams.policy == SeamPolicy::kNeeded) {
    std::int64_t slit = 0;
    for (int i = 0; i < count(); ++i) slit += maps_[i].closed_slits.size() < charts_[i].slits.size();
    WarnOfAddedSeams(slit, count() - first_count, warnings);
  }
  return absl::OkStatus();
}

std::vector<std::int32_t> ChartSet::FaceChart() const {
  return segmentation_ ? segmentation_->chart() : std::vector<std::int32_t>(mesh_.faces.size(), 0);
}

std::vector<std::int32_t> ChartSet::Opposite() const {
  if (!segmentation_) return disc_opposite_;
  std::vector<std::int32_t> opposite = segmentation_->gluing().opposite();
  for (int i = 0; i < count(); ++i) {
    const auto in_mesh = [&](std::int32_t c) { return 3 * charts_[i].faces[c / 3] + c % 3; };
    for (const std::int32_t slit : maps_[i].closed_slits) {
      const std::int32_t c = in_mesh(charts_[i].slits[slit].first), d = in_mesh(charts_[i].slits[slit].second);
      opposite[c] = d;
      opposite[d] = c;
    }
  }
  return opposite;
}

Eigen::VectorXd ChartSet::Measured() const {
  if (!surface_) return MeasuredAngles(mesh_, execution_);
  return Eigen::Map<const Eigen::VectorXd>(surface_->angle.data(), static_cast<Eigen::Index>(surface_->angle.size()));
}

}  // namespace planish
