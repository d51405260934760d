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

namespace {

// The disc that outline half-edge h borders on; -1: none, or its own.
std::int32_t Neighbour(const Gluing& gluing, const std::vector<std::int32_t>& disc, HalfedgeHandle h) {
  const std::int32_t f = gluing.surface().face_across(h);
  return f < 0 || disc[f] == disc[gluing.mesh().face_handle(h).idx()] ? -1 : disc[f];
}

// Whether outline half-edge `next`, which comes after h, goes on with the same stretch.
bool GoesOn(const Gluing& gluing, const std::vector<std::int32_t>& disc, HalfedgeHandle h, HalfedgeHandle next) {
  const std::int32_t other = Neighbour(gluing, disc, h);
  return other >= 0 && Neighbour(gluing, disc, next) == other &&
         gluing.After(gluing.mesh().opposite_halfedge_handle(next)) == gluing.mesh().opposite_halfedge_handle(h);
}

}  // namespace

std::vector<Stretch> StretchesAlong(const Gluing& gluing, const std::vector<std::int32_t>& disc,
                                    const std::vector<HalfedgeHandle>& outline) {
  const auto n = static_cast<std::int32_t>(outline.size());
  const auto goes_on = [&](std::int32_t i) {
    return GoesOn(gluing, disc, outline[i], outline[i + 1 == n ? 0 : i + 1]);
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
    const std::int32_t other = Neighbour(gluing, disc, outline[start]);
    if (other >= 0) stretches.push_back({start, edges, other});
  }
  return stretches;
}

std::vector<HalfedgeHandle> StretchThrough(const Gluing& gluing, const std::vector<std::int32_t>& disc,
                                           HalfedgeHandle h) {
  if (Neighbour(gluing, disc, h) < 0) return {};
  HalfedgeHandle first = h;
  for (HalfedgeHandle before = gluing.Before(first); GoesOn(gluing, disc, before, first);) {
    if (before == h) return {};
    first = before;
    before = gluing.Before(first);
  }
  std::vector<HalfedgeHandle> stretch = {first};
  for (HalfedgeHandle next = gluing.After(first); GoesOn(gluing, disc, stretch.back(), next);
       next = gluing.After(next)) {
    stretch.push_back(next);
  }
  return stretch;
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
