#include "core/charts/seam_cost.h"

#include <algorithm>
#include <cmath>

#include "core/mesh/visibility.h"

namespace planish {
namespace {

// Whether an edge is probably the diagonal of a quad: the longest edge of both faces, which are nearly coplanar and
// form corners of nearly right angles.
bool IsLikelyDiagonal(const Surface& surface, HalfedgeHandle h) {
  constexpr double kFlat = 0.9, kLeast = 1.1, kMost = 2.05;  // a cosine; radians
  const TriMesh& mesh = *surface.mesh;
  const HalfedgeHandle o = mesh.opposite_halfedge_handle(h);
  if (surface.bend_cosine(h) < kFlat) return false;
  const auto angle = [&](HalfedgeHandle facing) { return surface.angle[facing.idx()]; };
  const auto is_right = [&](double a) { return a > kLeast && a < kMost; };
  // The corners at the ends of the diagonal have an angle in either face; these half-edges face them.
  const HalfedgeHandle a = mesh.next_halfedge_handle(h), b = mesh.prev_halfedge_handle(h);
  const HalfedgeHandle c = mesh.next_halfedge_handle(o), d = mesh.prev_halfedge_handle(o);
  return is_right(angle(h)) && is_right(angle(o)) && is_right(angle(a) + angle(d)) && is_right(angle(b) + angle(c));
}

}  // namespace

SeamCost::SeamCost(const Surface& surface, const std::vector<float>& visibility, const AtlasTuning& tuning,
                   const Execution& execution)
    : surface_(surface), tuning_(tuning), cost_(surface.mesh->n_edges(), 0.0F) {
  for (std::int32_t f = 0; f < surface.num_faces(); ++f) area_ += surface.area[f];
  if (!(area_ > 0)) area_ = 1;
  side_ = std::sqrt(area_);
  const TriMesh& mesh = *surface.mesh;
  execution.ForEach(static_cast<std::int64_t>(mesh.n_edges()), [&](std::int64_t e) {
    const HalfedgeHandle h = mesh.halfedge_handle(EdgeHandle(static_cast<int>(e)), 0);
    const std::int32_t f = mesh.face_handle(h).idx(), g = surface.face_across(h);
    if (g < 0) return;
    const double seen = EdgeVisibility(visibility, f, g);
    // Twice the sine of half the angle between the normals: 1 at 60 degrees.
    const double bend = std::min(1.0, 2 * std::sqrt(std::max(0.0, (1 - surface.bend_cosine(h)) / 2)));
    const Vec3 apex = mesh.point(mesh.to_vertex_handle(mesh.next_halfedge_handle(mesh.opposite_halfedge_handle(h))));
    const bool is_valley = surface.area_normal[f].dot(apex - mesh.point(mesh.to_vertex_handle(h))) > 0;
    const double crease = 1 - bend * (is_valley ? tuning.valley_discount : tuning.ridge_discount);
    const double diagonal = IsLikelyDiagonal(surface, h) ? tuning.diagonal_cost : 1;
    cost_[e] = static_cast<float>(surface.length(h) * (tuning.hidden_cost + (1 - tuning.hidden_cost) * seen) * crease *
                                  diagonal / side_);
  });
}

double SeamCost::OfTurn(HalfedgeHandle h, HalfedgeHandle next) const {
  const TriMesh& mesh = *surface_.mesh;
  const Vec3& at = mesh.point(mesh.to_vertex_handle(h));
  const Vec3 before = at - mesh.point(mesh.from_vertex_handle(h)), after = mesh.point(mesh.to_vertex_handle(next)) - at;
  const double lengths = before.norm() * after.norm();
  const double turned = lengths > 0 ? 1 - before.dot(after) / lengths : 0;
  return tuning_.turn_cost * turned * (OfEdge(h) + OfEdge(next)) / 2;
}

double SeamCost::OfPath(std::span<const HalfedgeHandle> path) const {
  double cost = 0;
  for (std::size_t i = 0; i < path.size(); ++i) {
    cost += OfEdge(path[i]) + (i + 1 < path.size() ? OfTurn(path[i], path[i + 1]) : 0);
  }
  return cost;
}

}  // namespace planish
