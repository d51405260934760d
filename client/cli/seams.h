// --seams=LIST: its meaning, and the edges that it takes from files.
#pragma once

#include <cstdint>
#include <string>
#include <vector>

#include "client/files/mesh_file.h"
#include "planish/types.h"

namespace planish::cli {

// ---- The list

// A policy, and where the given seams come from.
struct SeamList {
  Seams policy = Seams::kAuto;
  double hard_edge_degrees = 0;          // 0: none
  bool uv = false;                       // borders of the file's UV islands
  bool uv_is_optional = false;           // a file without UV has no such edges; nobody asked for them by name
  bool materials = false;                // edges between faces of different materials
  bool groups = false;                   // edges between faces of different objects or groups
  std::vector<std::string> edge_files;   // of two vertex numbers per line
  std::vector<std::string> uncut_files;  // edges at which no seam is added, in the same format

  // Whether any of the seams comes from a file, which the client reads.
  bool NeedsFile() const { return uv || materials || groups || !edge_files.empty(); }
};

// Angle of "hard" without one, degrees.
inline constexpr double kDefaultHardEdge = 66;

// Reads a comma-separated list of at most one policy (none, keep, needed, auto) and any number of sources (uv, hard,
// hard:DEG, edges:FILE, materials, groups), and of uncut:FILE. Sources without a policy mean needed. Returns a message
// about an error in `text`, or an empty string.
std::string ParseSeamList(const std::string& text, SeamList* list);

// ---- Edges from files

// The edges of a file's polygons at which its triangles meet. Diagonals, which only the triangulation has, are not
// among them, nor edges of triangles that name a vertex twice.
class PolygonEdges {
 public:
  // Both must outlive this object; `triangles` is the triangulation of `file.mesh`. O(F log F).
  PolygonEdges(const MeshFile& file, const Triangulation& triangles);

  // The edges between polygons with different UV at an end (or with UV on one side only), of different materials or of
  // different groups, each as a corner of the triangulation that faces it (MeshView::WithSeamCorners), ascending.
  // Nothing where the file says nothing of the kind. An edge of more than two polygons counts if any two differ.
  std::vector<std::int32_t> UvBorders() const;
  // Edges at which UV islands are folded onto themselves, as where an artist has mirrored one half onto the other, in
  // the same form. Only islands count that could not lie flat without stretch if they were unfolded: their outline is
  // shorter than the circumference of a disc of the same area. Each side of a fold has at least a hundredth of the
  // island, so single flipped faces are not folds.
  std::vector<std::int32_t> UvFolds() const;
  std::vector<std::int32_t> MaterialBorders() const;
  std::vector<std::int32_t> GroupBorders() const;

  // The edges that the text file at `path` lists, in the same form: two vertex numbers per line, as the mesh file
  // numbers its vertices (from 1 in an OBJ, from 0 in others); blank lines and what follows a # are skipped. Throws
  // planish::Error: FILE_UNREADABLE; FILE_MALFORMED, with path and line, also for a pair that is no edge and for an
  // STL, whose vertices have no numbers.
  std::vector<std::int32_t> ListedIn(const std::string& path) const;

  // Pieces of the surface between UV borders, and edges of one or of more than two polygons. Polygons without an edge
  // do not count.
  std::int64_t CountUvIslands() const;

 private:
  // Half-edge c of the triangulation is opposite to corner c.
  struct HalfEdge {
    std::int32_t low, high;  // vertices of the file
    std::int32_t corner;
  };

  // The corner of the polygon at vertex `vertex` of the edge that `corner` faces.
  std::int64_t PolygonCorner(std::int32_t corner, std::int32_t vertex) const;
  bool SameUv(const HalfEdge& a, const HalfEdge& b) const;
  double Length(const HalfEdge& half_edge) const;
  std::int64_t PolygonOf(const HalfEdge& half_edge) const;
  // A corner for each edge of which some half-edge is not `same` as the first.
  template <typename Same>
  std::vector<std::int32_t> Borders(const Same& same) const;
  // visit(begin, end) for the half-edges of each edge.
  template <typename Visit>
  void ForEachEdge(const Visit& visit) const;

  const MeshFile& file_;
  const Triangulation& triangles_;
  std::vector<HalfEdge> half_edges_;  // half-edges of polygon edges, sorted by their ends
};

// The edges that no seam may follow, each as one corner that faces it, ascending: the edges that `list` names, and the
// diagonals of triangulated polygons, since a polygon has one UV per corner. Throws planish::Error: as ListedIn.
std::vector<std::int32_t> UncutCorners(const MeshFile& file, const Triangulation& triangles, const SeamList& list);

// Everything that `list` takes from files, ascending, each edge once. Throws planish::Error: as ListedIn; and
// OPTIONS_INVALID for a source that the file does not have.
std::vector<std::int32_t> SeamCorners(const MeshFile& file, const Triangulation& triangles, const SeamList& list);

}  // namespace planish::cli
