#include "core/mesh/predicates.h"

#include <algorithm>
#include <cmath>

#include "core/mesh/box_tree.h"

namespace planish {
namespace {

// A sum of doubles without rounding error: components do not overlap and ascend in magnitude (Shewchuk 1997, sect. 2).
class Expansion {
 public:
  void AddProduct(double a, double b) {
    const double product = a * b;
    Add(std::fma(a, b, -product));
    Add(product);
  }

  int Sign() const {
    for (int i = size_ - 1; i >= 0; --i) {
      if (component_[i] != 0) return component_[i] > 0 ? 1 : -1;
    }
    return 0;
  }

 private:
  // Grow-expansion by two-sums.
  void Add(double value) {
    double sum = value;
    for (int i = 0; i < size_; ++i) {
      const double a = sum, b = component_[i];
      sum = a + b;
      const double virtual_b = sum - a;
      component_[i] = (a - (sum - virtual_b)) + (b - virtual_b);
    }
    component_[size_++] = sum;
  }

  double component_[12];
  int size_ = 0;
};

// The first corner k of the counter-clockwise triangle s such that all of t is on or outside of the edge from k to the
// next corner; -1 if no edge separates them.
int SeparatingEdge(const Vec2 s[3], const Vec2 t[3]) {
  for (int k = 0; k < 3; ++k) {
    const Vec2 &from = s[k], &to = s[Next(k)];
    if (Orientation(from, to, t[0]) <= 0 && Orientation(from, to, t[1]) <= 0 && Orientation(from, to, t[2]) <= 0) {
      return k;
    }
  }
  return -1;
}

// Within these exponents, products and their rounding errors neither overflow nor underflow.
constexpr int kLeastExponent = -484, kMostExponent = 500;

bool HasExactProducts(double x) {
  const double size = std::abs(x);
  return size == 0 || (size >= std::ldexp(1.0, kLeastExponent) && size < std::ldexp(1.0, kMostExponent));
}

// Orientation() of points whose coordinates have exact products (HasExactProducts()).
int SignByExpansion(const Vec2& a, const Vec2& b, const Vec2& c) {
  Expansion determinant;
  determinant.AddProduct(a.x(), b.y());
  determinant.AddProduct(-a.x(), c.y());
  determinant.AddProduct(-c.x(), b.y());
  determinant.AddProduct(-a.y(), b.x());
  determinant.AddProduct(a.y(), c.x());
  determinant.AddProduct(c.y(), b.x());
  return determinant.Sign();
}

}  // namespace

int OrientationByExpansion(const Vec2& a, const Vec2& b, const Vec2& c) {
  // Equal points are common, since triangles share corners.
  if (a == b || b == c || c == a) return 0;
  const auto is_exact = [](const Vec2& p) { return HasExactProducts(p.x()) && HasExactProducts(p.y()); };
  if (is_exact(a) && is_exact(b) && is_exact(c)) return SignByExpansion(a, b, c);
  const double largest = std::max({a.cwiseAbs().maxCoeff(), b.cwiseAbs().maxCoeff(), c.cwiseAbs().maxCoeff()});
  int exponent = 0;
  std::frexp(largest, &exponent);
  const auto scaled = [by = kMostExponent - exponent](const Vec2& p) {
    return Vec2(std::ldexp(p.x(), by), std::ldexp(p.y(), by));
  };
  return SignByExpansion(scaled(a), scaled(b), scaled(c));
}

bool InteriorsMeet(const Vec2 s[3], const Vec2 t[3]) {
  return SeparatingEdge(s, t) < 0 && SeparatingEdge(t, s) < 0;
}

int VerticalOrder(const Vec2 s[3], const Vec2 t[3]) {
  // A counter-clockwise triangle lies above its edges that run to the right.
  if (const int k = SeparatingEdge(s, t); k >= 0) return SweepsFirst(s[k], s[Next(k)]) ? 1 : -1;
  if (const int k = SeparatingEdge(t, s); k >= 0) return SweepsFirst(t[k], t[Next(k)]) ? -1 : 1;
  return 0;
}

bool SegmentsMeet(const Vec2& a, const Vec2& b, const Vec2& c, const Vec2& d) {
  const int c_side = Orientation(a, b, c), d_side = Orientation(a, b, d);
  const int a_side = Orientation(c, d, a), b_side = Orientation(c, d, b);
  if (c_side * d_side < 0 && a_side * b_side < 0) return true;
  const Box ab = Box::Around(a, b), cd = Box::Around(c, d);
  return (c_side == 0 && ab.Has(c)) || (d_side == 0 && ab.Has(d)) || (a_side == 0 && cd.Has(a)) ||
         (b_side == 0 && cd.Has(b));
}

double SquaredDistanceToSegment(const Vec2& p, const Vec2& a, const Vec2& b) {
  const Vec2 along = b - a;
  const double length2 = along.squaredNorm();
  const double t = length2 > 0 ? std::clamp((p - a).dot(along) / length2, 0.0, 1.0) : 0;
  return (p - a - t * along).squaredNorm();
}

double SquaredDistance(const Vec2& a, const Vec2& b, const Vec2& c, const Vec2& d) {
  const double square = std::min({SquaredDistanceToSegment(a, c, d), SquaredDistanceToSegment(b, c, d),
                                  SquaredDistanceToSegment(c, a, b), SquaredDistanceToSegment(d, a, b)});
  return square > 0 && SegmentsMeet(a, b, c, d) ? 0 : square;
}

}  // namespace planish
