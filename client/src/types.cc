#include "planish/types.h"

#include <algorithm>

namespace planish {
inline namespace abi0 {
namespace {

// Signed and unsigned variants of one type may alias.
const std::uint32_t* AsUnsigned(const std::int32_t* ids) {
  return reinterpret_cast<const std::uint32_t*>(ids);
}

}  // namespace

MeshView::MeshView(std::span<const float> positions, std::span<const std::uint32_t> triangles)
    : floats_(positions.data()),
      indices_(triangles.data()),
      coordinate_count_(static_cast<std::int64_t>(positions.size())),
      index_count_(static_cast<std::int64_t>(triangles.size())) {}

MeshView::MeshView(std::span<const double> positions, std::span<const std::uint32_t> triangles)
    : doubles_(positions.data()),
      indices_(triangles.data()),
      coordinate_count_(static_cast<std::int64_t>(positions.size())),
      index_count_(static_cast<std::int64_t>(triangles.size())) {}

MeshView::MeshView(std::span<const float> positions, std::span<const std::int32_t> triangles)
    : MeshView(positions, std::span(AsUnsigned(triangles.data()), triangles.size())) {}

MeshView::MeshView(std::span<const double> positions, std::span<const std::int32_t> triangles)
    : MeshView(positions, std::span(AsUnsigned(triangles.data()), triangles.size())) {}

MeshView MeshView::WithSeams(std::span<const std::uint32_t> vertex_pairs) const {
  MeshView view = *this;
  view.seam_vertices_ = vertex_pairs;
  return view;
}

MeshView MeshView::WithSeams(std::span<const std::int32_t> vertex_pairs) const {
  return WithSeams(std::span(AsUnsigned(vertex_pairs.data()), vertex_pairs.size()));
}

MeshView MeshView::WithSeamCorners(std::span<const std::int32_t> corners) const {
  MeshView view = *this;
  view.seam_corners_ = corners;
  return view;
}

MeshView MeshView::WithUncutCorners(std::span<const std::int32_t> corners) const {
  MeshView view = *this;
  view.uncut_corners_ = corners;
  return view;
}

const char* ToString(JobState state) {
  switch (state) {
    case JobState::kUnspecified:
      return "unknown";
    case JobState::kQueued:
      return "QUEUED";
    case JobState::kRunning:
      return "RUNNING";
    case JobState::kStopping:
      return "STOPPING";
    case JobState::kSucceeded:
      return "SUCCEEDED";
    case JobState::kFailed:
      return "FAILED";
    case JobState::kCancelled:
      return "CANCELLED";
    case JobState::kExpired:
      return "EXPIRED";
  }
  return "unknown";
}

const char* ToString(Stage stage) {
  switch (stage) {
    case Stage::kUnspecified:
      return "unknown";
    case Stage::kUpload:
      return "upload";
    case Stage::kQueue:
      return "queue";
    case Stage::kDecode:
      return "decode";
    case Stage::kCharts:
      return "charts";
    case Stage::kSolve:
      return "solve";
    case Stage::kLayout:
      return "layout";
    case Stage::kPack:
      return "pack";
    case Stage::kVerify:
      return "verify";
    case Stage::kEncode:
      return "encode";
    case Stage::kDownload:
      return "download";
  }
  return "unknown";
}

const char* ToString(Seams seams) {
  switch (seams) {
    case Seams::kNone:
      return "none";
    case Seams::kKeep:
      return "keep";
    case Seams::kNeeded:
      return "needed";
    case Seams::kAuto:
      return "auto";
  }
  return "unknown";
}

const char* ToString(Solver solver) {
  switch (solver) {
    case Solver::kAuto:
      return "auto";
    case Solver::kUzawa:
      return "uzawa";
    case Solver::kMinres:
      return "minres";
    case Solver::kDirect:
      return "direct";
  }
  return "unknown";
}

const char* ToString(System system) {
  switch (system) {
    case System::kAuto:
      return "auto";
    case System::kFull:
      return "full";
    case System::kReduced:
      return "reduced";
  }
  return "unknown";
}

const char* ToString(Preconditioner preconditioner) {
  switch (preconditioner) {
    case Preconditioner::kAuto:
      return "auto";
    case Preconditioner::kNone:
      return "none";
    case Preconditioner::kJacobi:
      return "jacobi";
    case Preconditioner::kCholesky:
      return "cholesky";
    case Preconditioner::kAmg:
      return "amg";
  }
  return "unknown";
}

const char* ToString(Hessian hessian) {
  switch (hessian) {
    case Hessian::kConvex:
      return "convex";
    case Hessian::kExact:
      return "exact";
    case Hessian::kAuto:
      return "auto";
  }
  return "unknown";
}

const char* ToString(Boundary boundary) {
  switch (boundary) {
    case Boundary::kFree:
      return "free";
    case Boundary::kConvex:
      return "convex";
  }
  return "unknown";
}

const char* ToString(Priority priority) {
  switch (priority) {
    case Priority::kLow:
      return "low";
    case Priority::kNormal:
      return "normal";
    case Priority::kHigh:
      return "high";
  }
  return "unknown";
}

const char* ToString(Effort effort) {
  switch (effort) {
    case Effort::kFast:
      return "fast";
    case Effort::kNormal:
      return "normal";
    case Effort::kBest:
      return "best";
  }
  return "unknown";
}

const char* ToString(Precision precision) {
  switch (precision) {
    case Precision::kAuto:
      return "auto";
    case Precision::kFloat:
      return "float";
    case Precision::kDouble:
      return "double";
  }
  return "unknown";
}

bool IsTerminal(JobState state) {
  return state == JobState::kSucceeded || state == JobState::kFailed || state == JobState::kCancelled ||
         state == JobState::kExpired;
}

double Residual::Worst() const {
  return std::max({triangle, vertex, wheel, gradient});
}

std::vector<double> Uv::AsDouble() const {
  return precision == Precision::kDouble ? doubles : std::vector<double>(floats.begin(), floats.end());
}

bool UnwrapResult::IsUsable() const {
  return report.chart_totals.not_converged == 0 && report.quality.flipped == 0 && report.quality.degenerate == 0;
}

}  // namespace abi0
}  // namespace planish
