// Polygons as read from mesh files, with line numbers for messages.
#pragma once

#include <array>
#include <cstdint>
#include <string>
#include <unordered_map>
#include <utility>
#include <vector>

#include "core/mesh/mesh.h"

namespace planish {

// The id of a missing element.
inline constexpr std::int32_t kNoId = -1;

// Polygon p has the corners [polygon_begin[p], polygon_begin[p + 1]) of corner_vertex.
struct PolygonMesh {
  std::vector<Vec3> positions;
  std::vector<std::int64_t> polygon_begin = {0};
  std::vector<std::int32_t> corner_vertex;  // 0-based, in range
  // For PLY and OFF: the file's vertex per corner, if several vertices of the file are one vertex of the surface
  // (client/files/seam_copies.h). corner_vertex has the latter. Empty if the two are the same at every corner.
  std::vector<std::int32_t> corner_file_vertex;

  // The file's UV, with v upwards in all formats. Per corner an id into `texcoords`, -1: none; empty: the file has no
  // UV. Ids are equal exactly if the values are (0 and -0 are equal), even if the file repeats a value: an edge whose
  // two faces have the same ids at both ends is not a seam of the file.
  std::vector<std::int32_t> corner_texcoord;
  std::vector<Vec2> texcoords;
  // Per polygon an id into `material_names`, -1: none; empty: the file has no materials.
  std::vector<std::int32_t> polygon_material;
  std::vector<std::string> material_names;
  // As polygon_material and material_names, for objects and groups (OBJ "o" and "g" together; glTF meshes).
  std::vector<std::int32_t> polygon_group;
  std::vector<std::string> group_names;
  // As polygon_group and group_names, for the objects of an OBJ alone ("o").
  std::vector<std::int32_t> polygon_object;
  std::vector<std::string> object_names;

  // 1-based line of each vertex and polygon in a text file; empty for binary files.
  std::vector<std::int64_t> vertex_line;
  std::vector<std::int64_t> polygon_line;

  std::int64_t num_polygons() const { return static_cast<std::int64_t>(polygon_begin.size()) - 1; }
};

// Why a polygon may be cut.
enum class PolygonFault : char {
  kCrossesItself,  // CrossesItself() (client/files/ear_clipping.h)
  kRevisits,       // the polygon visits a vertex twice
};

// A polygon mesh cut into the triangles that are sent, with the origin of each vertex, face and corner. The triangles
// of a polygon are consecutive.
struct Triangulation {
  Mesh mesh;                                     // without vertices that have no polygon
  std::vector<std::int32_t> source_vertex;       // per vertex of mesh: vertex of the polygon mesh
  std::vector<std::int64_t> source_polygon;      // per face of mesh
  std::vector<std::int64_t> corner_of_triangle;  // per corner 3 f + k: corner of the polygon mesh

  // Per face: the part of a polygon that no seam may cut, numbered 0, 1, 2, ... in the order of their first faces. A
  // polygon is one part unless it is in `faulty`.
  std::vector<std::int32_t> piece;
  std::vector<std::pair<std::int64_t, PolygonFault>> faulty;  // polygons, ascending
  // The corners that are in no triangle because a neighbour has the same vertex, each with that neighbour.
  std::vector<std::array<std::int64_t, 2>> repeated_corners;
};

// The two half-edges at each diagonal of the polygon whose triangles are faces [begin, end), the lower one first.
// Corner k of face f faces half-edge 3 f + k.
std::vector<std::array<std::int32_t, 2>> Diagonals(const Triangulation& triangles, std::int64_t begin,
                                                   std::int64_t end);

// Cuts each polygon into the triangles of client/files/ear_clipping.h, in the order of the polygons. Vertices keep
// their order. Indices of `polygons` must be in range.
Triangulation Triangulate(const PolygonMesh& polygons);

// A polygon that a map tears, and the faces that replace it in the file, as lists of corners of the polygon mesh.
struct TornPolygon {
  std::int64_t polygon = 0;
  std::vector<std::vector<std::int64_t>> faces;
};

// UV of polygons for writing.
struct PolygonUv {
  // (u, v) per corner of the polygons, or of WithTornPolygons() if some are torn.
  std::vector<double> corner_uv;
  std::vector<TornPolygon> torn;  // by polygon, ascending
};

// Converts UV per corner of triangles, 6 numbers a face, the first at `uv`. A polygon is torn if two of its triangles
// have different UV at an end of the diagonal between them. Triangles that repeat a vertex, or whose corners coincide,
// are ignored, as no chart has them.
PolygonUv UvOfPolygons(const PolygonMesh& polygons, const Triangulation& triangles, const double* uv);

// Replaces torn polygons by their faces, which inherit material, group, object and line.
PolygonMesh WithTornPolygons(const PolygonMesh& polygons, const std::vector<TornPolygon>& torn);

// Maps values per polygon of the file to the polygons of WithTornPolygons().
template <typename Value>
std::vector<Value> OfWrittenPolygons(const std::vector<Value>& of_polygon, const std::vector<TornPolygon>& torn) {
  std::vector<Value> result;
  auto next = torn.begin();
  for (std::size_t p = 0; p < of_polygon.size(); ++p) {
    const bool is_torn = next != torn.end() && next->polygon == static_cast<std::int64_t>(p);
    result.insert(result.end(), is_torn ? next->faces.size() : 1, of_polygon[p]);
    next += is_torn;
  }
  return result;
}

// Maps values per corner of the file to the corners of WithTornPolygons().
template <typename Value>
std::vector<Value> OfWrittenCorners(const PolygonMesh& mesh, const std::vector<Value>& of_corner,
                                    const std::vector<TornPolygon>& torn) {
  std::vector<Value> result;
  auto next = torn.begin();
  for (std::int64_t p = 0; p < mesh.num_polygons(); ++p) {
    if (next != torn.end() && next->polygon == p) {
      for (const std::vector<std::int64_t>& face : next->faces) {
        for (const std::int64_t c : face) result.push_back(of_corner[static_cast<std::size_t>(c)]);
      }
      ++next;
    } else {
      result.insert(result.end(), of_corner.begin() + mesh.polygon_begin[p],
                    of_corner.begin() + mesh.polygon_begin[p + 1]);
    }
  }
  return result;
}

// Numbers triples of doubles in the order of their first appearance. Triples are equal if their bits are, except that 0
// equals -0; a NaN equals itself.
class ValueIndex {
 public:
  void Reserve(std::size_t count) { ids_.reserve(count); }
  // The id of `value`; a new value gets the next id. Fewer than 2^31 values.
  std::int32_t Add(const Vec3& value);
  std::int32_t size() const { return static_cast<std::int32_t>(ids_.size()); }

 private:
  using Key = std::array<std::uint64_t, 3>;
  struct Hash {
    std::size_t operator()(const Key& key) const;
  };
  std::unordered_map<Key, std::int32_t, Hash> ids_;
};

// Builds PolygonMesh::texcoords: one entry per different value.
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
