// The polygons of the caller's triangles, which cannot be cut and which the caller calls faces.
#pragma once

#include <cstdint>
#include <vector>

#include "core/base/radix_sort.h"
#include "core/mesh/mesh.h"

namespace planish {

// Triangles have the numbers of the mesh's faces; polygons are numbered in the order of their first triangles. Without
// polygons each triangle is one, and nothing is stored.
class Polygons {
 public:
  // `face_polygon` as in UnwrapOptions. O(n).
  Polygons(std::int64_t num_faces, const std::vector<std::int32_t>& face_polygon);

  bool are_triangles() const { return of_face_.empty(); }
  std::int32_t count() const { return are_triangles() ? num_faces_ : faces_.count(); }
  std::int32_t of(std::int32_t face) const { return are_triangles() ? face : of_face_[face]; }
  // Calls body(triangle) for each triangle of polygon i, ascending.
  template <typename Body>
  void ForEachFace(std::int32_t i, const Body& body) const {
    if (are_triangles()) {
      body(i);
    } else {
      for (const std::int32_t f : faces_[i]) body(f);
    }
  }
  // The number of polygons with triangles among these.
  std::int64_t CountIn(const std::vector<std::int32_t>& faces) const;

 private:
  std::int32_t num_faces_ = 0;
  std::vector<std::int32_t> of_face_;
  Groups faces_;  // by polygon
};

// The size of a polygon on the surface.
struct PolygonSize {
  double area = 0;
  double length = 0;  // between two of its vertices; for a triangle, its longest edge
};
// Zeros if a triangle refers to a vertex that does not exist or is not finite. The length of a polygon is that from the
// vertex farthest from its first one to the vertex farthest from there: at least half of its diameter.
PolygonSize SizeOfPolygon(const Mesh& mesh, const Polygons& polygons, std::int32_t i);

}  // namespace planish
