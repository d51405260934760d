// The report of an import (core/mesh/import.h): what a triangle mesh is like, and everything that is wrong with it.
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

// How many elements of a kind a diagnosis names.
inline constexpr std::size_t kMaxDiagnosed = 16;

// Elements of one kind: how many, and the first of their 0-based ids, ascending.
struct ElementList {
  std::int64_t count = 0;
  std::vector<std::int64_t> first;
};

// Edges of one kind, by the ids of their vertices (the smaller one first), ascending; and the faces at those that are
// named, edge by edge.
struct EdgeList {
  std::int64_t count = 0;
  std::vector<std::array<std::int64_t, 2>> first;
  std::vector<std::int64_t> faces;
};

// A piece of the surface: faces that hang together over edges of exactly two faces, whichever way these are wound. It
// is seen as it is once cut along the non-manifold edges and through the non-manifold vertices.
struct Component {
  std::int64_t first_face = 0;
  std::int64_t faces = 0;
  std::int64_t boundary_loops = 0;
  std::int64_t boundary_edges = 0;  // on these loops, sides of cuts included
  std::int64_t euler_characteristic = 0;
  // Whether turning some faces over makes all agree. Then euler_characteristic = 2 - 2 handles - boundary_loops,
  // otherwise 2 - crosscaps - boundary_loops.
  bool orientable = true;
  std::int64_t handles = 0;    // the genus; 0 if not orientable
  std::int64_t crosscaps = 0;  // 0 if orientable

  bool IsDisc() const { return euler_characteristic == 1 && boundary_loops == 1; }
};

struct Diagnosis {
  std::int64_t vertices = 0;
  std::int64_t faces = 0;

  // ---- Faults of single elements.
  // A face has at most one of the first four faults, the first that applies.
  ElementList faces_out_of_range;        // refer to a vertex that does not exist
  ElementList faces_repeating_a_vertex;  // name the same vertex twice
  ElementList faces_not_finite;          // have a corner at NaN or infinity
  ElementList faces_without_area;        // IsDegenerateTriangle (core/mesh/angles.h), on three different vertices
  // The same three vertices as an earlier face, in any order. Of the faces in range, whatever else they are.
  ElementList duplicate_faces;
  ElementList vertices_not_finite;  // have a face, and a position with a NaN or an infinity
  ElementList isolated_vertices;    // no face refers to them; out-of-range faces do not count
  ElementList coincident_vertices;  // at exactly the position of a vertex with a smaller id (0 equals -0, NaN nothing)
  ElementList needles;              // faces with area and an angle below one degree

  // ---- The surface: the faces with area, without copies (a face at NaN or infinity counts as one with area).
  std::int64_t surface_faces = 0;
  std::int64_t edges = 0;
  std::int64_t boundary_edges = 0;    // with one face
  EdgeList non_manifold_edges;        // with more than two faces
  EdgeList inconsistent_edges;        // with two faces that run along them the same way
  ElementList non_manifold_vertices;  // whose faces form several fans, the surface being cut along non-manifold edges
  // Pieces that remain when inconsistent edges are cut too: in each of them all faces agree.
  std::int64_t oriented_pieces = 0;
  std::vector<Component> components;  // by their first faces, ascending

  // ---- Geometry of the surface's finite faces; zeros if there is none.
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
  // One component that is a disc, and none of the faults but isolated and coincident vertices and needles: what
  // CheckDisc() takes.
  bool is_disc() const;

  // Why no map of the mesh is possible, as an INVALID_ARGUMENT with reason, message and element ids in metadata; OK
  // otherwise. MESH_EMPTY (no faces), MESH_INDEX_OUT_OF_RANGE, MESH_POSITION_NOT_FINITE,
  // MESH_FACE_DEGENERATE (no face has area).
  absl::Status Refusal() const;
};

// "1 vertex has", "3 vertices have".
std::string Counted(std::int64_t count, const std::string& one, const std::string& many);
// INVALID_ARGUMENT with this reason and message, and "count" added to the metadata.
absl::Status MeshFault(const std::string& reason, const std::string& message, std::int64_t count,
                       std::map<std::string, std::string> metadata);

struct FlatImport;
struct Pairing;

// The faults of single faces and vertices alone, without coincident vertices and needles: what Refusal() goes by. O(F).
Diagnosis DescribeElements(const Mesh& mesh, const Pairing& pairing);

// Describes `mesh` by its import without flat faces joined: everything but coincident vertices, needles and geometry.
// Pairing::opposite may be empty: `imported` has it. O(F). Of no use after a cancellation.
Diagnosis DescribeImport(const Mesh& mesh, const Pairing& pairing, const FlatImport& imported,
                         const Execution& execution = {});

// Takes any mesh. O(F + V log V) for bounded valence. The same result for any number of threads. CANCELLED
// after a cancellation; INVALID_ARGUMENT with MESH_TOO_LARGE for more than 2^31 / 3 faces or 2^31 vertices.
absl::StatusOr<Diagnosis> Diagnose(const Mesh& mesh, const Execution& execution = {});

// OK if `mesh` is a disc: manifold, consistently oriented, in one piece, with one boundary loop, no handles and no face
// without area. Vertices without a face are ignored (see CountIsolatedVertices). ImportDisc() (core/mesh/import.h) has
// the mesh as well.
//
// Otherwise INVALID_ARGUMENT. The first fault found, in this order, is the reason:
//   MESH_EMPTY  MESH_INDEX_OUT_OF_RANGE  MESH_POSITION_NOT_FINITE  MESH_FACE_DEGENERATE  MESH_FACE_DUPLICATE
//   MESH_EDGE_NON_MANIFOLD  MESH_NOT_ORIENTABLE  MESH_ORIENTATION_INCONSISTENT  MESH_VERTEX_NON_MANIFOLD
//   MESH_SEVERAL_COMPONENTS  MESH_CLOSED  MESH_SEVERAL_LOOPS  MESH_HAS_HANDLES
// The message counts, but names no element. Metadata has "count" and, as they apply, "faces" and "vertices"
// (comma-separated 0-based ids) and "edges" ("a-b,c-d", vertex ids), at most 16 of each.
//
// CANCELLED after a cancellation.
//
// O(F) time and memory.
absl::Status CheckDisc(const Mesh& mesh, const Execution& execution = {});

// Per vertex: whether a face refers to it whose vertices are all in range. O(F).
std::vector<char> UsedVertices(const Mesh& mesh);

// Vertices that no face refers to. Indices must be in range.
std::int64_t CountIsolatedVertices(const Mesh& mesh);

}  // namespace planish
