// Discs made of faces: which edges of a surface are glued, and the way along a disc's outline.
//
// Every piece is a disc at any time. Two discs glued along one connected border are a disc again, and so is one that is
// zipped up from the end of a slit. Nothing else is ever glued, so closed surfaces, handles, holes and one-sided
// surfaces need no cases of their own: they end as discs with seams in the right places.
#pragma once

#include <array>
#include <cstdint>
#include <optional>
#include <span>
#include <utility>
#include <vector>

#include "core/charts/surface.h"
#include "core/mesh/half_edges.h"

namespace planish {

// Half-edges have a face, here and in all that goes along outlines. Links for the walks of core/mesh/half_edges.h.
class Gluing {
 public:
  // Every face by itself. `surface` must outlive this.
  explicit Gluing(const Surface& surface);

  const Surface& surface() const { return *surface_; }
  const TriMesh& mesh() const { return *surface_->mesh; }
  // Whether the half-edge is on an outline: not glued to the one across.
  bool IsOutline(HalfedgeHandle h) const { return !is_glued_[h.idx() / 2]; }
  // Whether all edges at a vertex are glued, so that the vertex lies inside of a disc.
  bool IsInside(VertexHandle v) const { return open_edges_[v.idx()] == 0; }

  using HalfEdge = HalfedgeHandle;
  HalfedgeHandle Next(HalfedgeHandle h) const { return mesh().next_halfedge_handle(h); }
  HalfedgeHandle Prev(HalfedgeHandle h) const { return mesh().prev_halfedge_handle(h); }
  // The half-edge that h is glued to; invalid on an outline.
  HalfedgeHandle Across(HalfedgeHandle h) const {
    return IsOutline(h) ? HalfedgeHandle() : mesh().opposite_halfedge_handle(h);
  }
  static bool IsValid(HalfedgeHandle h) { return h.is_valid(); }

  // The outline half-edge that starts where outline half-edge h ends, and the one that ends where it starts.
  HalfedgeHandle After(HalfedgeHandle h) const { return NextOnBoundary(*this, h); }
  HalfedgeHandle Before(HalfedgeHandle h) const { return PreviousOnBoundary(*this, h); }

  // Sum of the angles of the faces round the vertex where outline half-edge h ends, radians.
  double OutlineAngle(HalfedgeHandle h) const;

  // Glues h, which must have a face across, to the half-edge there.
  void Glue(HalfedgeHandle h) { SetGlued(h, 1); }
  void Unglue(HalfedgeHandle h) { SetGlued(h, 0); }

  // Glues outline half-edges h and After(h) if they are the two sides of one edge, and goes on with what is then next
  // to each other; leaves an outline of at least three edges. Those glued are appended to `glued` (null: nowhere), one
  // of each pair.
  void Zip(HalfedgeHandle h, std::vector<HalfedgeHandle>* glued = nullptr);

 private:
  void SetGlued(HalfedgeHandle h, char is_glued) {
    const std::int32_t opens = std::exchange(is_glued_[h.idx() / 2], is_glued) - is_glued;
    open_edges_[mesh().from_vertex_handle(h).idx()] += opens;
    open_edges_[mesh().to_vertex_handle(h).idx()] += opens;
  }

  const Surface* surface_;
  std::vector<char> is_glued_;            // per edge
  std::vector<std::int32_t> open_edges_;  // per vertex: of its edges, those that are not glued
};

// The mesh of a chart, these faces (ascending) of one of the discs: face i is faces[i]. Its vertices are numbered in
// the order of their lowest corners. `slits` gets the corners that face the same edge of the surface from either side
// of a slit, where the chart's outline meets itself: pairs, ascending. `place`, per face of the surface, gets the
// number of each face in the chart; what is there for other faces does not matter. O(n) in the faces.
FlatMesh ChartMesh(const Gluing& gluing, const std::vector<std::int32_t>& faces, std::vector<std::int32_t>* place,
                   std::vector<std::pair<std::int32_t, std::int32_t>>* slits);

// ---- Where two discs may be glued: borders, along which their outlines lie on each other.

// The first of these faces' half-edges that is on an outline; invalid if none is.
HalfedgeHandle FirstOnOutline(const Gluing& gluing, const std::vector<std::int32_t>& faces);

// The outline of a disc, from one of its half-edges on.
std::vector<HalfedgeHandle> OutlineFrom(const Gluing& gluing, HalfedgeHandle start);

// A connected run of edges that the outlines of two discs share, as long as it goes.
struct Border {
  std::span<const HalfedgeHandle> half_edges;  // of the outline that was walked, in its order
  std::int32_t other = -1;                     // the disc across
};

// All borders along the outline of a disc, in its order; none where two discs make a sphere. The outline is made to
// begin where a border does. `disc`: per face.
std::vector<Border> BordersAlong(const Gluing& gluing, const std::vector<std::int32_t>& disc,
                                 std::vector<HalfedgeHandle>* outline);

// The border that an outline half-edge is on, from its beginning to its end; none if the half-edge borders on no other
// disc, or if the two discs make a sphere.
std::vector<HalfedgeHandle> BorderThrough(const Gluing& gluing, const std::vector<std::int32_t>& disc,
                                          HalfedgeHandle h);

// What gluing two discs along a border has done.
struct GluedBorder {
  std::vector<HalfedgeHandle> glued;   // one of each pair
  std::array<HalfedgeHandle, 2> ends;  // of either disc: what came before the border on its outline

  void Undo(Gluing* gluing) const {
    for (const HalfedgeHandle h : glued) gluing->Unglue(h);
  }
};

// Glues `edges` half-edges of an outline, from `first` on, to those across, and zips up what is then next to each
// other. Leaves everything as it was, and returns nothing, if a vertex of the outline would open wider than `widest`,
// radians. The two outlines must have three edges or more beside the border.
std::optional<GluedBorder> GlueBorder(HalfedgeHandle first, std::int32_t edges, double widest, Gluing* gluing);

}  // namespace planish
