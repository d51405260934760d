// A mesh as charts see it: which faces take part, where one may go from face to face, and what faces measure.
#pragma once

#include <array>
#include <cstdint>
#include <memory>
#include <vector>

#include "absl/status/statusor.h"
#include "core/base/execution.h"
#include "core/mesh/tri_mesh.h"

namespace planish {

// What must not lie inside a chart.
struct GivenSeams {
  std::vector<std::int32_t> corners;  // edges by the corner that faces them, from either side
  // Edges that no other rule may make seams.
  std::vector<std::int32_t> uncut_corners;
  double hard_edge_degrees = 0;         // edges whose faces' normals are further apart than this; 0: none
  std::vector<char> kind = {};          // per face: edges between faces of different kinds; empty: none
  std::vector<std::int32_t> part = {};  // per face: edges between different parts, uncut or not; empty: none
  // Per face: its polygon. Diagonals are uncut (PairHalfEdges() in core/mesh/import.h); empty: every face is a polygon.
  std::vector<std::int32_t> polygon = {};
};

// Constant after construction.
struct Surface {
  // The import of the caller's mesh, face by face. Charts must end at its boundary: at boundaries of the caller's mesh,
  // at given seams, and where faces are wound against each other. Of more than two faces at an edge the flattest pairs
  // are joined; charts must end between the others. Never null.
  std::shared_ptr<const TriMesh> mesh;
  // Per face: whether it is part of the surface. Faces that name a vertex twice, or whose three corners coincide, are
  // not: there is nothing to map.
  std::vector<char> takes_part;
  // Per face: without area though its vertices differ. Its angles are those of slightly longer edges
  // (MeasuredAngles()).
  std::vector<char> is_flat;
  // Per half-edge: the angle at the corner that it faces, radians, positive; those of a face add up to pi.
  std::vector<double> angle;
  // Per face: area, and area times normal.
  std::vector<double> area;
  std::vector<Vec3> area_normal;

  // Edges of more than two faces: the half-edges, by corner, that no given seam parts. Any two of different directions
  // may be joined (MayJoin(), Rejoin()).
  std::vector<std::vector<std::int32_t>> crowded_edges;
  double hard_cosine = -2;         // of GivenSeams::hard_edge_degrees; -2: no edge is hard
  std::vector<char> kind;          // GivenSeams::kind
  std::vector<std::int32_t> part;  // GivenSeams::part

  std::int64_t non_manifold_edges = 0;  // of more than two faces
  std::int64_t clashing_edges = 0;      // of two faces that run round in opposite senses

  std::int32_t num_faces() const { return static_cast<std::int32_t>(takes_part.size()); }
  // The face across a half-edge, -1 where a chart must end.
  std::int32_t face_across(HalfedgeHandle h) const {
    return mesh->face_handle(mesh->opposite_halfedge_handle(h)).idx();
  }
  // Whether a half-edge must be glued to the one across.
  bool is_uncut(HalfedgeHandle h) const { return mesh->data(mesh->edge_handle(h)).is_uncut; }
  // Of the angle between the normals of the two faces at a half-edge that has one across; 1 where one has no area.
  double bend_cosine(HalfedgeHandle h) const { return bend_cosine(mesh->face_handle(h).idx(), face_across(h)); }
  double bend_cosine(std::int32_t f, std::int32_t g) const {
    const double lengths = area[f] * area[g];
    return lengths > 0 ? area_normal[f].dot(area_normal[g]) / lengths : 1;
  }
  // Whether the given seams let two faces be neighbours.
  bool MayJoin(std::int32_t f, std::int32_t g) const;
  double length(HalfedgeHandle h) const {
    return (mesh->point(mesh->to_vertex_handle(h)) - mesh->point(mesh->from_vertex_handle(h))).norm();
  }
};

// Copies of a face form layers of their own (Pairing::layer). INVALID_ARGUMENT: Diagnosis::Refusal()
// (core/mesh/diagnosis.h); OPTIONS_INVALID for a given seam that is a diagonal. CANCELLED after a cancellation. O(F).
absl::StatusOr<Surface> MakeSurface(const Mesh& mesh, const GivenSeams& seams, const Execution& execution = {});

// The same faces with other neighbours: each of these pairs of half-edges, by corner, is joined, and what one of them
// was joined to is left without a neighbour. The two of a pair lie on one edge, in different directions. `mesh` is what
// MakeSurface() took. O(F).
Surface Rejoin(const Mesh& mesh, const Surface& surface, const std::vector<std::array<std::int32_t, 2>>& pairs);

}  // namespace planish
