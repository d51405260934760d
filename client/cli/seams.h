// Parses --seams=LIST, and finds the edges in mesh files that LIST refers to.
#pragma once

#include <cstdint>
#include <string>
#include <vector>

#include "client/files/mesh_file.h"
#include "planish/types.h"

namespace planish::cli {

// ---- The list

// The parsed list: a policy, and the sources of the given seams.
struct SeamList {
  Seams policy = Seams::kAuto;
  double hard_edge_degrees = 0;          // 0: none
  bool uv = false;                       // borders of the file's UV islands
  bool uv_is_optional = false;           // with `uv`: a file without UV is not an error (--preset)
  bool materials = false;                // edges between faces of different materials
  bool groups = false;                   // edges between faces of different objects or groups
  std::vector<std::string> edge_files;   // text files with two vertex numbers per line
  std::vector<std::string> uncut_files;  // edges at which no seam is added, in the same format

  // Whether any of the seams comes from a file, which the client reads.
  bool NeedsFile() const { return uv || materials || groups || !edge_files.empty(); }
};

// The angle of "hard" without DEG, in degrees.
inline constexpr double kDefaultHardEdge = 66;

// Reads a comma-separated list of at most one policy (none, keep, needed, auto) and any number of sources (uv, hard,
// hard:DEG, edges:FILE, materials, groups) and uncut:FILE. If there are sources but no policy, the policy is needed.
// Returns a message about an error in `text`, or an empty string.
std::string ParseSeamList(const std::string& text, SeamList* list);

// ---- Edges from files

// The edges of a file's polygons. Diagonals, which only the triangulation has, are left out, and so are edges of
// triangles that name a vertex twice.
class PolygonEdges {
 public:
  // Both must outlive this object; `triangles` is the triangulation of `file.mesh`. O(F log F).
  PolygonEdges(const MeshFile& file, const Triangulation& triangles);

  // UvBorders(), MaterialBorders() and GroupBorders() return the edges between polygons with different UV at an end of
  // the edge (or with UV on one side only), of different materials, or of different groups. Each edge is given as a
  // corner of the triangulation that faces it (MeshView::WithSeamCorners), ascending. Empty if the file has no UV,
  // materials or groups. An edge of more than two polygons counts if any two of them differ.
  std::vector<std::int32_t> UvBorders() const;
  // Edges at which a UV island is folded onto itself, for example because an artist has mirrored one half of a model
  // onto the other; in the same form. Reports only islands that would stretch if they were unfolded: their outline is
  // shorter than the circumference of a disc of the same area. Each side of a fold must have at least a hundredth of
  // the island's area, so that single flipped faces are not reported.
  std::vector<std::int32_t> UvFolds() const;
  std::vector<std::int32_t> MaterialBorders() const;
  std::vector<std::int32_t> GroupBorders() const;

  // The edges that the text file at `path` lists, as corners in the same form. The text file has two vertex numbers per
  // line, as the mesh file numbers its vertices (from 1 in an OBJ, from 0 in others); blank lines and text after a #
  // are skipped. Throws planish::Error: FILE_UNREADABLE; FILE_MALFORMED, with path and line, also for a pair that is
  // not an edge and if the mesh file is an STL, whose vertices have no numbers.
  std::vector<std::int32_t> ListedIn(const std::string& path) const;

  // The number of UV islands: pieces of the surface that end at UV borders and at edges of one or of more than two
  // polygons. Polygons without an edge do not count.
  std::int64_t CountUvIslands() const;

 private:
  // Half-edge c of the triangulation is opposite to corner c.
  struct HalfEdge {
    std::int32_t low, high;  // vertices of the file
    std::int32_t corner;
  };

  // The file's corner of the polygon of `corner` at `vertex`, which is an end of the edge that `corner` faces.
  std::int64_t PolygonCorner(std::int32_t corner, std::int32_t vertex) const;
  bool SameUv(const HalfEdge& a, const HalfEdge& b) const;
  double Length(const HalfEdge& half_edge) const;
  std::int64_t PolygonOf(const HalfEdge& half_edge) const;
  // A corner for each edge with a half-edge h for which same(first half-edge of the edge, h) is false.
  template <typename Same>
  std::vector<std::int32_t> Borders(const Same& same) const;
  // visit(begin, end) for the half-edges of each edge.
  template <typename Visit>
  void ForEachEdge(const Visit& visit) const;

  const MeshFile& file_;
  const Triangulation& triangles_;
  std::vector<HalfEdge> half_edges_;  // half-edges of polygon edges, sorted by their ends
};

// The edges of `list` at which no seam may be added (uncut:FILE), each as one corner that faces it, ascending. Throws
// the errors of PolygonEdges::ListedIn().
std::vector<std::int32_t> UncutCorners(const MeshFile& file, const Triangulation& triangles, const SeamList& list);

// The given seams that `list` takes from files, each as one corner that faces it, ascending, without duplicate corners.
// Throws the errors of PolygonEdges::ListedIn(), and OPTIONS_INVALID for a source that the file does not have.
std::vector<std::int32_t> SeamCorners(const MeshFile& file, const Triangulation& triangles, const SeamList& list);

}  // namespace planish::cli
