// Cuts a polygon into triangles.
#pragma once

#include <vector>

#include "core/mesh/mesh.h"

namespace planish {

// The n - 2 triangles of a polygon of n >= 3 corners, as 0-based corners, wound like the polygon.
//
// A quad is cut as the fan round corner 0 unless that has a flat triangle, even if the quad is concave: most programs
// that read the file cut every quad there, and the map must hold for their triangles. (The two triangles of a concave
// quad overlap on the surface, but lie side by side in the map.) So is a polygon of more corners that is not planar:
// one whose fan has triangles more than 45 degrees off the normal. Other polygons are cut as a fan if each of its
// triangles faces the way the polygon does, as in all convex polygons without collinear corners. Otherwise ears are cut
// off in the best fitting plane (Newell's normal), so that concave polygons and those with collinear corners get
// neither flipped nor flat triangles. A polygon that is not simple in that plane, has no plane (all corners collinear,
// or NaN) or has more than 10,000 corners (the search for ears is quadratic) is cut as a fan from there on; its
// triangles may be flat or flipped.
std::vector<Face> TrianglesOfPolygon(const std::vector<Vec3>& outline);

// Whether the outline is not a simple polygon in its plane, such as a bow tie, so that its triangles overlap. False for
// outlines that are not planar or have no area.
bool CrossesItself(const std::vector<Vec3>& outline);

}  // namespace planish
