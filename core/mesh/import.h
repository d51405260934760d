// Turns any triangle soup into a manifold mesh. No face is refused: where faces cannot stay joined, vertices are
// duplicated, so that each vertex has one fan of faces.
//
//   TriMesh mesh = ImportMesh(soup, PairHalfEdges(soup, JoinFor::kCharts));
#pragma once

#include <array>
#include <cstdint>
#include <span>
#include <vector>

#include "absl/status/statusor.h"
#include "core/base/execution.h"
#include "core/mesh/half_edges.h"
#include "core/mesh/mesh.h"
#include "core/mesh/tri_mesh_fwd.h"

namespace planish {

// At an edge of more faces than this, no faces are joined. Bounds the work, which grows with the square of the
// number of faces at the edge.
inline constexpr std::size_t kMostFacesAtAnEdge = 64;

// The kind of a face: the first of these that applies.
enum class FaceKind : char {
  kOutOfRange,        // refers to a vertex that does not exist
  kRepeatingAVertex,  // names a vertex twice
  kNotFinite,         // has a corner at NaN or infinity
  kInOnePoint,        // its three vertices coincide
  kWithoutArea,       // IsDegenerateTriangle() (core/mesh/angles.h)
  kWithArea,
};

// The purpose of a pairing. kCharts: faces without area are joined like others, since charts map them too, and pairs of
// faces stay joined at edges of more than two faces. kDiagnosis: faces without area are not joined, and the surface is
// cut along edges of more than two faces.
enum class JoinFor { kCharts, kDiagnosis };

// Which half-edges an import joins, and what it found in the mesh. A half-edge has the number of the corner that faces
// it.
struct Pairing {
  std::vector<FaceKind> kind;  // per face
  // Per face: the number of earlier faces with the same three vertices, in any order. Empty if there are no such
  // copies.
  std::vector<std::int32_t> layer;
  // Per half-edge: the one it is joined to, or -1. Faces are joined only within their layer, so double-sided surfaces
  // become two sheets. Faces out of range, with a repeated vertex or in one point are not joined; with
  // JoinFor::kDiagnosis, neither are faces without area.
  std::vector<std::int32_t> opposite;
  // Edges, as lists of half-edges: those with more than two faces of one layer, and those whose two faces run along
  // them in the same direction. Ascending by the vertices of the edges.
  std::vector<std::vector<std::int32_t>> non_manifold;
  std::vector<std::array<std::int32_t, 2>> inconsistent;
  // Counts in layer 0: of all edges, and of edges with one face.
  std::int64_t edges = 0, boundary_edges = 0;

  bool is_copy(std::int64_t f) const { return !layer.empty() && layer[f] > 0; }
};

// Decides which half-edges are joined. Accepts any mesh of at most 2^31 / 3 faces. O(F) for bounded valence. After a
// cancellation the result is incomplete and must not be used.
//
// `polygon`: per face the number of the polygon that it is a triangle of; empty if every face is a polygon. A diagonal
// is an edge between two triangles of one polygon that run along it in opposite directions. These two are always
// joined, whatever other faces share the edge. The other faces are then joined as if the diagonal were not there.
Pairing PairHalfEdges(const Mesh& mesh, JoinFor purpose, const Execution& execution = {},
                      std::span<const std::int32_t> polygon = {});

// The mesh with these half-edges joined (Pairing::opposite). Face f is face f of `mesh`. Vertices are in the order of
// their sources in `mesh`; vertices without a face are left out. O(F).
TriMesh ImportMesh(const Mesh& mesh, const std::vector<std::int32_t>& opposite);

// ImportFlat() is ImportMesh() into flat arrays, for uses without circulators: it takes less memory, and no time for
// linking.
struct FlatImport {
  FlatMesh mesh;
  std::vector<std::int32_t> source;  // per vertex, ascending: its vertex in the Mesh
};
FlatImport ImportFlat(const Mesh& mesh, std::vector<std::int32_t> opposite);

// The mesh, if it is a disc; otherwise the error of CheckDisc() (core/mesh/diagnosis.h).
absl::StatusOr<FlatImport> ImportDisc(const Mesh& mesh, const Execution& execution = {});

}  // namespace planish
