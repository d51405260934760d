// Geometric predicates on doubles (floats are doubles): exact unless said otherwise.
#pragma once

#include <array>

#include "core/mesh/mesh.h"

namespace planish {

// Sign of the area of triangle (a, b, c): 1 counter-clockwise, -1 clockwise, 0 collinear. Exact for all finite inputs
// whose products neither overflow nor underflow: a floating-point filter, then an expansion (Shewchuk 1997).
int Orientation(const Vec2& a, const Vec2& b, const Vec2& c);
inline int Orientation(const std::array<Vec2, 3>& triangle) {
  return Orientation(triangle[0], triangle[1], triangle[2]);
}

// Whether the interiors of two triangles, both counter-clockwise and not degenerate, meet. Exact.
bool InteriorsMeet(const Vec2 s[3], const Vec2 t[3]);

// Whether the segments ab and cd share a point, ends included. Exact.
bool SegmentsMeet(const Vec2& a, const Vec2& b, const Vec2& c, const Vec2& d);

// From `p` to the nearest point of the segment ab. Rounded.
double SquaredDistanceToSegment(const Vec2& p, const Vec2& a, const Vec2& b);

}  // namespace planish
