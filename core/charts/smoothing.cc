#include <algorithm>
#include <vector>

#include "core/charts/steps.h"

namespace planish {
namespace {

// The cost of a seam at this edge.
double Cost(const Surface& surface, const AtlasTuning& tuning, HalfedgeHandle h) {
  return surface.length(h) * (1 - (1 - tuning.smoothing_sharp_cost) * std::clamp(1 - surface.bend_cosine(h), 0.0, 1.0));
}

// The single glued half-edge of a face; invalid if there are none or more.
HalfedgeHandle OnlyGlued(const Gluing& gluing, std::int32_t f) {
  HalfedgeHandle only;
  for (const HalfedgeHandle h : HalfEdgesOf(gluing.mesh(), FaceHandle(f))) {
    if (gluing.IsOutline(h)) continue;
    if (only.is_valid()) return HalfedgeHandle();
    only = h;
  }
  return only;
}

// Moves a face with two edges on the outline to the disc across them, if that makes the seam cheaper. Returns whether
// it has moved the face.
bool Move(std::int32_t f, const AtlasTuning& tuning, Gluing* gluing, std::vector<std::int32_t>* chart) {
  constexpr double kGain = 1e-6;
  const Surface& surface = gluing->surface();
  const TriMesh& mesh = gluing->mesh();
  const HalfedgeHandle glued = OnlyGlued(*gluing, f);
  if (!glued.is_valid() || surface.is_uncut(glued)) return false;
  // On the outline `second` follows `first`; on the other side `after` follows `before`.
  const HalfedgeHandle first = gluing->Next(glued), second = gluing->Prev(glued);
  const HalfedgeHandle before = mesh.opposite_halfedge_handle(second), after = mesh.opposite_halfedge_handle(first);
  const std::int32_t to = surface.face_across(second);
  if (to < 0 || mesh.is_boundary(after) || (*chart)[to] < 0 || gluing->After(before) != after) return false;
  if (to == f || surface.face_across(first) == f) return false;
  const HalfedgeHandle next = gluing->After(after), previous = gluing->Before(before);
  if (next == previous) return false;  // would leave an outline of two edges
  const double cost = Cost(surface, tuning, first) + Cost(surface, tuning, second);
  if (!(Cost(surface, tuning, glued) < (1 - kGain) * cost)) return false;
  const std::int32_t neighbour = surface.face_across(glued);
  gluing->Unglue(glued);
  gluing->Glue(first);
  gluing->Glue(second);
  if (gluing->OutlineAngle(glued) > tuning.widest || gluing->OutlineAngle(gluing->Before(glued)) > tuning.widest) {
    gluing->Unglue(first);
    gluing->Unglue(second);
    gluing->Glue(glued);
    return false;
  }
  (*chart)[f] = (*chart)[to];
  // If the face was at the end of a slit, the two sides of the slit may have met.
  if ((*chart)[neighbour] == (*chart)[f]) {
    gluing->Zip(glued);
    if (gluing->IsOutline(previous)) gluing->Zip(previous);
  }
  return true;
}

}  // namespace

void SmoothOutlines(const AtlasTuning& tuning, const Execution& execution, std::vector<std::int32_t> faces,
                    Gluing* gluing, std::vector<std::int32_t>* chart) {
  const Surface& surface = gluing->surface();
  std::erase_if(faces, [&](std::int32_t f) { return !OnlyGlued(*gluing, f).is_valid(); });
  std::vector<std::int32_t> next;
  std::vector<char> queued(surface.num_faces(), 0);
  for (int sweep = 0; sweep < tuning.smoothing_sweeps && !faces.empty() && !execution.IsCancelled(); ++sweep) {
    next.clear();
    for (const std::int32_t f : faces) {
      if (!Move(f, tuning, gluing, chart)) continue;
      for (const HalfedgeHandle h : HalfEdgesOf(*surface.mesh, FaceHandle(f))) {
        const std::int32_t g = surface.face_across(h);
        if (g < 0 || queued[g]) continue;
        queued[g] = 1;
        next.push_back(g);
      }
    }
    for (const std::int32_t f : next) queued[f] = 0;
    std::sort(next.begin(), next.end());
    faces.swap(next);
  }
}

}  // namespace planish
