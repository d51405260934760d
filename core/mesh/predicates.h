// Geometric predicates on doubles (floats are doubles). Exact unless a comment says otherwise.
#pragma once

#include <array>
#include <cmath>
#include <limits>

#include "core/mesh/mesh.h"

namespace planish {

// Orientation() without the filter.
int OrientationByExpansion(const Vec2& a, const Vec2& b, const Vec2& c);

// Sign of the area of triangle (a, b, c): 1 counter-clockwise, -1 clockwise, 0 collinear. Exact for finite inputs of
// any size, if the smallest nonzero one is at least 2^-980 times the largest. A floating-point filter, then an
// expansion (Shewchuk 1997).
inline int Orientation(const Vec2& a, const Vec2& b, const Vec2& c) {
  const double left = (a.x() - c.x()) * (b.y() - c.y());
  const double right = (a.y() - c.y()) * (b.x() - c.x());
  const double determinant = left - right;
  // Shewchuk's bound of the rounding error, plus more than underflowing products can lose.
  constexpr double kEpsilon = std::numeric_limits<double>::epsilon() / 2;
  const double bound =
      (3 + 16 * kEpsilon) * kEpsilon * (std::abs(left) + std::abs(right)) + std::numeric_limits<double>::min();
  if (std::abs(determinant) > bound) return determinant > 0 ? 1 : -1;
  return OrientationByExpansion(a, b, c);
}
inline int Orientation(const std::array<Vec2, 3>& triangle) {
  return Orientation(triangle[0], triangle[1], triangle[2]);
}

// Whether the interiors of two triangles intersect. Both must be counter-clockwise and not degenerate. Exact.
bool InteriorsMeet(const Vec2 s[3], const Vec2 t[3]);

// Whether a vertical line that sweeps to the right reaches `p` before `q`. Vertical lines count as tilted to the left
// by an infinitesimal angle, so that they reach points one at a time and no edge is vertical.
inline bool SweepsFirst(const Vec2& p, const Vec2& q) {
  return p.x() < q.x() || (p.x() == q.x() && p.y() < q.y());
}

// For two triangles as for InteriorsMeet() that some vertical line crosses: 1 if the interior of `s` is above that of
// `t` there, -1 if it is below, 0 if the interiors intersect. Exact.
int VerticalOrder(const Vec2 s[3], const Vec2 t[3]);

// Whether the segments ab and cd share a point, ends included. Exact.
bool SegmentsMeet(const Vec2& a, const Vec2& b, const Vec2& c, const Vec2& d);

// The squared distance from `p` to the nearest point of segment ab. Rounded.
double SquaredDistanceToSegment(const Vec2& p, const Vec2& a, const Vec2& b);
// The squared distance between the segments ab and cd. Exactly 0 if they intersect; otherwise rounded.
double SquaredDistance(const Vec2& a, const Vec2& b, const Vec2& c, const Vec2& d);

}  // namespace planish
