// Positions far from the origin, where float has too few digits for them.
#pragma once

#include <vector>

#include "core/mesh/mesh.h"

namespace planish {

// The point to subtract from positions, in double, before they are rounded to float. Rounding then moves no vertex by
// more than 2^-23 of the longest side of the bounding box, however far the mesh lies from the origin. Angles, areas and
// so the UV do not depend on the point.
//
// A coordinate is 0 where the box lies within its longest side of the origin, and all are 0 if each position is a float
// already: such meshes keep their bytes. Otherwise it is the middle of the box, rounded to a power of two above a
// quarter of the longest side, so that subtracting it from a position is exact. NaN and infinity are ignored.
//
// The clients have this rule three times, here and in client/python/planish/mesh.py and
// client/blender/planish_blender/meshes.py: the same mesh gets the same UV from each of them.
Vec3 LocalOrigin(const std::vector<Vec3>& positions);

}  // namespace planish
