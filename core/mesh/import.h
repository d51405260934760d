// Any triangle soup to a manifold mesh. No face is refused: where faces cannot stay joined, their vertices are
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

// At an edge of more faces than this none are joined: bounds the work, which grows with the square.
inline constexpr std::size_t kMostFacesAtAnEdge = 64;

// What a face is like: the first of these that applies.
enum class FaceKind : char {
  kOutOfRange,        // refers to a vertex that does not exist
  kRepeatingAVertex,  // names a vertex twice
  kNotFinite,         // has a corner at NaN or infinity
  kInOnePoint,        // its three vertices coincide
  kWithoutArea,       // IsDegenerateTriangle() (core/mesh/angles.h)
  kWithArea,
};

// What half-edges are paired for. kCharts: faces without area are joined like others, since charts map them too, and at
// edges of more than two faces pairs of faces stay joined. kDiagnosis: faces without area are not joined, and the
// surface is cut along edges of more than two faces.
enum class JoinFor { kCharts, kDiagnosis };

// Which half-edges import joins, and what it found in the mesh. Half-edges are numbered by the corner that faces them.
struct Pairing {
  std::vector<FaceKind> kind;  // per face
  // Per face: how many earlier faces have the same three vertices, in any order. Empty: no face has such a copy.
  std::vector<std::int32_t> layer;
  // Per half-edge: the one it is joined to, or -1. Faces are joined within their layer only, so that double-sided
  // surfaces come apart in two sheets; faces out of range, that repeat a vertex or lie in one point are not joined, nor
  // are faces without area for JoinFor::kDiagnosis.
  std::vector<std::int32_t> opposite;
  // Edges, by their half-edges, that have more than two faces of one layer, and those whose two faces run along them
  // the same way. By the vertices of the edges, ascending.
  std::vector<std::vector<std::int32_t>> non_manifold;
  std::vector<std::array<std::int32_t, 2>> inconsistent;
  // Of layer 0: edges, and those with one face.
  std::int64_t edges = 0, boundary_edges = 0;

  bool is_copy(std::int64_t f) const { return !layer.empty() && layer[f] > 0; }
};

// Takes any mesh of at most 2^31 / 3 faces. O(F) for bounded valence. After a cancellation the result is incomplete and
// must not be used.
//
// `polygon`: per face the number of the polygon that it is a triangle of; empty: every face is a polygon. At a diagonal,
// an edge between two triangles of one polygon that run along it in opposite directions, these two are always joined,
// whatever other faces have the edge. The other faces are then joined as if the diagonal were not there.
Pairing PairHalfEdges(const Mesh& mesh, JoinFor purpose, const Execution& execution = {},
                      std::span<const std::int32_t> polygon = {});

// The mesh with these half-edges joined (Pairing::opposite). Face f is face f of `mesh`; vertices are in the order of
// those they come from. Vertices without a face are left out. O(F).
TriMesh ImportMesh(const Mesh& mesh, const std::vector<std::int32_t>& opposite);

// The same in flat arrays, where no circulators are needed: less memory, and no time to link.
struct FlatImport {
  FlatMesh mesh;
  std::vector<std::int32_t> source;  // per vertex, ascending: the one of the Mesh that it comes from
};
FlatImport ImportFlat(const Mesh& mesh, std::vector<std::int32_t> opposite);

// The mesh, if it is a disc; otherwise the error of CheckDisc() (core/mesh/diagnosis.h).
absl::StatusOr<FlatImport> ImportDisc(const Mesh& mesh, const Execution& execution = {});

}  // namespace planish
