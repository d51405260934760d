// Where two discs may be glued: stretches of their outlines that lie on each other.
#pragma once

#include <array>
#include <cstdint>
#include <vector>

#include "core/charts/gluing.h"

namespace planish {

// The first of these faces' half-edges that is on an outline; invalid if none is.
HalfedgeHandle FirstOnOutline(const Gluing& gluing, const std::vector<std::int32_t>& faces);

// The outline of a disc, from one of its half-edges on.
std::vector<HalfedgeHandle> OutlineFrom(const Gluing& gluing, HalfedgeHandle start);

// A connected stretch along which two discs border on each other, as long as it goes.
struct Stretch {
  std::int32_t begin = 0, edges = 0;  // of the outline that was walked; it may go on from the end to the beginning
  std::int32_t other = -1;            // the disc across
};

// All of them along the outline of a disc, in its order; none where two discs make a sphere. `disc`: per face.
std::vector<Stretch> StretchesAlong(const Gluing& gluing, const std::vector<std::int32_t>& disc,
                                    const std::vector<HalfedgeHandle>& outline);

// The stretch that an outline half-edge is on, from its beginning to its end; none if the half-edge borders on no other
// disc, or if the two discs make a sphere.
std::vector<HalfedgeHandle> StretchThrough(const Gluing& gluing, const std::vector<std::int32_t>& disc,
                                           HalfedgeHandle h);

// What gluing two discs along a stretch has done.
struct Seamed {
  bool is_glued = false;
  std::vector<HalfedgeHandle> glued;  // one of each pair; none unless is_glued
  std::array<HalfedgeHandle, 2> ends = {
      HalfedgeHandle(), HalfedgeHandle()};  // of either disc: what came before the stretch on its outline

  void Undo(Gluing* gluing) const {
    for (const HalfedgeHandle h : glued) gluing->Unglue(h);
  }
};

// Glues `edges` half-edges of an outline, from `first` on, to those across, and zips up what is then next to each
// other. Leaves everything as it was if a vertex of the outline would open wider than `widest`, radians. The two
// outlines must have three edges or more beside the stretch.
Seamed GlueStretch(HalfedgeHandle first, std::int32_t edges, double widest, Gluing* gluing);

}  // namespace planish
