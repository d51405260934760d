// The surface that is cut into charts: its faces, their sizes, and which of them are neighbours.
#pragma once

#include <array>
#include <cstdint>
#include <memory>
#include <vector>

#include "absl/status/statusor.h"
#include "core/base/execution.h"
#include "core/mesh/tri_mesh.h"

namespace planish {

// Constraints on charts.
struct GivenSeams {
  std::vector<std::int32_t> corners;  // seams, given by the corner that faces the edge, from either side
  // Edges at which no other rule may place seams.
  std::vector<std::int32_t> uncut_corners;
  double hard_edge_degrees = 0;         // edges whose faces' normals differ by more are seams; 0: none
  std::vector<char> kind = {};          // per face: edges between different kinds are seams; empty: none
  std::vector<std::int32_t> part = {};  // per face: edges between different parts are seams, even uncut ones
  // Per face: its polygon, whose diagonals are uncut (PairHalfEdges() in core/mesh/import.h); empty: every face is a
  // polygon.
  std::vector<std::int32_t> polygon = {};
};

// Constant after construction.
struct Surface {
  // The import of the caller's mesh, face by face. Charts end at its boundary: at boundaries of the caller's mesh, at
  // given seams, and between faces of opposite orientation. At an edge of more than two faces the flattest pairs are
  // joined; charts end between the others. Never null.
  std::shared_ptr<const TriMesh> mesh;
  // Per face: whether it is part of the surface. Faces that repeat a vertex, or whose three corners coincide, are not,
  // since they cannot be mapped.
  std::vector<char> takes_part;
  // Per face: whether it has different vertices but no area. Its angles are those of slightly longer edges
  // (MeasuredAngles()).
  std::vector<char> is_flat;
  // Per half-edge: the angle at the corner that faces it, radians, positive. The angles of a face add up to pi.
  std::vector<double> angle;
  // Per face: area, and area times normal.
  std::vector<double> area;
  std::vector<Vec3> area_normal;

  // Edges of more than two faces: their half-edges, by corner, that no given seam separates. Any two of opposite
  // directions may be joined (MayJoin(), Rejoin()).
  std::vector<std::vector<std::int32_t>> crowded_edges;
  double hard_cosine = -2;         // cosine of GivenSeams::hard_edge_degrees; -2: no edge is hard
  std::vector<char> kind;          // GivenSeams::kind
  std::vector<std::int32_t> part;  // GivenSeams::part

  std::int64_t non_manifold_edges = 0;  // of more than two faces
  std::int64_t clashing_edges = 0;      // of two faces with opposite orientations

  std::int32_t num_faces() const { return static_cast<std::int32_t>(takes_part.size()); }
  // The face across a half-edge, -1 if a chart must end there.
  std::int32_t face_across(HalfedgeHandle h) const {
    return mesh->face_handle(mesh->opposite_halfedge_handle(h)).idx();
  }
  // Whether a half-edge is inside a polygon or given as uncut, so that it must be glued to its opposite.
  bool is_uncut(HalfedgeHandle h) const { return mesh->data(mesh->edge_handle(h)).is_uncut; }
  // Cosine of the angle between the normals of the two faces at an inner edge; 1 if one of them has no area.
  double bend_cosine(HalfedgeHandle h) const { return bend_cosine(mesh->face_handle(h).idx(), face_across(h)); }
  double bend_cosine(std::int32_t f, std::int32_t g) const {
    const double lengths = area[f] * area[g];
    return lengths > 0 ? area_normal[f].dot(area_normal[g]) / lengths : 1;
  }
  // Whether the given seams allow two faces to be neighbours.
  bool MayJoin(std::int32_t f, std::int32_t g) const;
  double length(HalfedgeHandle h) const {
    return (mesh->point(mesh->to_vertex_handle(h)) - mesh->point(mesh->from_vertex_handle(h))).norm();
  }
};

// Makes the surface of a mesh. Copies of a face form separate layers (Pairing::layer). INVALID_ARGUMENT:
// Diagnosis::Refusal() (core/mesh/diagnosis.h); OPTIONS_INVALID for a given seam that is a diagonal. CANCELLED after a
// cancellation. O(F).
absl::StatusOr<Surface> MakeSurface(const Mesh& mesh, const GivenSeams& seams, const Execution& execution = {});

// Returns `surface` with other neighbours: joins each of these pairs of half-edges, given by corner; former neighbours
// of these half-edges become unjoined. Both half-edges of a pair must be on one edge, in opposite directions. `mesh` is
// the argument of MakeSurface(). O(F).
Surface Rejoin(const Mesh& mesh, const Surface& surface, const std::vector<std::array<std::int32_t, 2>>& pairs);

}  // namespace planish
