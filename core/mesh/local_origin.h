// Moves meshes far from the origin, where float has too few digits. Header-only, since the client library contains only
// core/base and core/draco.
#pragma once

#include <algorithm>
#include <cmath>
#include <limits>
#include <vector>

#include "core/mesh/mesh.h"

namespace planish {

// The point to subtract from positions, in double, before they are rounded to float. Rounding then moves no vertex by
// more than 2^-23 of the longest side of the bounding box, however far the mesh is from the origin. Angles and areas,
// and so the UV, do not depend on the point.
//
// A coordinate is 0 if the box is within its longest side of the origin; all are 0 if every position already is a
// float, so that such meshes keep their bytes. Otherwise it is the middle of the box, rounded to a multiple of a power
// of two above a quarter of the longest side, so that subtracting it is exact. NaN and infinity are ignored.
//
// The clients implement this rule three times: here, in client/python/planish/mesh.py and in
// client/blender/planish_blender/meshes.py. So each of them gets the same UV for the same mesh.
inline Vec3 LocalOrigin(const std::vector<Vec3>& positions) {
  Vec3 low = Vec3::Constant(std::numeric_limits<double>::infinity()), high = -low;
  bool is_float = true;
  for (const Vec3& p : positions) {
    for (int axis = 0; axis < 3; ++axis) {
      if (!std::isfinite(p[axis])) continue;
      low[axis] = std::min(low[axis], p[axis]);
      high[axis] = std::max(high[axis], p[axis]);
      is_float = is_float && double{static_cast<float>(p[axis])} == p[axis];
    }
  }
  const double side = (high - low).maxCoeff();
  if (is_float || !std::isfinite(side) || side <= 0) return Vec3::Zero();
  int exponent = 0;
  std::frexp(side, &exponent);
  const double step = std::ldexp(1.0, exponent - 2);  // in (side / 4, side / 2]
  if (step == 0) return Vec3::Zero();
  Vec3 origin = Vec3::Zero();
  for (int axis = 0; axis < 3; ++axis) {
    const double middle = low[axis] / 2 + high[axis] / 2;
    if (std::abs(middle) > side) origin[axis] = std::floor(middle / step + 0.5) * step;
  }
  return origin;
}

}  // namespace planish
