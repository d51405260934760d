// The report of an import (core/mesh/import.h): the properties of a triangle mesh and all of its faults.
#pragma once

#include <array>
#include <cstdint>
#include <map>
#include <string>
#include <vector>

#include "absl/status/statusor.h"
#include "core/base/execution.h"
#include "core/mesh/mesh.h"

namespace planish {

// How many elements of each kind a diagnosis lists.
inline constexpr std::size_t kMaxDiagnosed = 16;

// Elements of one kind: their number, and the first of their 0-based ids, ascending.
struct ElementList {
  std::int64_t count = 0;
  std::vector<std::int64_t> first;
};

// Edges of one kind, by their vertex ids (the smaller one first), ascending; and the faces at the listed edges, edge by
// edge.
struct EdgeList {
  std::int64_t count = 0;
  std::vector<std::array<std::int64_t, 2>> first;
  std::vector<std::int64_t> faces;
};

// A connected component of the surface: faces connected over edges of exactly two faces, whichever way these are wound,
// after cutting along non-manifold edges and through non-manifold vertices.
struct Component {
  std::int64_t first_face = 0;
  std::int64_t faces = 0;
  std::int64_t boundary_loops = 0;
  std::int64_t boundary_edges = 0;  // on these loops, both sides of cuts included
  std::int64_t euler_characteristic = 0;
  // Whether reversing some faces makes all orientations agree. Then euler_characteristic = 2 - 2 handles -
  // boundary_loops, otherwise 2 - crosscaps - boundary_loops.
  bool orientable = true;
  std::int64_t handles = 0;    // the genus; 0 if not orientable
  std::int64_t crosscaps = 0;  // 0 if orientable

  bool IsDisc() const { return euler_characteristic == 1 && boundary_loops == 1; }
};

struct Diagnosis {
  std::int64_t vertices = 0;
  std::int64_t faces = 0;

  // ---- Faults of single elements.
  // A face has at most one of these four faults, the first that applies.
  ElementList faces_out_of_range;        // refer to a vertex that does not exist
  ElementList faces_repeating_a_vertex;  // name the same vertex twice
  ElementList faces_not_finite;          // have a corner at NaN or infinity
  ElementList faces_without_area;        // IsDegenerateTriangle (core/mesh/angles.h), on three different vertices
  // Faces with the same three vertices as an earlier face, in any order. Faces in range count, whatever other faults
  // they have.
  ElementList duplicate_faces;
  ElementList vertices_not_finite;  // used by a face, with NaN or infinity in their position
  ElementList isolated_vertices;    // used by no face; out-of-range faces do not count
  ElementList coincident_vertices;  // at the position of a vertex with a smaller id (0 equals -0, NaN nothing)
  ElementList needles;              // faces with area and an angle below one degree

  // ---- The surface: faces with area, without copies (a face at NaN or infinity counts as having area).
  std::int64_t surface_faces = 0;
  std::int64_t edges = 0;
  std::int64_t boundary_edges = 0;    // with one face
  EdgeList non_manifold_edges;        // with more than two faces
  EdgeList inconsistent_edges;        // with two faces that run along the edge in the same direction
  ElementList non_manifold_vertices;  // whose faces form several fans once non-manifold edges are cut
  // Pieces that remain when inconsistent edges are cut as well. Within each, all orientations agree.
  std::int64_t oriented_pieces = 0;
  std::vector<Component> components;  // ascending by first face

  // ---- Geometry of the surface's finite faces; zeros without such faces.
  double area = 0;
  double angle_min_degrees = 0;
  double angle_max_degrees = 0;
  Vec3 box_min = Vec3::Zero();  // of the vertices with a face
  Vec3 box_max = Vec3::Zero();

  std::int64_t Sum(std::int64_t Component::*number) const;  // over the components
  std::int64_t boundary_loops() const { return Sum(&Component::boundary_loops); }
  std::int64_t euler_characteristic() const { return Sum(&Component::euler_characteristic); }
  std::int64_t handles() const { return Sum(&Component::handles); }
  bool is_orientable() const;
  // Whether CheckDisc() accepts the mesh: one component that is a disc, and no faults except isolated vertices,
  // coincident vertices and needles.
  bool is_disc() const;

  // Why the mesh cannot be mapped, as an INVALID_ARGUMENT with reason, message and element ids in the metadata; OK
  // otherwise. MESH_EMPTY (no faces), MESH_INDEX_OUT_OF_RANGE, MESH_POSITION_NOT_FINITE, MESH_FACE_DEGENERATE (no face
  // has area).
  absl::Status Refusal() const;
};

// "1 vertex has", "3 vertices have".
std::string Counted(std::int64_t count, const std::string& one, const std::string& many);
// INVALID_ARGUMENT with this reason and message; adds "count" to the metadata.
absl::Status MeshFault(const std::string& reason, const std::string& message, std::int64_t count,
                       std::map<std::string, std::string> metadata);

struct FlatImport;
struct Pairing;

// Finds the faults of single faces and vertices, except coincident vertices and needles. Refusal() needs no more. O(F).
Diagnosis DescribeElements(const Mesh& mesh, const Pairing& pairing);

// Describes `mesh` by its import (faces without area not joined): everything but coincident vertices, needles and
// geometry. Pairing::opposite may be empty, as `imported` has it. O(F). Invalid after a cancellation.
Diagnosis DescribeImport(const Mesh& mesh, const Pairing& pairing, const FlatImport& imported,
                         const Execution& execution = {});

// Describes a mesh and all of its faults. Accepts any mesh. O(F + V log V) for bounded valence. The same result for any
// number of threads. CANCELLED after a cancellation; INVALID_ARGUMENT with MESH_TOO_LARGE for more than 2^31 / 3 faces
// or 2^31 vertices.
absl::StatusOr<Diagnosis> Diagnose(const Mesh& mesh, const Execution& execution = {});

// OK if `mesh` is a disc: manifold, consistently oriented, connected, with one boundary loop, no handles and no face
// without area. Vertices without a face are ignored (see CountIsolatedVertices). ImportDisc() (core/mesh/import.h) also
// returns the mesh.
//
// Otherwise INVALID_ARGUMENT. The first fault found, in this order, is the reason:
//   MESH_EMPTY  MESH_INDEX_OUT_OF_RANGE  MESH_POSITION_NOT_FINITE  MESH_FACE_DEGENERATE  MESH_FACE_DUPLICATE
//   MESH_EDGE_NON_MANIFOLD  MESH_NOT_ORIENTABLE  MESH_ORIENTATION_INCONSISTENT  MESH_VERTEX_NON_MANIFOLD
//   MESH_SEVERAL_COMPONENTS  MESH_CLOSED  MESH_SEVERAL_LOOPS  MESH_HAS_HANDLES
// The message counts elements but does not list them. Metadata has "count" and, as they apply, "faces" and "vertices"
// (comma-separated 0-based ids) and "edges" ("a-b,c-d", vertex ids), at most 16 of each.
//
// CANCELLED after a cancellation.
//
// O(F) time and memory.
absl::Status CheckDisc(const Mesh& mesh, const Execution& execution = {});

// Per vertex: whether a face uses it whose vertices are all in range. O(F).
std::vector<char> UsedVertices(const Mesh& mesh);

// The number of vertices without a face. Indices must be in range.
std::int64_t CountIsolatedVertices(const Mesh& mesh);

}  // namespace planish
