// Sine and cosine of angles of triangles. Made of additions and products alone, so that loops over them turn into vector
// code and every machine gives the same bits, which the C library's do not promise.
#pragma once

#include <cmath>
#include <numbers>

namespace planish {

struct SineCosine {
  double sine, cosine;
};

// For angles in [0, pi]. The sine to 4 units in its last place, near pi too; the cosine to 4e-16.
inline SineCosine SineAndCosine(double angle) {
  constexpr double kPiLow = 1.2246467991473532e-16;  // what std::numbers::pi lacks
  const double supplement = (std::numbers::pi - angle) + kPiLow;
  // Taylor series at half of the acute angle, at most pi / 4, with terms to beyond double's precision.
  const double t = 0.5 * (angle < supplement ? angle : supplement);
  const double u = t * t;
  double s = 1.0 / 355687428096000;
  s = s * u - 1.0 / 1307674368000;
  s = s * u + 1.0 / 6227020800;
  s = s * u - 1.0 / 39916800;
  s = s * u + 1.0 / 362880;
  s = s * u - 1.0 / 5040;
  s = s * u + 1.0 / 120;
  s = s * u - 1.0 / 6;
  s = t + t * (s * u);
  double c = 1.0 / 20922789888000;
  c = c * u - 1.0 / 87178291200;
  c = c * u + 1.0 / 479001600;
  c = c * u - 1.0 / 3628800;
  c = c * u + 1.0 / 40320;
  c = c * u - 1.0 / 720;
  c = c * u + 1.0 / 24;
  c = 1 - u * (0.5 - c * u);
  return {2 * s * c, std::copysign((c - s) * (c + s), std::numbers::pi / 2 - angle)};
}

}  // namespace planish
