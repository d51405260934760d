// Sine and cosine of the angles of triangles, from additions and products alone: loops become vector code, and every
// machine gives the same bits, which the C library does not promise.
#pragma once

#include <cmath>
#include <numbers>

namespace planish {

struct SineCosine {
  double sine, cosine;
};

// A polynomial in u by Horner's rule, the coefficient of the highest power first.
template <typename... Rest>
double Horner(double u, double sum, Rest... rest) {
  ((sum = sum * u + rest), ...);
  return sum;
}

// For angles in [0, pi]. The sine to 4 units in its last place, near pi too; the cosine to 4e-16.
inline SineCosine SineAndCosine(double angle) {
  constexpr double kPiLow = 1.2246467991473532e-16;  // pi minus std::numbers::pi
  const double supplement = (std::numbers::pi - angle) + kPiLow;
  // Taylor series at half of the acute angle, at most pi / 4, with terms to beyond double's precision.
  const double t = 0.5 * (angle < supplement ? angle : supplement);
  const double u = t * t;
  const double s = t + t * (u * Horner(u, 1.0 / 355687428096000, -1.0 / 1307674368000, 1.0 / 6227020800,
                                       -1.0 / 39916800, 1.0 / 362880, -1.0 / 5040, 1.0 / 120, -1.0 / 6));
  const double c = 1 - u * (0.5 - u * Horner(u, 1.0 / 20922789888000, -1.0 / 87178291200, 1.0 / 479001600,
                                             -1.0 / 3628800, 1.0 / 40320, -1.0 / 720, 1.0 / 24));
  return {2 * s * c, std::copysign((c - s) * (c + s), std::numbers::pi / 2 - angle)};
}

}  // namespace planish
