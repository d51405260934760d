#include "core/charts/surface.h"

#include <memory>
#include <numbers>

#include "Eigen/Geometry"
#include "absl/strings/str_cat.h"
#include "core/base/error.h"
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
  execution.ForEach(mesh.num_faces(), [&](std::int64_t f) {
    surface->is_flat[f] = kind[f] == FaceKind::kWithoutArea;
    surface->takes_part[f] = surface->is_flat[f] || kind[f] == FaceKind::kWithArea;
    if (!surface->takes_part[f]) return;
    const auto& [a, b, c] = mesh.faces[f];
    const Vec3& p = mesh.positions[a];
    surface->area_normal[f] = (mesh.positions[b] - p).cross(mesh.positions[c] - p) / 2;
    surface->area[f] = surface->area_normal[f].norm();
  });
}

// Whether half-edge c is joined to another triangle of its polygon.
bool IsDiagonal(const GivenSeams& seams, const std::vector<std::int32_t>& opposite, std::int32_t c) {
  return !seams.polygon.empty() && opposite[c] >= 0 && seams.polygon[c / 3] == seams.polygon[opposite[c] / 3];
}

// OPTIONS_INVALID if a given seam is a diagonal, as polygons are never cut.
absl::Status CheckSeamsAgainstPolygons(const GivenSeams& seams, const std::vector<std::int32_t>& opposite) {
  for (const std::int32_t c : seams.corners) {
    if (!IsDiagonal(seams, opposite, c)) continue;
    return MakeError(absl::StatusCode::kInvalidArgument, "OPTIONS_INVALID",
                     absl::StrCat("seam_corners: the edge that corner ", c,
                                  " faces is a diagonal of a polygon, which no seam can follow; leave it out"),
                     {{"field", "seam_corners"}, {"corner", absl::StrCat(c)}, {"face", absl::StrCat(c / 3)}});
  }
  return absl::OkStatus();
}

// Separates half-edges at given seams and where two faces may not be neighbours. Moves the edges of more than two faces
// to `crowded_edges`, without half-edges at given seams.
void Cut(const Surface& surface, const GivenSeams& seams, Pairing* pairing,
         std::vector<std::vector<std::int32_t>>* crowded_edges) {
  std::vector<std::int32_t>& opposite = pairing->opposite;
  std::vector<char> is_seam(opposite.size(), 0);
  const auto cut = [&](std::int32_t c) {
    if (const std::int32_t d = opposite[c]; d >= 0) opposite[c] = opposite[d] = -1;
  };
  for (const std::int32_t c : seams.corners) {
    is_seam[c] = 1;
    if (opposite[c] >= 0) is_seam[opposite[c]] = 1;
    cut(c);
  }
  for (std::vector<std::int32_t>& at : pairing->non_manifold) {
    std::erase_if(at, [&](std::int32_t c) { return is_seam[c] != 0; });
    if (at.size() > 1) crowded_edges->push_back(std::move(at));
  }
  if (surface.hard_cosine < -1 && seams.kind.empty() && seams.part.empty()) return;
  std::vector<char> is_uncut(opposite.size(), 0);
  for (std::int32_t c = 0; c < static_cast<std::int32_t>(opposite.size()); ++c)
    is_uncut[c] = IsDiagonal(seams, opposite, c);
  for (const std::int32_t c : seams.uncut_corners) {
    if (opposite[c] >= 0) is_uncut[c] = is_uncut[opposite[c]] = 1;
  }
  for (std::int32_t c = 0; c < static_cast<std::int32_t>(opposite.size()); ++c) {
    const std::int32_t d = opposite[c];
    if (d < c) continue;
    const bool parts = !seams.part.empty() && seams.part[c / 3] != seams.part[d / 3];
    if (parts || (!is_uncut[c] && !surface.MayJoin(c / 3, d / 3))) cut(c);
  }
}

}  // namespace

// No edge of a face without area is a hard edge, whatever the normals of its two faces.
bool Surface::MayJoin(std::int32_t f, std::int32_t g) const {
  if (!kind.empty() && kind[f] != kind[g]) return false;
  if (!part.empty() && part[f] != part[g]) return false;
  if (hard_cosine < -1 || is_flat[f] || is_flat[g]) return true;
  return area_normal[f].dot(area_normal[g]) >= hard_cosine * area[f] * area[g];
}

absl::StatusOr<Surface> MakeSurface(const Mesh& mesh, const GivenSeams& seams, const Execution& execution) {
  Pairing pairing = PairHalfEdges(mesh, JoinFor::kCharts, execution, seams.polygon);
  const absl::Status refusal = DescribeElements(mesh, pairing).Refusal();
  if (execution.IsCancelled()) return absl::CancelledError("cancelled");
  PLANISH_RETURN_IF_ERROR(refusal);
  Surface surface;
  surface.non_manifold_edges = static_cast<std::int64_t>(pairing.non_manifold.size());
  surface.clashing_edges = static_cast<std::int64_t>(pairing.inconsistent.size());
  MeasureFaces(mesh, pairing.kind, execution, &surface);
  if (seams.hard_edge_degrees > 0) {
    surface.hard_cosine = portable::Cos(seams.hard_edge_degrees * std::numbers::pi / 180);
  }
  surface.kind = seams.kind;
  surface.part = seams.part;
  PLANISH_RETURN_IF_ERROR(CheckSeamsAgainstPolygons(seams, pairing.opposite));
  Cut(surface, seams, &pairing, &surface.crowded_edges);
  const std::shared_ptr<TriMesh> imported(new TriMesh(ImportMesh(mesh, pairing.opposite)));
  surface.mesh = imported;
  for (const std::int32_t c : seams.uncut_corners) {
    const EdgeHandle edge = imported->edge_handle(HalfEdgeOf(*imported, c));
    if (!imported->is_boundary(edge)) imported->data(edge).is_uncut = true;
  }
  for (std::int32_t c = 0; c < static_cast<std::int32_t>(pairing.opposite.size()); ++c) {
    if (!IsDiagonal(seams, pairing.opposite, c)) continue;
    imported->data(imported->edge_handle(HalfEdgeOf(*imported, c))).is_uncut = true;
  }
  const Eigen::VectorXd angles = MeasuredAngles(mesh, execution);
  surface.angle.assign(surface.mesh->n_halfedges(), 0.0);
  for (const FaceHandle f : surface.mesh->faces()) {
    const std::array<HalfedgeHandle, 3> half_edges = HalfEdgesOf(*surface.mesh, f);
    for (int k = 0; k < 3; ++k) surface.angle[half_edges[k].idx()] = angles[3 * f.idx() + k];
  }
  if (execution.IsCancelled()) return absl::CancelledError("cancelled");
  return surface;
}

Surface Rejoin(const Mesh& mesh, const Surface& surface, const std::vector<std::array<std::int32_t, 2>>& pairs) {
  const auto num_corners = static_cast<std::int32_t>(3 * surface.mesh->n_faces());
  std::vector<std::int32_t> opposite(num_corners);
  for (std::int32_t c = 0; c < num_corners; ++c) opposite[c] = CornerAcross(*surface.mesh, c);
  for (const auto& [c, d] : pairs) {
    for (const std::int32_t e : {c, d}) {
      if (opposite[e] >= 0) opposite[opposite[e]] = -1;
    }
    opposite[c] = d;
    opposite[d] = c;
  }
  Surface rejoined = surface;
  const std::shared_ptr<TriMesh> linked(new TriMesh(ImportMesh(mesh, opposite)));
  rejoined.mesh = linked;
  rejoined.angle.assign(linked->n_halfedges(), 0.0);
  for (std::int32_t c = 0; c < num_corners; ++c) {
    const HalfedgeHandle h = HalfEdgeOf(*linked, c), before = HalfEdgeOf(*surface.mesh, c);
    rejoined.angle[h.idx()] = surface.angle[before.idx()];
    linked->data(linked->edge_handle(h)).is_uncut = surface.is_uncut(before);
  }
  return rejoined;
}

}  // namespace planish
