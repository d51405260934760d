// One polygon into triangles.
#pragma once

#include <vector>

#include "core/mesh/mesh.h"

namespace planish {

// The n - 2 triangles of a polygon of n >= 3 corners, as corners of it (0-based), wound like the polygon.
//
// A quad is the fan round corner 0 unless that has a flat triangle, even where it is concave: whoever reads the file
// again cuts it there, most do so whatever its shape, and the map must hold for what they make of it. (Its two
// triangles then lie on each other on the surface, and side by side in the map, which any diagonal cuts well.) So is a
// polygon of more corners that lies in no plane: one whose fan has triangles more than 45 degrees off the normal.
// Others are a fan where every triangle of it faces the way the polygon does, as in all convex polygons without corners
// in line. Otherwise ears are cut off in the plane that fits best (Newell's normal), so that concave
// polygons and those with corners in line get neither flipped nor flat triangles. What is no simple polygon in
// that plane, has no plane (all corners in line, NaN) or more than 10,000 corners (the search for ears is quadratic)
// is a fan from there on: its triangles may be flat or flipped.
std::vector<Face> TrianglesOfPolygon(const std::vector<Vec3>& outline);

// Whether the outline is no simple polygon in its plane, as a bow tie is not: triangles of it lie on each other. False for
// outlines that lie in no plane, and for those without area.
bool CrossesItself(const std::vector<Vec3>& outline);

}  // namespace planish
