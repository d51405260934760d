// What mesh files hold: polygons, with enough memory of the file to speak of its lines.
#pragma once

#include <array>
#include <cstdint>
#include <string>
#include <unordered_map>
#include <utility>
#include <vector>

#include "core/mesh/mesh.h"

namespace planish {

// In place of the index of something that a mesh does not have.
inline constexpr std::int32_t kNoId = -1;

// Polygon p has the corners [polygon_begin[p], polygon_begin[p + 1]) of corner_vertex.
struct PolygonMesh {
  std::vector<Vec3> positions;
  std::vector<std::int64_t> polygon_begin = {0};
  std::vector<std::int32_t> corner_vertex;  // 0-based, in range
  // Of PLY and OFF: the file's own vertex per corner, where several of them are one vertex of the surface
  // (client/files/seam_copies.h), which corner_vertex has. Empty: they are the same.
  std::vector<std::int32_t> corner_file_vertex;

  // The file's UV, v upwards whatever the format says. Per corner an id into `texcoords`, -1: none; empty: the file has
  // no UV. Ids are equal exactly where the values are (0 and -0 alike), however often the file repeats a value: an edge
  // whose two faces name the same ids at both ends is no seam of the file.
  std::vector<std::int32_t> corner_texcoord;
  std::vector<Vec2> texcoords;
  // Per polygon an id into `material_names`, -1: none; empty: the file has no materials.
  std::vector<std::int32_t> polygon_material;
  std::vector<std::string> material_names;
  // Likewise for objects and groups (OBJ "o" and "g" together; glTF meshes): polygons of the same one share an id.
  std::vector<std::int32_t> polygon_group;
  std::vector<std::string> group_names;
  // Likewise for the objects of an OBJ alone ("o").
  std::vector<std::int32_t> polygon_object;
  std::vector<std::string> object_names;

  // 1-based line of each vertex and polygon in a text file; empty for binary files.
  std::vector<std::int64_t> vertex_line;
  std::vector<std::int64_t> polygon_line;

  std::int64_t num_polygons() const { return static_cast<std::int64_t>(polygon_begin.size()) - 1; }
};

// Why a polygon may not stay in one piece.
enum class PolygonFault : char {
  kCrossesItself,  // CrossesItself() (client/files/ear_clipping.h)
  kRevisits,       // it passes through a vertex twice
};

// A polygon mesh cut into the triangles that travel, with the way back. The triangles of a polygon follow each other.
struct Triangulation {
  Mesh mesh;                                     // vertices without a polygon are left out
  std::vector<std::int32_t> source_vertex;       // per vertex of mesh: vertex of the polygon mesh
  std::vector<std::int64_t> source_polygon;      // per face of mesh
  std::vector<std::int64_t> corner_of_triangle;  // per corner 3 f + k: corner of the polygon mesh

  // Per face: the piece of a polygon that no seam may cut, numbered 0, 1, 2, ... in the order of their first faces. A
  // polygon is one piece unless it is in `faulty`.
  std::vector<std::int32_t> piece;
  std::vector<std::pair<std::int64_t, PolygonFault>> faulty;  // polygons, ascending
  // Corners that are in no triangle because a neighbour names the same vertex; and that neighbour.
  std::vector<std::array<std::int64_t, 2>> repeated_corners;
};

// Half-edges on either side of a diagonal of the polygon whose triangles are faces [begin, end): 3 f + k is the one that
// corner k of face f faces. The lower one comes first.
std::vector<std::array<std::int32_t, 2>> Diagonals(const Triangulation& triangles, std::int64_t begin,
                                                   std::int64_t end);

// Each polygon into the triangles of client/files/ear_clipping.h, in the order of the polygons. Vertices keep their
// order. Indices of `polygons` must be in range.
Triangulation Triangulate(const PolygonMesh& polygons);

// A polygon that a map tears, and the faces that are written in its place: each a list of corners of the polygon mesh.
struct TornPolygon {
  std::int64_t polygon = 0;
  std::vector<std::vector<std::int64_t>> faces;
};

// UV of polygons as they are written.
struct PolygonUv {
  // (u, v) per corner of the polygons, or of WithTornPolygons() if some are torn.
  std::vector<double> corner_uv;
  std::vector<TornPolygon> torn;  // by polygon, ascending
};

// From UV per corner of triangles, 6 numbers a face, the first at `uv`. A polygon is torn where two of its triangles
// differ in the UV at an end of the diagonal between them. Triangles that name a vertex twice, or whose corners coincide,
// have no say, as no chart holds them.
PolygonUv UvOfPolygons(const PolygonMesh& polygons, const Triangulation& triangles, const double* uv);

// The polygons with those faces in place of torn ones: they take over material, group, object and line.
PolygonMesh WithTornPolygons(const PolygonMesh& polygons, const std::vector<TornPolygon>& torn);

// Numbers triples of doubles in the order of their first appearance. Equal means to the bit, except that 0 and -0 are
// the same; a NaN equals itself.
class ValueIndex {
 public:
  void Reserve(std::size_t count) { ids_.reserve(count); }
  // The id of `value`: new ones get the number of ids so far. Fewer than 2^31 values.
  std::int32_t Add(const Vec3& value);
  std::int32_t size() const { return static_cast<std::int32_t>(ids_.size()); }

 private:
  using Key = std::array<std::uint64_t, 3>;
  struct Hash {
    std::size_t operator()(const Key& key) const;
  };
  std::unordered_map<Key, std::int32_t, Hash> ids_;
};

// PolygonMesh::texcoords: one entry per different value.
class TexcoordTable {
 public:
  // The id of (u, v), v upwards.
  std::int32_t Add(double u, double v);
  std::vector<Vec2> TakeValues() { return std::move(values_); }

 private:
  ValueIndex ids_;
  std::vector<Vec2> values_;
};

}  // namespace planish
