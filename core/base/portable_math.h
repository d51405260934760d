// Elementary functions that give the same bits on every machine.
//
// The C library picks its exp, log, sin, cos, tan and atan2 by the CPU it runs on: those with fused multiply-adds
// differ from the others in the last bit. The functions here are made of additions, products, quotients and square
// roots alone, which IEEE 754 defines to the last bit, and of integer operations. (x86-64 at its baseline has no fused
// multiply-add that a compiler could slip in; on other targets compile with -ffp-contract=off.)
//
// Results are within 1 unit in the last place of the exact value, unless a comment says otherwise
// (tests/core/portable_math_test.cc). Angles are in radians.
#pragma once

#include <bit>
#include <cmath>
#include <cstdint>
#include <limits>
#include <numbers>

namespace planish::portable {

namespace internal {

inline constexpr double kInfinity = std::numeric_limits<double>::infinity();
inline constexpr double kNaN = std::numeric_limits<double>::quiet_NaN();

inline constexpr double kPiLow = 1.2246467991473532e-16;  // pi minus std::numbers::pi

// ln 2 in two parts; products of the first with whole numbers below 2^20 are exact.
inline constexpr double kLn2High = 6.93147180369123816490e-01, kLn2Low = 1.90821492927058770002e-10;

// The nearest whole number to x, |x| < 2^51.
inline double Nearest(double x) {
  constexpr double kShift = 6755399441055744.0;  // 1.5 * 2^52: a sum with it has no bits for a fraction
  return (x + kShift) - kShift;
}

// 2^n for n in [-1022, 1023].
inline double PowerOfTwo(int n) {
  return std::bit_cast<double>(static_cast<std::uint64_t>(n + 1023) << 52);
}

// A polynomial in u by Horner's rule, the coefficient of the highest power first.
template <typename... Rest>
double Horner(double u, double sum, Rest... rest) {
  ((sum = sum * u + rest), ...);
  return sum;
}

// An angle as quadrant * pi / 2 + (r + rest) with |r| <= pi / 4 (and a little).
struct ReducedAngle {
  double r, rest;
  int quadrant;  // modulo 4
};
inline ReducedAngle Reduce(double x) {
  // pi / 2 in parts of 33 bits: products with whole numbers below 2^20 are exact (Cody and Waite 1980).
  constexpr double kFirst = 1.57079632673412561417e+00, kSecond = 6.07710050630396597660e-11,
                   kThird = 2.02226624879595063154e-21;
  const double n = Nearest(x * (2 * std::numbers::inv_pi));
  const double first = x - n * kFirst;
  const double second = first - n * kSecond;
  const double third = n * kThird - ((first - second) - n * kSecond);
  const double r = second - third;
  return {r, (second - r) - third, static_cast<int>(static_cast<std::int64_t>(n) & 3)};
}

// Taylor series at 0; the terms left out are below 1e-18.
inline double SineNearZero(double r, double rest) {
  const double u = r * r, v = u * r;
  const double p = Horner(u, 1.0 / 355687428096000, -1.0 / 1307674368000, 1.0 / 6227020800, -1.0 / 39916800,
                          1.0 / 362880, -1.0 / 5040, 1.0 / 120);
  return r - ((u * (0.5 * rest - v * p) - rest) + v * (1.0 / 6));
}
inline double CosineNearZero(double r, double rest) {
  const double u = r * r;
  const double p = Horner(u, 1.0 / 20922789888000, -1.0 / 87178291200, 1.0 / 479001600, -1.0 / 3628800, 1.0 / 40320,
                          -1.0 / 720, 1.0 / 24);
  const double half = 0.5 * u, w = 1 - half;
  return w + (((1 - w) - half) + (u * u * p - r * rest));
}

}  // namespace internal

struct SineCosine {
  double sine, cosine;
};

// The sine and cosine of x, for |x| <= 1e6. NaN for larger angles, infinities and NaN.
inline SineCosine SinCos(double x) {
  if (!(std::abs(x) <= 1e6)) return {internal::kNaN, internal::kNaN};
  const internal::ReducedAngle a = internal::Reduce(x);
  const double s = internal::SineNearZero(a.r, a.rest), c = internal::CosineNearZero(a.r, a.rest);
  switch (a.quadrant) {
    case 0:
      return {s, c};
    case 1:
      return {c, -s};
    case 2:
      return {-s, -c};
    default:
      return {-c, s};
  }
}
inline double Sin(double x) {
  return SinCos(x).sine;
}
inline double Cos(double x) {
  return SinCos(x).cosine;
}
// The tangent of x, to 3 units in the last place.
inline double Tan(double x) {
  const auto [sine, cosine] = SinCos(x);
  return sine / cosine;
}

// The sine and cosine of an angle of a triangle, in [0, pi]. Without branches, so that loops are vectorized. The sine
// is exact to 4 units in its last place, near pi too; the cosine to 4e-16.
inline SineCosine SinCosInTriangle(double angle) {
  const double supplement = (std::numbers::pi - angle) + internal::kPiLow;
  // Taylor series for half of `angle` or of its supplement, whichever is smaller: at most pi / 4. The terms left out
  // are below double's precision.
  const double t = 0.5 * (angle < supplement ? angle : supplement);
  const double u = t * t;
  const double s = t + t * (u * internal::Horner(u, 1.0 / 355687428096000, -1.0 / 1307674368000, 1.0 / 6227020800,
                                                 -1.0 / 39916800, 1.0 / 362880, -1.0 / 5040, 1.0 / 120, -1.0 / 6));
  const double c = 1 - u * (0.5 - u * internal::Horner(u, 1.0 / 20922789888000, -1.0 / 87178291200, 1.0 / 479001600,
                                                       -1.0 / 3628800, 1.0 / 40320, -1.0 / 720, 1.0 / 24));
  return {2 * s * c, std::copysign((c - s) * (c + s), std::numbers::pi / 2 - angle)};
}

// The angle of (x, y) in [-pi, pi], to 2 units in the last place. Signs of zeros and infinities are those of
// std::atan2.
inline double Atan2(double y, double x) {
  // atan(i / 8) as the sum of two doubles.
  static constexpr struct {
    double high, low;
  } kTable[9] = {
      {0x0p+0, 0x0p+0},
      {0x1.fd5ba9aac2f6ep-4, -0x1.cd37686760c17p-59},
      {0x1.f5b75f92c80ddp-3, 0x1.8ab6e3cf7afbdp-57},
      {0x1.6f61941e4def1p-2, -0x1.c63aae6f6e918p-56},
      {0x1.dac670561bb4fp-2, 0x1.a2b7f222f65e2p-56},
      {0x1.1e00babdefeb4p-1, -0x1.928df287a668fp-58},
      {0x1.4978fa3269ee1p-1, 0x1.2419a87f2a458p-56},
      {0x1.700a7c5784634p-1, -0x1.8c34d25aadef6p-56},
      {0x1.921fb54442d18p-1, 0x1.1a62633145c07p-55},
  };
  if (std::isnan(x) || std::isnan(y)) return internal::kNaN;
  double across = std::abs(y), along = std::abs(x);
  if (std::isinf(across) || std::isinf(along)) {
    across = std::isinf(across) ? 1 : 0;
    along = std::isinf(along) ? 1 : 0;
  }
  const bool steep = across > along;
  double numerator = steep ? along : across, denominator = steep ? across : along;
  if (denominator > 0x1p500) {
    numerator *= 0x1p-600;
    denominator *= 0x1p-600;
  } else if (denominator < 0x1p-500) {
    numerator *= 0x1p600;
    denominator *= 0x1p600;
  }
  const double quotient = denominator > 0 ? numerator / denominator : 0;
  const int i = static_cast<int>(8 * quotient + 0.5);
  // atan(quotient) = atan(i / 8) + atan(t).
  const double t = i == 0 ? quotient : (8 * numerator - i * denominator) / (8 * denominator + i * numerator);
  const double u = t * t;
  // |t| <= 1 / 16: the terms left out are below 1e-18 t.
  const double p = internal::Horner(u, 1.0 / 15, -1.0 / 13, 1.0 / 11, -1.0 / 9, 1.0 / 7, -1.0 / 5, 1.0 / 3);
  const double small = t - t * (u * p);
  // Turns the angle into pi / 2 - angle if steep, and then into pi - angle if x is negative.
  double high = kTable[i].high, low = kTable[i].low, sign = 1;
  const auto reflect = [&](double at, double at_low) {
    const double sum = at - high;
    low = ((at - sum) - high) + (at_low - low);
    high = sum;
    sign = -sign;
  };
  if (steep) reflect(std::numbers::pi / 2, internal::kPiLow / 2);
  if (std::signbit(x)) reflect(std::numbers::pi, internal::kPiLow);
  return std::copysign(high + (low + sign * small), y);
}

// Natural logarithm: -infinity for 0, NaN for negative numbers.
inline double Log(double x) {
  constexpr std::uint64_t kLeastNormal = 0x0010000000000000, kInfiniteBits = 0x7ff0000000000000;
  double scale = 0;
  if (std::bit_cast<std::uint64_t>(x) - kLeastNormal >= kInfiniteBits - kLeastNormal) {
    if (x == 0) return -internal::kInfinity;
    if (x == internal::kInfinity) return x;
    if (!(x > 0)) return internal::kNaN;
    x *= 0x1p54;  // x is subnormal
    scale = -54;
  }
  // x = 2^k (1 + f) with 1 + f in [sqrt(1/2), sqrt(2)).
  constexpr std::uint64_t kSqrtHalf = 0x3fe6a09e667f3bcd;
  const std::uint64_t bits = std::bit_cast<std::uint64_t>(x);
  const std::int64_t exponent = static_cast<std::int64_t>(bits - kSqrtHalf) >> 52;
  const double k = static_cast<double>(exponent) + scale;
  const double f = std::bit_cast<double>(bits - (static_cast<std::uint64_t>(exponent) << 52)) - 1;
  // log(1 + f) = 2 atanh(s) = f - f^2 / 2 + s (f^2 / 2 + r), where s = f / (2 + f) and s r is the series of 2 atanh(s)
  // without its first term. Even and odd terms are summed separately, so that the CPU computes both at once.
  const double s = f / (2 + f), z = s * s, w = z * z;
  const double odd = z * (2.0 / 3 + w * (2.0 / 7 + w * (2.0 / 11 + w * (2.0 / 15 + w * (2.0 / 19 + w * (2.0 / 23))))));
  const double even = w * (2.0 / 5 + w * (2.0 / 9 + w * (2.0 / 13 + w * (2.0 / 17 + w * (2.0 / 21)))));
  const double half = 0.5 * f * f;
  return k * internal::kLn2High - ((half - (s * (half + (odd + even)) + k * internal::kLn2Low)) - f);
}

// e^x: 0 below -745.2 and infinity above 709.8.
inline double Exp(double x) {
  if (std::isnan(x)) return x;
  if (x > 709.79) return internal::kInfinity;
  if (x < -745.14) return 0;
  const double k = internal::Nearest(x * std::numbers::log2e);
  const double first = x - k * internal::kLn2High;
  const double r = first - k * internal::kLn2Low;
  const double rest = (first - r) - k * internal::kLn2Low;
  // |r| <= 0.35: the terms left out are below 1e-18.
  const double p =
      internal::Horner(r, 1.0 / 87178291200, 1.0 / 6227020800, 1.0 / 479001600, 1.0 / 39916800, 1.0 / 3628800,
                       1.0 / 362880, 1.0 / 40320, 1.0 / 5040, 1.0 / 720, 1.0 / 120, 1.0 / 24, 1.0 / 6, 1.0 / 2);
  const double value = 1 + (r + (rest + r * r * p));
  // Multiplies by 2^k in two steps, since 2^k itself may overflow or underflow.
  const int n = static_cast<int>(k), half = n / 2;
  return value * internal::PowerOfTwo(half) * internal::PowerOfTwo(n - half);
}

// The length of (x, y), to 2 units in the last place.
inline double Hypot(double x, double y) {
  x = std::abs(x);
  y = std::abs(y);
  const double larger = x > y ? x : y, smaller = x > y ? y : x;
  if (!(larger > 0) || std::isinf(larger)) return larger + smaller;
  const double ratio = smaller / larger;
  return larger * std::sqrt(1 + ratio * ratio);
}

}  // namespace planish::portable
