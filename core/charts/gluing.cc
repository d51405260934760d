#include "core/charts/gluing.h"

#include <algorithm>

namespace planish {

Gluing::Gluing(const Surface& surface)
    : surface_(&surface), is_glued_(surface.mesh->n_edges(), 0), open_edges_(surface.mesh->n_vertices(), 0) {
  for (std::size_t h = 0; h < surface.mesh->n_halfedges(); ++h) {
    ++open_edges_[surface.mesh->to_vertex_handle(HalfedgeHandle(static_cast<int>(h))).idx()];
  }
}

double Gluing::OutlineAngle(HalfedgeHandle h) const {
  double angle = 0;
  ForEachInFan(*this, Prev(h), [&](HalfedgeHandle facing) { angle += surface_->angle[facing.idx()]; });
  return angle;
}

void Gluing::Zip(HalfedgeHandle h, std::vector<HalfedgeHandle>* glued) {
  for (;;) {
    const HalfedgeHandle after = After(h);
    if (mesh().opposite_halfedge_handle(h) != after) return;
    const HalfedgeHandle before = Before(h), next = After(after);
    // Zipping an outline of three or four edges would leave one or two.
    if (next == before || After(next) == before) return;
    Glue(h);
    if (glued != nullptr) glued->push_back(h);
    h = before;
  }
}

namespace {

// The disc across outline half-edge h; -1 if there is none, or if it is h's own disc.
std::int32_t Neighbour(const Gluing& gluing, const std::vector<std::int32_t>& disc, HalfedgeHandle h) {
  const std::int32_t f = gluing.surface().face_across(h);
  return f < 0 || disc[f] == disc[gluing.mesh().face_handle(h).idx()] ? -1 : disc[f];
}

// Whether outline half-edge `next`, which follows h, belongs to the same border.
bool GoesOn(const Gluing& gluing, const std::vector<std::int32_t>& disc, HalfedgeHandle h, HalfedgeHandle next) {
  const std::int32_t other = Neighbour(gluing, disc, h);
  return other >= 0 && Neighbour(gluing, disc, next) == other &&
         gluing.After(gluing.mesh().opposite_halfedge_handle(next)) == gluing.mesh().opposite_halfedge_handle(h);
}

}  // namespace

FlatMesh ChartMesh(const Gluing& gluing, const std::vector<std::int32_t>& faces, std::vector<std::int32_t>* place,
                   std::vector<std::pair<std::int32_t, std::int32_t>>* slits) {
  const TriMesh& mesh = gluing.mesh();
  const auto num_faces = static_cast<std::int32_t>(faces.size());
  place->resize(gluing.surface().num_faces(), 0);
  for (std::int32_t i = 0; i < num_faces; ++i) (*place)[faces[i]] = i;
  FlatMesh chart;
  chart.opposite.assign(3 * faces.size(), -1);
  for (std::int32_t i = 0; i < num_faces; ++i) {
    const std::array<HalfedgeHandle, 3> half_edges = HalfEdgesOf(mesh, FaceHandle(faces[i]));
    for (int k = 0; k < 3; ++k) {
      const HalfedgeHandle across = mesh.opposite_halfedge_handle(half_edges[k]);
      if (mesh.is_boundary(across)) continue;
      const std::int32_t c = CornerOf(mesh, across);
      const std::int32_t other = (*place)[c / 3];
      if (other >= num_faces || faces[other] != c / 3) continue;
      if (!gluing.IsOutline(half_edges[k])) {
        chart.opposite[3 * i + k] = 3 * other + c % 3;
      } else if (i < other || (i == other && k < c % 3)) {
        slits->emplace_back(3 * i + k, 3 * other + c % 3);
      }
    }
  }
  chart.faces = FacesOfFans(chart.opposite, [&](std::int32_t c) {
    chart.positions.push_back(mesh.point(VerticesOf(mesh, FaceHandle(faces[c / 3]))[c % 3]));
  });
  return chart;
}

HalfedgeHandle FirstOnOutline(const Gluing& gluing, const std::vector<std::int32_t>& faces) {
  for (const std::int32_t f : faces) {
    for (const HalfedgeHandle h : HalfEdgesOf(gluing.mesh(), FaceHandle(f))) {
      if (gluing.IsOutline(h)) return h;
    }
  }
  return HalfedgeHandle();
}

std::vector<HalfedgeHandle> OutlineFrom(const Gluing& gluing, HalfedgeHandle start) {
  std::vector<HalfedgeHandle> outline;
  ForEachOnLoop(gluing, start, [&](HalfedgeHandle h) { outline.push_back(h); });
  return outline;
}

std::vector<Border> BordersAlong(const Gluing& gluing, const std::vector<std::int32_t>& disc,
                                 std::vector<HalfedgeHandle>* outline) {
  const std::size_t n = outline->size();
  std::vector<HalfedgeHandle>& h = *outline;
  std::size_t begin = 0;
  while (begin < n && GoesOn(gluing, disc, h[begin == 0 ? n - 1 : begin - 1], h[begin])) ++begin;
  if (begin == n) return {};
  std::rotate(h.begin(), h.begin() + static_cast<std::ptrdiff_t>(begin), h.end());
  std::vector<Border> borders;
  for (std::size_t start = 0, end = 0; start < n; start = end) {
    for (end = start + 1; end < n && GoesOn(gluing, disc, h[end - 1], h[end]);) ++end;
    const std::int32_t other = Neighbour(gluing, disc, h[start]);
    if (other >= 0) borders.push_back({std::span(h).subspan(start, end - start), other});
  }
  return borders;
}

std::vector<HalfedgeHandle> BorderThrough(const Gluing& gluing, const std::vector<std::int32_t>& disc,
                                          HalfedgeHandle h) {
  if (Neighbour(gluing, disc, h) < 0) return {};
  HalfedgeHandle first = h;
  for (HalfedgeHandle before = gluing.Before(first); GoesOn(gluing, disc, before, first);) {
    if (before == h) return {};
    first = before;
    before = gluing.Before(first);
  }
  std::vector<HalfedgeHandle> border = {first};
  for (HalfedgeHandle next = gluing.After(first); GoesOn(gluing, disc, border.back(), next);
       next = gluing.After(next)) {
    border.push_back(next);
  }
  return border;
}

std::optional<GluedBorder> GlueBorder(HalfedgeHandle first, std::int32_t edges, const WidestAngles& widest, bool zips,
                                      Gluing* gluing) {
  GluedBorder border;
  // Lists the half-edges of the border before they are glued, since After() does not find them afterwards.
  HalfedgeHandle h = first;
  const HalfedgeHandle before = gluing->Before(h);
  for (std::int32_t i = 0; i < edges; ++i, h = gluing->After(h)) border.glued.push_back(h);
  border.ends = {before, gluing->Before(gluing->mesh().opposite_halfedge_handle(border.glued.back()))};
  for (const HalfedgeHandle g : border.glued) gluing->Glue(g);
  for (const HalfedgeHandle e : border.ends) {
    if (zips && gluing->IsOutline(e)) gluing->Zip(e, &border.glued);
  }
  for (const HalfedgeHandle e : border.ends) {
    if (!gluing->IsOutline(e) || !gluing->IsTooWide(e, widest)) continue;
    border.Undo(gluing);
    return std::nullopt;
  }
  return border;
}

}  // namespace planish
