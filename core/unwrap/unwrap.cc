#include "core/unwrap/unwrap.h"

#include <algorithm>
#include <utility>

#include "absl/strings/str_cat.h"
#include "absl/strings/str_format.h"
#include "absl/strings/str_join.h"
#include "core/abf/layout.h"
#include "core/base/error.h"
#include "core/base/status_macros.h"
#include "core/base/timer.h"
#include "core/mesh/angles.h"
#include "core/mesh/disc_check.h"
#include "core/mesh/face_order.h"
#include "core/mesh/rows.h"
#include "core/unwrap/distortion.h"
#include "core/unwrap/placement.h"
#include "core/unwrap/verify.h"

namespace planish {
namespace {

std::string Counted(std::int64_t count, const std::string& one, const std::string& many) {
  return absl::StrCat(count, " ", count == 1 ? one : many);
}

std::map<std::string, std::string> FaceMetadata(std::int64_t count, const std::vector<std::int32_t>& faces) {
  return {{"count", std::to_string(count)}, {"faces", absl::StrJoin(faces, ",")}};
}

// One run of Unwrap().
class Run {
 public:
  Run(const Mesh& mesh, const UnwrapOptions& options, const UnwrapControl& control)
      : mesh_(mesh),
        options_(options),
        control_(control),
        team_(options.threads),
        execution_{&team_, control.interrupter} {}

  absl::StatusOr<UnwrapResult> operator()();

 private:
  // CANCELLED after an interrupt.
  absl::Status CheckInterrupt() const;
  // Announces a stage, unless interrupted.
  absl::Status Enter(UnwrapStage stage);
  // The UV of every corner as double.
  CornerUv AtCorners(const Topology& topology, const std::vector<Vec2>& positions) const;
  void ChoosePrecision(CornerUv uv);
  // Says so if rounding to float, which keeps every triangle, still costs energy worth mentioning.
  void WarnOfCoarseFloat();
  // Of the faces in `sorted`.
  TargetAngles Targets(const SortedTopology& sorted) const;
  absl::Status Verify(const Topology& topology, const SortedTopology& sorted);
  void Warn(const std::string& reason, const std::string& message, std::map<std::string, std::string> metadata = {}) {
    result_.warnings.push_back({reason, message, std::move(metadata)});
  }

  const Mesh& mesh_;
  const UnwrapOptions& options_;
  const UnwrapControl& control_;
  ThreadTeam team_;
  const Execution execution_;
  UnwrapProgress progress_;
  OrientationFaults orientation_;  // of result_.uv
  UnwrapResult result_;
};

absl::Status Run::CheckInterrupt() const {
  return execution_.IsStopped() ? absl::CancelledError("cancelled") : absl::OkStatus();
}

absl::Status Run::Enter(UnwrapStage stage) {
  PLANISH_RETURN_IF_ERROR(CheckInterrupt());
  progress_.stage = stage;
  if (control_.on_progress) control_.on_progress(progress_);
  return absl::OkStatus();
}

absl::StatusOr<UnwrapResult> Run::operator()() {
  Timer timer;
  PLANISH_RETURN_IF_ERROR(Enter(UnwrapStage::kCharts));
  PLANISH_ASSIGN_OR_RETURN(Topology topology, CheckDisc(mesh_, execution_));
  if (const std::int64_t isolated = CountIsolatedVertices(mesh_); isolated > 0) {
    Warn("ISOLATED_VERTICES", absl::StrCat(Counted(isolated, "vertex has", "vertices have"), " no face and no UV"),
         {{"count", std::to_string(isolated)}});
  }
  // The solver goes over faces and rows in turn, time and again: it gets a topology where both lie along one curve.
  const SortedTopology sorted = SortFaces(topology);
  DropRows(&topology);
  PLANISH_RETURN_IF_ERROR(CheckInterrupt());
  result_.seconds.charts = timer.Restart();

  // The solve announces itself, with its first residual.
  progress_.stage = UnwrapStage::kSolve;
  TargetAngles target = Targets(sorted);
  PLANISH_RETURN_IF_ERROR(CheckInterrupt());
  FlattenControl flatten_control;
  flatten_control.interrupter = control_.interrupter;
  flatten_control.team = &team_;
  flatten_control.on_progress = [this](const FlattenProgress& progress) {
    progress_.flatten = progress;
    if (control_.on_progress) control_.on_progress(progress_);
  };
  PLANISH_ASSIGN_OR_RETURN(Flattening flattening,
                           FlattenAngles(sorted.topology, target, options_.flatten, flatten_control));
  target = TargetAngles();
  result_.charts.push_back({mesh_.num_faces(), flattening.summary});
  if (!flattening.summary.converged) Warn("NOT_CONVERGED", flattening.summary.stop_message);
  if (flattening.summary.preconditioner_changed) {
    Warn("PRECONDITIONER_CHANGED", "multigrid did not converge on this mesh; a Cholesky factorization took over");
  }
  if (const BoundaryReport& boundary = flattening.summary.boundary; !boundary.settled) {
    Warn("BOUNDARY_NOT_SETTLED",
         absl::StrCat("the active set of the boundary control had not settled after ",
                      Counted(boundary.set_changes, "change", "changes"),
                      ": the outline may be not quite convex, or straighter than it need be"),
         {{"changes", absl::StrCat(boundary.set_changes)}});
  }
  if (const double barrier = flattening.summary.barrier; barrier > 0) {
    const bool convex = options_.flatten.boundary == BoundaryType::kConvex;
    Warn("BARRIER_KEPT",
         absl::StrFormat("the ABF energy alone has no minimum with positive angles on this mesh%s; a "
                         "barrier of %g keeps its triangles open; a seam%s would relieve it",
                         convex ? " with a convex outline" : "", barrier, convex ? " or a free boundary" : ""),
         {{"barrier", absl::StrFormat("%g", barrier)}});
  }
  result_.seconds.solve = timer.Restart();

  PLANISH_RETURN_IF_ERROR(Enter(UnwrapStage::kLayout));
  Layout layout = LayOut(sorted.topology, flattening.angles, execution_);
  PLANISH_RETURN_IF_ERROR(CheckInterrupt());
  flattening.angles.resize(0);
  if (!std::all_of(layout.positions.begin(), layout.positions.end(), [](const Vec2& p) { return p.allFinite(); })) {
    return MakeError(absl::StatusCode::kInternal, "SOLVER_FAILED",
                     absl::StrCat("the layout has non-finite coordinates; ", flattening.summary.stop_message));
  }
  result_.seconds.layout = timer.Restart();

  PLANISH_RETURN_IF_ERROR(Enter(UnwrapStage::kPack));
  PlaceInUnitSquare(&layout.positions, execution_);
  CornerUv uv = AtCorners(topology, layout.positions);
  layout = Layout();
  result_.seconds.pack = timer.Restart();

  PLANISH_RETURN_IF_ERROR(Enter(UnwrapStage::kVerify));
  ChoosePrecision(std::move(uv));
  PLANISH_RETURN_IF_ERROR(CheckInterrupt());
  PLANISH_RETURN_IF_ERROR(Verify(topology, sorted));
  result_.seconds.verify = timer.Restart();
  return std::move(result_);
}

CornerUv Run::AtCorners(const Topology& topology, const std::vector<Vec2>& positions) const {
  CornerUv uv(2 * static_cast<std::size_t>(topology.num_corners()));
  execution_.For(topology.num_faces(), [&](std::int64_t begin, std::int64_t end) {
    for (std::int64_t f = begin; f < end; ++f) {
      for (int k = 0; k < 3; ++k) {
        const Vec2& p = positions[topology.faces[f][k]];
        uv[2 * (3 * f + k)] = p.x();
        uv[2 * (3 * f + k) + 1] = p.y();
      }
    }
  });
  return uv;
}

void Run::ChoosePrecision(CornerUv uv) {
  const OrientationFaults exact = CheckOrientations(uv, execution_);
  if (options_.precision == Precision::kDouble) {
    result_.precision = Precision::kDouble;
    result_.uv = std::move(uv);
    orientation_ = exact;
    return;
  }
  CornerUv rounded = RoundToFloat(uv, execution_);
  const OrientationFaults after = CheckOrientations(rounded, execution_);
  const std::int64_t lost = after.flipped + after.degenerate - exact.flipped - exact.degenerate;
  const bool deliver_double = options_.precision == Precision::kAuto && lost > 0;
  if (lost > 0) {
    const std::string what = absl::StrCat("rounding to float flips or collapses ",
                                          Counted(lost, "triangle", "triangles"), ", the scale varies too much; ");
    Warn("UV_PRECISION",
         what + (deliver_double ? "the UV are delivered as double" : "float was asked for, double would keep them"),
         FaceMetadata(lost, after.faces));
  }
  result_.precision = deliver_double ? Precision::kDouble : Precision::kFloat;
  result_.uv = deliver_double ? std::move(uv) : std::move(rounded);
  orientation_ = deliver_double ? exact : after;
}

void Run::WarnOfCoarseFloat() {
  constexpr double kNegligible = 1e-9;   // energy per angle
  constexpr double kWorthSaying = 1e-3;  // of the energy before rounding
  const double solved = result_.charts[0].flatten.energy / (3.0 * static_cast<double>(mesh_.num_faces()));
  const double lost = result_.quality.abf_energy - solved;
  if (result_.precision != Precision::kFloat || lost <= kNegligible || lost <= kWorthSaying * solved) return;
  Warn("UV_PRECISION",
       absl::StrFormat("rounding to float adds %.2g %% to the ABF energy, the scale varies much; double would keep it",
                       100 * lost / solved),
       {{"abf_energy_lost", absl::StrFormat("%g", lost)}});
}

TargetAngles Run::Targets(const SortedTopology& sorted) const {
  return MakeTargetAngles(sorted.topology, sorted.ToSorted(MeasuredAngles(mesh_, execution_)), execution_);
}

absl::Status Run::Verify(const Topology& topology, const SortedTopology& sorted) {
  const Overlaps overlaps = CheckOverlaps(topology, result_.uv, orientation_, execution_);
  PLANISH_RETURN_IF_ERROR(CheckInterrupt());
  TargetAngles target = Targets(sorted);
  target = {sorted.ToOriginal(target.angle), sorted.ToOriginal(target.weight)};
  MeasureDistortion(mesh_, MeasuredAngles(mesh_, execution_), target, result_.uv, &result_.quality, execution_);
  PLANISH_RETURN_IF_ERROR(CheckInterrupt());
  WarnOfCoarseFloat();
  result_.quality.flipped = orientation_.flipped;
  result_.quality.degenerate = orientation_.degenerate;
  result_.quality.overlapping = overlaps.pairs;
  if (orientation_.flipped > 0) {
    Warn("UV_FLIPPED", absl::StrCat(Counted(orientation_.flipped, "UV triangle is", "UV triangles are"), " flipped"),
         FaceMetadata(orientation_.flipped, orientation_.faces));
  }
  if (orientation_.degenerate > 0) {
    Warn("UV_DEGENERATE",
         absl::StrCat(Counted(orientation_.degenerate, "UV triangle has", "UV triangles have"), " no area"),
         FaceMetadata(orientation_.degenerate, orientation_.faces));
  }
  if (overlaps.pairs > 0) {
    Warn("UV_OVERLAPPING",
         absl::StrCat(overlaps.limited ? "at least " : "", Counted(overlaps.pairs, "pair", "pairs"),
                      " of UV triangles overlap: the chart runs over itself; a seam would open it"),
         FaceMetadata(overlaps.pairs, overlaps.faces));
  }
  return absl::OkStatus();
}

}  // namespace

absl::StatusOr<UnwrapResult> Unwrap(const Mesh& mesh, const UnwrapOptions& options, const UnwrapControl& control) {
  PLANISH_RETURN_IF_ERROR(options.Validate());
  PLANISH_RETURN_IF_ERROR(options.ValidateSeams(mesh.num_faces()));
  return Run(mesh, options, control)();
}

}  // namespace planish
