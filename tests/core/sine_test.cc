#include <cmath>
#include <limits>
#include <numbers>

#include "core/base/portable_math.h"
#include "gtest/gtest.h"

namespace planish::portable {
namespace {

constexpr double kUlp = std::numeric_limits<double>::epsilon();

void ExpectSineAndCosine(double angle) {
  const auto [sine, cosine] = SinCosInTriangle(angle);
  const long double expected = std::sin(static_cast<long double>(angle));
  EXPECT_LE(std::abs(sine - expected), 4 * kUlp * std::abs(expected)) << angle;
  EXPECT_LE(std::abs(cosine - std::cos(static_cast<long double>(angle))), 4e-16) << angle;
}

TEST(SinCosInTriangle, AreThoseOfEveryAngle) {
  constexpr int kAngles = 100'000;
  for (int i = 0; i <= kAngles; ++i) ExpectSineAndCosine(std::numbers::pi * i / kAngles);
}

TEST(SinCosInTriangle, AreExactAsFarAsTheAngleIsNearBothEnds) {
  for (double small = 1; small > 1e-300; small /= 1.7) {
    ExpectSineAndCosine(small);
    ExpectSineAndCosine(std::numbers::pi - small);
  }
  EXPECT_EQ(SinCosInTriangle(0).sine, 0);
  EXPECT_EQ(SinCosInTriangle(0).cosine, 1);
  EXPECT_NEAR(SinCosInTriangle(std::numbers::pi).cosine, -1, kUlp);
}

TEST(SinCosInTriangle, ChangeSignWhereTheyShould) {
  const double right = std::numbers::pi / 2;
  EXPECT_GT(SinCosInTriangle(std::nextafter(right, 0)).cosine, 0);
  EXPECT_LT(SinCosInTriangle(std::nextafter(right, 4)).cosine, 0);
  EXPECT_LT(SinCosInTriangle(-1e-9).sine, 0);
  EXPECT_TRUE(std::isnan(SinCosInTriangle(std::numeric_limits<double>::quiet_NaN()).sine));
}

}  // namespace
}  // namespace planish::portable
