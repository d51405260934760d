#include "core/charts/joints.h"

namespace planish {

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
  HalfedgeHandle h = start;
  do {
    outline.push_back(h);
    h = gluing.After(h);
  } while (h != start);
  return outline;
}

std::vector<Stretch> StretchesAlong(const Gluing& gluing, const std::vector<std::int32_t>& disc, std::int32_t d,
                                    const std::vector<HalfedgeHandle>& outline) {
  const TriMesh& mesh = gluing.mesh();
  const auto n = static_cast<std::int32_t>(outline.size());
  const auto neighbour = [&](std::int32_t i) {
    const std::int32_t f = gluing.surface().face_across(outline[i]);
    return f < 0 || disc[f] == d ? -1 : disc[f];
  };
  // Whether half-edge i + 1 of the outline goes on with the same stretch as half-edge i.
  const auto goes_on = [&](std::int32_t i) {
    const std::int32_t next = i + 1 == n ? 0 : i + 1;
    return neighbour(i) >= 0 && neighbour(next) == neighbour(i) &&
           gluing.After(mesh.opposite_halfedge_handle(outline[next])) == mesh.opposite_halfedge_handle(outline[i]);
  };
  std::int32_t begin = 0;
  while (begin < n && goes_on(begin == 0 ? n - 1 : begin - 1)) ++begin;
  std::vector<Stretch> stretches;
  if (begin == n) return stretches;
  for (std::int32_t done = 0; done < n;) {
    const std::int32_t start = (begin + done) % n;
    std::int32_t edges = 1;
    while (edges < n && goes_on((start + edges - 1) % n)) ++edges;
    done += edges;
    if (neighbour(start) >= 0) stretches.push_back({start, edges, neighbour(start)});
  }
  return stretches;
}

Seamed GlueStretch(HalfedgeHandle first, std::int32_t edges, double widest, Gluing* gluing) {
  Seamed seamed;
  // What is next to the stretch on the outlines, before it is glued.
  HalfedgeHandle h = first;
  const HalfedgeHandle before = gluing->Before(h);
  for (std::int32_t i = 0; i < edges; ++i, h = gluing->After(h)) seamed.glued.push_back(h);
  seamed.ends = {before, gluing->Before(gluing->mesh().opposite_halfedge_handle(seamed.glued.back()))};
  for (const HalfedgeHandle g : seamed.glued) gluing->Glue(g);
  for (const HalfedgeHandle e : seamed.ends) {
    if (gluing->IsOutline(e)) gluing->Zip(e, &seamed.glued);
  }
  for (const HalfedgeHandle e : seamed.ends) {
    if (!gluing->IsOutline(e) || gluing->OutlineAngle(e) <= widest) continue;
    seamed.Undo(gluing);
    return Seamed();
  }
  seamed.is_glued = true;
  return seamed;
}

}  // namespace planish
