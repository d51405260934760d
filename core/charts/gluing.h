// Discs made of faces: which edges of a surface are glued, and walks along a disc's outline.
//
// Every piece is a disc at any time. Two discs glued along one connected border are a disc again, and so is a disc that
// is zipped up from the end of a slit. Nothing else is ever glued, so closed surfaces, handles, holes and one-sided
// surfaces need no special cases: they become discs with seams in the right places.
#pragma once

#include <array>
#include <cstdint>
#include <optional>
#include <span>
#include <utility>
#include <vector>

#include "core/charts/surface.h"
#include "core/charts/tuning.h"
#include "core/mesh/half_edges.h"

namespace planish {

// Which edges are glued. All half-edges here, and in all functions on outlines, have a face. Gluing has the links that
// the walks of core/mesh/half_edges.h need.
class Gluing {
 public:
  // Initially no edge is glued. `surface` must outlive this.
  explicit Gluing(const Surface& surface);

  const Surface& surface() const { return *surface_; }
  const TriMesh& mesh() const { return *surface_->mesh; }
  // Whether the half-edge is on an outline: not glued to its opposite.
  bool IsOutline(HalfedgeHandle h) const { return !is_glued_[h.idx() / 2]; }
  // Whether all edges at a vertex are glued, so that the vertex lies inside of a disc.
  bool IsInside(VertexHandle v) const { return open_edges_[v.idx()] == 0; }

  using HalfEdge = HalfedgeHandle;
  HalfedgeHandle Next(HalfedgeHandle h) const { return mesh().next_halfedge_handle(h); }
  HalfedgeHandle Prev(HalfedgeHandle h) const { return mesh().prev_halfedge_handle(h); }
  // The half-edge glued to h; invalid on an outline.
  HalfedgeHandle Across(HalfedgeHandle h) const {
    return IsOutline(h) ? HalfedgeHandle() : mesh().opposite_halfedge_handle(h);
  }
  static bool IsValid(HalfedgeHandle h) { return h.is_valid(); }

  // The outline half-edge that starts where outline half-edge h ends, and the one that ends where h starts.
  HalfedgeHandle After(HalfedgeHandle h) const { return NextOnBoundary(*this, h); }
  HalfedgeHandle Before(HalfedgeHandle h) const { return PreviousOnBoundary(*this, h); }

  // Sum of the angles of the faces round the vertex where outline half-edge h ends, radians.
  double OutlineAngle(HalfedgeHandle h) const;
  // Whether a slit ends where outline half-edge h ends.
  bool IsTip(HalfedgeHandle h) const { return After(h) == mesh().opposite_halfedge_handle(h); }
  // Whether OutlineAngle(h) is above the limit for its vertex.
  bool IsTooWide(HalfedgeHandle h, const WidestAngles& widest) const {
    return OutlineAngle(h) > (IsTip(h) ? widest.tip : widest.vertex);
  }

  // Glues h to its opposite, which must have a face.
  void Glue(HalfedgeHandle h) { SetGlued(h, 1); }
  void Unglue(HalfedgeHandle h) { SetGlued(h, 0); }

  // If outline half-edges h and After(h) are the two sides of one edge, glues them, and continues with the half-edges
  // that are then adjacent. Ends before the outline has fewer than three edges. Appends one half-edge of each glued
  // pair to `glued`, unless null.
  void Zip(HalfedgeHandle h, std::vector<HalfedgeHandle>* glued = nullptr);

 private:
  void SetGlued(HalfedgeHandle h, char is_glued) {
    const std::int32_t opens = std::exchange(is_glued_[h.idx() / 2], is_glued) - is_glued;
    open_edges_[mesh().from_vertex_handle(h).idx()] += opens;
    open_edges_[mesh().to_vertex_handle(h).idx()] += opens;
  }

  const Surface* surface_;
  std::vector<char> is_glued_;            // per edge
  std::vector<std::int32_t> open_edges_;  // per vertex: the number of its edges that are not glued
};

// The mesh of the chart with these faces, ascending, which are all or some faces of one disc: face i is faces[i].
// Vertices are numbered in the order of their lowest corners. `slits` gets pairs of corners, ascending, that face the
// same edge of the surface from both sides of a slit, where the chart's outline meets itself. `place`, per face of the
// surface, gets the index of each face in the chart; entries of other faces are not used. O(n) in the faces.
FlatMesh ChartMesh(const Gluing& gluing, const std::vector<std::int32_t>& faces, std::vector<std::int32_t>* place,
                   std::vector<std::pair<std::int32_t, std::int32_t>>* slits);

// ---- Borders: where the outlines of two discs coincide, so that they may be glued.

// The first half-edge of these faces on an outline; invalid if there is none.
HalfedgeHandle FirstOnOutline(const Gluing& gluing, const std::vector<std::int32_t>& faces);

// The outline of a disc, beginning with one of its half-edges.
std::vector<HalfedgeHandle> OutlineFrom(const Gluing& gluing, HalfedgeHandle start);

// A maximal connected run of edges that the outlines of two discs share.
struct Border {
  std::span<const HalfedgeHandle> half_edges;  // on the outline of the first disc, in its order
  std::int32_t other = -1;                     // the disc across
};

// All borders along the outline of a disc, in its order; none if two discs form a sphere. Rotates `outline` so that it
// begins with a border. `disc`: per face.
std::vector<Border> BordersAlong(const Gluing& gluing, const std::vector<std::int32_t>& disc,
                                 std::vector<HalfedgeHandle>* outline);

// The whole border that an outline half-edge is on; empty if there is no other disc across, or if the two discs form a
// sphere.
std::vector<HalfedgeHandle> BorderThrough(const Gluing& gluing, const std::vector<std::int32_t>& disc,
                                          HalfedgeHandle h);

// The result of gluing two discs along a border.
struct GluedBorder {
  std::vector<HalfedgeHandle> glued;   // one half-edge of each glued pair
  std::array<HalfedgeHandle, 2> ends;  // for each disc: the half-edge before the border on its outline

  void Undo(Gluing* gluing) const {
    for (const HalfedgeHandle h : glued) gluing->Unglue(h);
  }
};

// Glues `edges` half-edges of an outline, from `first` on, to their opposites. If it `zips`, half-edges that are then
// adjacent are zipped up; otherwise the rest of the border becomes a slit. Returns nullopt, and changes nothing, if the
// angle at an end of the border would be too wide. The two outlines must have three or more edges in all beside the
// border.
std::optional<GluedBorder> GlueBorder(HalfedgeHandle first, std::int32_t edges, const WidestAngles& widest, bool zips,
                                      Gluing* gluing);

}  // namespace planish
