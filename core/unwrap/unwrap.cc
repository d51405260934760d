#include "core/unwrap/unwrap.h"

#include <algorithm>
#include <utility>

#include "absl/strings/str_cat.h"
#include "absl/strings/str_format.h"
#include "core/base/error.h"
#include "core/base/status_macros.h"
#include "core/base/timer.h"
#include "core/mesh/disc_check.h"
#include "core/unwrap/atlas.h"
#include "core/unwrap/chart_set.h"
#include "core/unwrap/distortion.h"
#include "core/unwrap/verify.h"
#include "core/unwrap/warnings.h"

namespace planish {
namespace {

// One run of Unwrap().
class Run {
 public:
  Run(const Mesh& mesh, const UnwrapOptions& options, const UnwrapControl& control)
      : mesh_(mesh),
        options_(options),
        control_(control),
        team_(options.threads),
        execution_{&team_, control.interrupter, control.stop},
        charts_(mesh, options, control, execution_) {}

  absl::StatusOr<UnwrapResult> operator()();

 private:
  // Announces a stage, unless interrupted.
  absl::Status Enter(UnwrapStage stage);
  void ChoosePrecision(CornerUv uv);
  // Says so if rounding to float, which keeps every triangle, still costs energy worth mentioning.
  void WarnOfCoarseFloat();
  absl::Status Verify();
  Overlaps FindOverlaps() const;
  // Target angles and weights of every corner; those of ignored faces are 0.
  TargetAngles Targets(const Eigen::VectorXd& measured) const;

  const Mesh& mesh_;
  const UnwrapOptions& options_;
  const UnwrapControl& control_;
  ThreadTeam team_;
  const Execution execution_;
  ChartSet charts_;
  bool stopped_ = false;           // before the verifier began
  OrientationFaults orientation_;  // of result_.uv
  UnwrapResult result_;
};

absl::Status Run::Enter(UnwrapStage stage) {
  if (execution_.IsStopped()) return absl::CancelledError("cancelled");
  UnwrapProgress progress;
  progress.stage = stage;
  progress.chart_count = charts_.count();
  progress.chart = charts_.count() - 1;
  progress.flatten = charts_.last_progress();
  if (control_.on_progress) control_.on_progress(progress);
  return absl::OkStatus();
}

absl::StatusOr<UnwrapResult> Run::operator()() {
  PLANISH_RETURN_IF_ERROR(charts_.Make(&result_.warnings, &result_.seconds));
  if (const std::int64_t isolated = CountIsolatedVertices(mesh_); isolated > 0) {
    result_.warnings.push_back({"ISOLATED_VERTICES",
                                absl::StrCat(Counted(isolated, "vertex has", "vertices have"), " no face and no UV"),
                                {{"count", absl::StrCat(isolated)}}});
  }
  Timer timer;
  PLANISH_RETURN_IF_ERROR(Enter(UnwrapStage::kPack));
  Atlas atlas = MakeAtlas(mesh_, options_, execution_, &charts_);
  if (execution_.IsStopped()) return absl::CancelledError("cancelled");
  result_.tiles = atlas.tiles;
  if (options_.pack) result_.texels_per_unit = atlas.scale * options_.atlas.texture_size;
  if (charts_.count() > 1 && options_.pack && atlas.padding < options_.atlas.padding) {
    result_.warnings.push_back(
        {"PADDING_NOT_KEPT",
         absl::StrFormat("there is room for %.3g texels between charts, not for the %d asked for; give more texels or "
                         "tiles",
                         atlas.padding, options_.atlas.padding),
         {{"padding", absl::StrFormat("%g", atlas.padding)}}});
  }
  stopped_ = execution_.IsHurried();
  result_.seconds.pack = timer.Restart();

  PLANISH_RETURN_IF_ERROR(Enter(UnwrapStage::kVerify));
  ChoosePrecision(std::move(atlas.uv));
  PLANISH_RETURN_IF_ERROR(Verify());
  result_.seconds.verify = timer.Restart();
  return std::move(result_);
}

void Run::ChoosePrecision(CornerUv uv) {
  const OrientationFaults exact = CheckOrientations(uv, execution_, charts_.ignored());
  if (options_.precision == Precision::kDouble) {
    result_.precision = Precision::kDouble;
    result_.uv = std::move(uv);
    orientation_ = exact;
    return;
  }
  CornerUv rounded = RoundToFloat(uv, execution_);
  const OrientationFaults after = CheckOrientations(rounded, execution_, charts_.ignored());
  const std::int64_t lost = after.flipped + after.degenerate - exact.flipped - exact.degenerate;
  const bool deliver_double = options_.precision == Precision::kAuto && lost > 0;
  if (lost > 0) {
    const std::string what = absl::StrCat("rounding to float flips or collapses ",
                                          Counted(lost, "triangle", "triangles"), ", the scale varies too much; ");
    result_.warnings.push_back(
        {"UV_PRECISION",
         what + (deliver_double ? "the UV are delivered as double" : "float was asked for, double would keep them"),
         FaceMetadata(lost, after.faces)});
  }
  result_.precision = deliver_double ? Precision::kDouble : Precision::kFloat;
  result_.uv = deliver_double ? std::move(uv) : std::move(rounded);
  orientation_ = deliver_double ? exact : after;
}

void Run::WarnOfCoarseFloat() {
  constexpr double kNegligible = 1e-9;   // energy per angle
  constexpr double kWorthSaying = 1e-3;  // of the energy before rounding
  double energy = 0, angles = 0;
  for (const ChartReport& chart : result_.charts) {
    energy += chart.flatten.energy;
    angles += 3.0 * static_cast<double>(chart.triangles);
  }
  const double solved = energy / angles, lost = result_.quality.abf_energy - solved;
  if (result_.precision != Precision::kFloat || lost <= kNegligible || lost <= kWorthSaying * solved) return;
  // Faces without area count in the one and not in the other.
  if (!charts_.ignored().empty()) return;
  result_.warnings.push_back(
      {"UV_PRECISION",
       absl::StrFormat("rounding to float adds %.2g %% to the ABF energy, the scale varies much; double would keep it",
                       100 * lost / solved),
       {{"abf_energy_lost", absl::StrFormat("%g", lost)}}});
}

TargetAngles Run::Targets(const Eigen::VectorXd& measured) const {
  TargetAngles all = {Eigen::VectorXd::Zero(measured.size()), Eigen::VectorXd::Zero(measured.size())};
  for (int i = 0; i < charts_.count(); ++i) {
    const Chart& chart = charts_.chart(i);
    const TargetAngles target = MakeTargetAngles(chart.topology, Gather(chart, measured.data()), execution_);
    Scatter(chart, target.angle, all.angle.data());
    Scatter(chart, target.weight, all.weight.data());
  }
  return all;
}

// Charts that were not packed lie one over the other: each is looked at by itself.
Overlaps Run::FindOverlaps() const {
  const std::vector<std::int32_t> opposite = charts_.Opposite();
  if (options_.pack) return CheckOverlaps(opposite, result_.uv, orientation_, execution_, charts_.ignored());
  Overlaps all;
  for (int i = 0; i < charts_.count() && !execution_.IsStopped(); ++i) {
    const Overlaps found = OverlapsWithin(charts_.chart(i), opposite, result_.uv, charts_.ignored(), execution_);
    all.pairs += found.pairs;
    all.limited |= found.limited;
    for (const std::int32_t f : found.faces) {
      if (all.faces.size() < 16) all.faces.push_back(charts_.chart(i).faces[f]);
    }
  }
  return all;
}

absl::Status Run::Verify() {
  const Overlaps overlaps = FindOverlaps();
  if (execution_.IsStopped()) return absl::CancelledError("cancelled");
  result_.face_chart = charts_.FaceChart();
  for (int i = 0; i < charts_.count(); ++i) {
    const Chart& chart = charts_.chart(i);
    result_.charts.push_back({chart.topology.num_faces(), charts_.map(i).flatten, charts_.map(i).is_barycentric,
                              StretchOf(mesh_, chart, result_.uv, charts_.ignored(), execution_)});
  }
  {
    const Eigen::VectorXd measured = charts_.Measured();
    MeasureDistortion(mesh_, measured, Targets(measured), result_.uv, charts_.ignored(), &result_.quality, execution_);
  }
  if (execution_.IsStopped()) return absl::CancelledError("cancelled");
  result_.quality.packing_efficiency /= result_.tiles;
  result_.quality.flipped = orientation_.flipped;
  result_.quality.degenerate = orientation_.degenerate;
  result_.quality.overlapping = overlaps.pairs;
  WarnOfCoarseFloat();
  if (stopped_) WarnOfStop(result_.charts, &result_.warnings);
  WarnOfCharts(result_.charts, options_.seams.policy == SeamPolicy::kAuto ? options_.seams.max_stretch : 0, stopped_,
               &result_.warnings);
  WarnOfFaults(orientation_, overlaps, &result_.warnings);
  return absl::OkStatus();
}

}  // namespace

absl::StatusOr<UnwrapResult> Unwrap(const Mesh& mesh, const UnwrapOptions& options, const UnwrapControl& control) {
  PLANISH_RETURN_IF_ERROR(options.Validate());
  PLANISH_RETURN_IF_ERROR(options.ValidateSeams(mesh.num_faces()));
  return Run(mesh, options, control)();
}

}  // namespace planish
