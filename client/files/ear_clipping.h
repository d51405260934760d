// Cuts a polygon into triangles.
#pragma once

#include <vector>

#include "core/mesh/mesh.h"

namespace planish {

// Cuts a polygon of n >= 3 corners into n - 2 triangles, returned as 0-based corners and wound like the polygon. The
// first rule that applies decides:
//
// 1. A quad becomes the fan round corner 0, if that has no flat triangle. This includes concave quads: most programs
//    that read the file cut every quad there, and the map must hold for their triangles. (The two triangles of a
//    concave quad overlap on the surface, but lie side by side in the map.)
// 2. A polygon that is not planar becomes that fan, if it has no flat triangle. Not planar means that the fan has
//    triangles more than 45 degrees off the normal.
// 3. A polygon without a plane (all corners collinear, or NaN) or with more than 10,000 corners (the search for ears is
//    quadratic) becomes that fan, whose triangles may be flat or flipped.
// 4. A polygon becomes that fan if each triangle of the fan faces the way the polygon does. This holds for all convex
//    polygons without collinear corners.
// 5. From other polygons, ears are cut off in the best fitting plane (Newell's normal), so that concave polygons and
//    those with collinear corners get neither flipped nor flat triangles. If the polygon is not simple in that plane, a
//    part without ears is left over, and becomes a fan, whose triangles may be flat or flipped.
std::vector<Face> TrianglesOfPolygon(const std::vector<Vec3>& outline);

// Whether the outline crosses itself in its plane, as a bow tie does, so that its triangles overlap. False for outlines
// that are not planar, are collinear or have more than 10,000 corners.
bool CrossesItself(const std::vector<Vec3>& outline);

}  // namespace planish
