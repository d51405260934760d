// What mesh files hold: polygons, with enough memory of the file to speak of its lines.
#pragma once

#include <cstdint>
#include <string>
#include <vector>

#include "core/mesh/mesh.h"

namespace planish {

// Polygon p has the corners [polygon_begin[p], polygon_begin[p + 1]) of corner_vertex.
struct PolygonMesh {
  std::vector<Vec3> positions;
  std::vector<std::int64_t> polygon_begin = {0};
  std::vector<std::int32_t> corner_vertex;  // 0-based, in range

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

  // 1-based line of each vertex and polygon in a text file; empty for binary files.
  std::vector<std::int64_t> vertex_line;
  std::vector<std::int64_t> polygon_line;

  std::int64_t num_polygons() const { return static_cast<std::int64_t>(polygon_begin.size()) - 1; }
};

// A polygon mesh cut into the triangles that travel, with the way back.
struct Triangulation {
  Mesh mesh;                                     // vertices without a polygon are left out
  std::vector<std::int32_t> source_vertex;       // per vertex of mesh: vertex of the polygon mesh
  std::vector<std::int64_t> source_polygon;      // per face of mesh
  std::vector<std::int64_t> corner_of_triangle;  // per corner 3 f + k: corner of the polygon mesh
};

// Each polygon into the triangles of core/io/ear_clipping.h, in the order of the polygons. Vertices keep their order.
// Indices of `polygons` must be in range.
Triangulation Triangulate(const PolygonMesh& polygons);

}  // namespace planish
