#include "core/charts/surface.h"

#include <cmath>
#include <numbers>

#include "Eigen/Geometry"
#include "core/base/portable_math.h"
#include "core/base/status_macros.h"
#include "core/mesh/angles.h"
#include "core/mesh/diagnosis.h"
#include "core/mesh/import.h"

namespace planish {
namespace {

void MeasureFaces(const Mesh& mesh, const std::vector<FaceKind>& kind, const Execution& execution, Surface* surface) {
  surface->takes_part.assign(kind.size(), 0);
  surface->is_flat.assign(kind.size(), 0);
  surface->area.assign(kind.size(), 0.0);
  surface->area_normal.assign(kind.size(), Vec3::Zero());
  execution.For(mesh.num_faces(), [&](std::int64_t begin, std::int64_t end) {
    for (std::int64_t f = begin; f < end; ++f) {
      surface->is_flat[f] = kind[f] == FaceKind::kWithoutArea;
      surface->takes_part[f] = surface->is_flat[f] || kind[f] == FaceKind::kWithArea;
      if (!surface->takes_part[f]) continue;
      const auto& [a, b, c] = mesh.faces[f];
      const Vec3& p = mesh.positions[a];
      surface->area_normal[f] = (mesh.positions[b] - p).cross(mesh.positions[c] - p) / 2;
      surface->area[f] = surface->area_normal[f].norm();
    }
  });
}

// Whether the normals of two neighbours are further apart than the angle of this cosine. Faces without area have none.
bool IsHard(const Surface& surface, std::int32_t f, std::int32_t g, double cosine) {
  if (surface.is_flat[f] || surface.is_flat[g]) return false;
  return surface.area_normal[f].dot(surface.area_normal[g]) < cosine * surface.area[f] * surface.area[g];
}

// Parts half-edges at given seams and hard edges.
void Cut(const Surface& surface, const GivenSeams& seams, std::vector<std::int32_t>* opposite) {
  const auto cut = [&](std::int32_t c) {
    if (const std::int32_t d = (*opposite)[c]; d >= 0) (*opposite)[c] = (*opposite)[d] = -1;
  };
  for (const std::int32_t c : seams.corners) cut(c);
  if (!(seams.hard_edge_degrees > 0) && seams.kind.empty()) return;
  std::vector<char> is_uncut(opposite->size(), 0);
  for (const std::int32_t c : seams.uncut_corners) {
    if ((*opposite)[c] >= 0) is_uncut[c] = is_uncut[(*opposite)[c]] = 1;
  }
  const bool has_hard = seams.hard_edge_degrees > 0;
  const double cosine = has_hard ? portable::Cos(seams.hard_edge_degrees * std::numbers::pi / 180) : -2;
  for (std::int32_t c = 0; c < static_cast<std::int32_t>(opposite->size()); ++c) {
    const std::int32_t d = (*opposite)[c];
    if (d < c || is_uncut[c]) continue;
    const bool parts_kinds = !seams.kind.empty() && seams.kind[c / 3] != seams.kind[d / 3];
    if (parts_kinds || (has_hard && IsHard(surface, c / 3, d / 3, cosine))) cut(c);
  }
}

}  // namespace

absl::StatusOr<Surface> MakeSurface(const Mesh& mesh, const GivenSeams& seams, const Execution& execution) {
  Pairing pairing = PairHalfEdges(mesh, JoinFor::kCharts, execution);
  const absl::Status refusal = DescribeElements(mesh, pairing).Refusal();
  if (execution.IsCancelled()) return absl::CancelledError("cancelled");
  PLANISH_RETURN_IF_ERROR(refusal);
  Surface surface;
  surface.non_manifold_edges = static_cast<std::int64_t>(pairing.non_manifold.size());
  surface.clashing_edges = static_cast<std::int64_t>(pairing.inconsistent.size());
  MeasureFaces(mesh, pairing.kind, execution, &surface);
  Cut(surface, seams, &pairing.opposite);
  surface.mesh = ImportMesh(mesh, pairing.opposite);
  for (const std::int32_t c : seams.uncut_corners) {
    const EdgeHandle edge = surface.mesh.edge_handle(HalfEdgeOf(surface.mesh, c));
    if (!surface.mesh.is_boundary(edge)) surface.mesh.data(edge).is_uncut = true;
  }
  const Eigen::VectorXd angles = MeasuredAngles(mesh, execution);
  surface.angle.assign(surface.mesh.n_halfedges(), 0.0);
  for (const FaceHandle f : surface.mesh.faces()) {
    const std::array<HalfedgeHandle, 3> half_edges = HalfEdgesOf(surface.mesh, f);
    for (int k = 0; k < 3; ++k) surface.angle[half_edges[k].idx()] = angles[3 * f.idx() + k];
  }
  if (execution.IsCancelled()) return absl::CancelledError("cancelled");
  return surface;
}

}  // namespace planish
