// A mesh as charts see it: which faces take part, where one may go from face to face, and what faces measure.
#pragma once

#include <cstdint>
#include <vector>

#include "core/base/execution.h"
#include "core/mesh/mesh.h"

namespace planish {

// What must not lie inside a chart.
struct GivenSeams {
  std::vector<std::int32_t> corners;  // edges by the corner that faces them, from either side
  // Edges that no other rule may make seams: diagonals of polygons.
  std::vector<std::int32_t> uncut_corners;
  double hard_edge_degrees = 0;  // edges whose faces' normals are further apart than this; 0: none
};

// Constant after construction. Half-edge c = 3 f + k is the one that corner k of face f faces (core/mesh/half_edges.h).
struct Surface {
  const Mesh* mesh = nullptr;  // must outlive the surface

  // Per face: whether it is part of the surface. Not those that name a vertex twice, or whose vertices all
  // lie in one point, which have no inside to map.
  std::vector<char> takes_part;
  // Per face: without area though its vertices differ. Its angles are those of slightly longer edges (see MakeSurface).
  std::vector<char> is_flat;
  // Per half-edge: the one on the other side, -1 where a chart must end: at boundaries and given seams, where more than
  // two faces meet, where two are wound against each other.
  std::vector<std::int32_t> across;
  // Per half-edge: whether it must be glued to the one across. Empty: none must.
  std::vector<char> uncut;
  // Per corner: the angle there, radians, positive; those of a face add up to pi.
  std::vector<double> angle;
  // Per face: area, and area times normal.
  std::vector<double> area;
  std::vector<Vec3> area_normal;

  // Edges at which charts must end, without those of GivenSeams.
  std::int64_t non_manifold_edges = 0;
  std::int64_t clashing_edges = 0;  // of two faces that run round in opposite senses

  bool is_uncut(std::int32_t c) const { return !uncut.empty() && uncut[c]; }
  std::int32_t num_faces() const { return static_cast<std::int32_t>(takes_part.size()); }
  std::int32_t origin(std::int32_t c) const { return mesh->faces[c / 3][Next(c % 3)]; }
  std::int32_t target(std::int32_t c) const { return mesh->faces[c / 3][Prev(c % 3)]; }
  // Of the angle between the normals of the two faces at a half-edge that has one across; 1 where one has no area.
  double bend_cosine(std::int32_t c) const {
    const std::int32_t f = c / 3, g = across[c] / 3;
    const double lengths = area[f] * area[g];
    return lengths > 0 ? area_normal[f].dot(area_normal[g]) / lengths : 1;
  }
  double length(std::int32_t c) const { return (mesh->positions[target(c)] - mesh->positions[origin(c)]).norm(); }
};

// Copies of a face (the same three vertices again, in any order) form layers of their own: the second ones among each
// other, and so on, so that double-sided surfaces come apart in two sheets.
//
// A face without area gets the angles of edges that are longer by a thousandth of its longest edge ("intrinsic
// mollification", Sharp and Crane 2020, but only there): no other angle is changed.
//
// Indices must be in range and positions of used vertices finite. O(F). Of no use after an interrupt.
Surface MakeSurface(const Mesh& mesh, const GivenSeams& seams, const Execution& execution = {});

}  // namespace planish
