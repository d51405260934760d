#include "core/base/portable_math.h"

#include <cmath>
#include <functional>
#include <limits>
#include <random>

#include "absl/strings/str_cat.h"
#include "gtest/gtest.h"
#include "tests/core/shapes.h"
#include "tests/core/uv_digest.h"

namespace planish {
namespace {

constexpr double kInfinity = std::numeric_limits<double>::infinity();
constexpr double kNaN = std::numeric_limits<double>::quiet_NaN();

// Between the two, in units in the last place of the exact value; that of long double, which has 11 bits more on x86,
// is taken for exact.
double UnitsApart(double found, long double exact) {
  const double rounded = static_cast<double>(exact);
  const double unit = std::nextafter(std::abs(rounded), kInfinity) - std::abs(rounded);
  return static_cast<double>(std::abs(found - exact)) / unit;
}

// The worst of many arguments, evenly spread over [low, high].
double Worst(double low, double high, const std::function<double(double)>& found,
             const std::function<long double(long double)>& exact) {
  std::mt19937_64 random(5);
  std::uniform_real_distribution<double> argument(low, high);
  double worst = 0;
  for (int i = 0; i < 200000; ++i) {
    const double x = argument(random);
    worst = std::max(worst, UnitsApart(found(x), exact(x)));
  }
  return worst;
}

TEST(PortableMath, IsRightToAUnitInTheLastPlace) {
  if (std::numeric_limits<long double>::digits < 64) GTEST_SKIP() << "long double is double here";
  using L = long double;
  const auto sine = [](L x) { return std::sin(x); };
  const auto cosine = [](L x) { return std::cos(x); };
  for (const double range : {0.1, 0.8, 3.2, 100.0, 9e5}) {
    EXPECT_LE(Worst(-range, range, portable::Sin, sine), 1) << range;
    EXPECT_LE(Worst(-range, range, portable::Cos, cosine), 1) << range;
    EXPECT_LE(Worst(-range, range, portable::Tan, [](L x) { return std::tan(x); }), 3) << range;
  }
  for (const double range : {1e-3, 0.4, 5.0, 700.0}) {
    EXPECT_LE(Worst(-range, range, portable::Exp, [](L x) { return std::exp(x); }), 1) << range;
  }
  for (const double range : {1e-300, 0.5, 1.5, 1e9, 1e300}) {
    EXPECT_LE(Worst(0, range, portable::Log, [](L x) { return std::log(x); }), 1) << range;
  }
  EXPECT_LE(Worst(0.999, 1.001, portable::Log, [](L x) { return std::log(x); }), 1);
  for (const double x : {1.0, -1.0, 1e-5, -1e-5, 1e5, -1e5, 1e200, -1e-200}) {
    for (const double range : {1e-3, 1.0, 1e3, 1e200}) {
      EXPECT_LE(Worst(
                    -range, range, [&](double y) { return portable::Atan2(y, x); },
                    [&](L y) { return std::atan2(y, static_cast<L>(x)); }),
                2)
          << range << " " << x;
    }
    EXPECT_LE(Worst(
                  -10, 10, [&](double y) { return portable::Hypot(y, x); },
                  [&](L y) { return std::hypot(y, static_cast<L>(x)); }),
              2)
        << x;
  }
}

void ExpectSame(double found, double expected) {
  if (std::isnan(expected)) {
    EXPECT_TRUE(std::isnan(found)) << found;
  } else {
    EXPECT_DOUBLE_EQ(found, expected);
    EXPECT_EQ(std::signbit(found), std::signbit(expected));
  }
}

TEST(PortableMath, TreatsOddArgumentsAsTheLibraryDoes) {
  const double odd[] = {0.0, -0.0, 1.0, -1.0, 5e-324, -5e-324, 2.2e-308, 1.7e308, kInfinity, -kInfinity, kNaN};
  for (const double y : odd) {
    SCOPED_TRACE(y);
    ExpectSame(portable::Log(y), std::log(y));
    ExpectSame(portable::Exp(y), std::exp(y));
    for (const double x : odd) {
      SCOPED_TRACE(x);
      ExpectSame(portable::Atan2(y, x), std::atan2(y, x));
      if (!std::isnan(x) && !std::isnan(y)) ExpectSame(portable::Hypot(y, x), std::hypot(y, x));
    }
  }
  EXPECT_TRUE(std::isnan(portable::Sin(kInfinity)));
  EXPECT_TRUE(std::isnan(portable::Cos(kNaN)));
  ExpectSame(portable::Sin(-0.0), -0.0);
  EXPECT_EQ(portable::Exp(-746), 0);
  EXPECT_EQ(portable::Exp(710), kInfinity);
  EXPECT_GT(portable::Exp(-745), 0);
  EXPECT_LT(portable::Exp(709.7), kInfinity);
}

// Shapes are made by the C library's functions, whose last bits depend on the CPU: rounded to float, they do not.
Mesh Rounded(Mesh mesh) {
  for (Vec3& p : mesh.positions) p = p.cast<float>().cast<double>();
  return mesh;
}

// Discs and closed surfaces, small and large ones, every kind of map and packing.
TEST(PortableMath, TheSameUvOnEveryCpu) {
  testing::ExpectTheSameOnEveryCpu([] {
    UnwrapOptions disc, convex, atlas;
    disc.seams.policy = convex.seams.policy = SeamPolicy::kNone;
    convex.flatten.boundary = BoundaryType::kConvex;
    const auto digest = [](const Mesh& mesh, const UnwrapOptions& options) {
      return testing::UvDigest(Rounded(mesh), options);
    };
    return absl::StrCat(digest(testing::Hills(12, 10, 1.5), disc), " ", digest(testing::Hills(60, 50, 1.5), disc), " ",
                        digest(testing::PuncturedSphere(20, 0.7), disc), " ", digest(testing::Hills(20, 20, 2), convex),
                        " ", digest(testing::Star(6), convex), " ", digest(testing::Torus(40, 30), atlas), " ",
                        digest(testing::PuncturedSphere(16, 0.01), atlas));
  });
}

}  // namespace
}  // namespace planish
