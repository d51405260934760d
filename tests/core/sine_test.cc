#include "core/abf/sine.h"

#include <cmath>
#include <limits>
#include <numbers>

#include "gtest/gtest.h"

namespace planish {
namespace {

constexpr double kUlp = std::numeric_limits<double>::epsilon();

void ExpectSineAndCosine(double angle) {
  const auto [sine, cosine] = SineAndCosine(angle);
  const long double expected = std::sin(static_cast<long double>(angle));
  EXPECT_LE(std::abs(sine - expected), 4 * kUlp * std::abs(expected)) << angle;
  EXPECT_LE(std::abs(cosine - std::cos(static_cast<long double>(angle))), 4e-16) << angle;
}

TEST(SineAndCosine, AreThoseOfEveryAngle) {
  constexpr int kAngles = 100'000;
  for (int i = 0; i <= kAngles; ++i) ExpectSineAndCosine(std::numbers::pi * i / kAngles);
}

TEST(SineAndCosine, AreExactAsFarAsTheAngleIsNearBothEnds) {
  for (double small = 1; small > 1e-300; small /= 1.7) {
    ExpectSineAndCosine(small);
    ExpectSineAndCosine(std::numbers::pi - small);
  }
  EXPECT_EQ(SineAndCosine(0).sine, 0);
  EXPECT_EQ(SineAndCosine(0).cosine, 1);
  EXPECT_NEAR(SineAndCosine(std::numbers::pi).cosine, -1, kUlp);
}

TEST(SineAndCosine, ChangeSignWhereTheyShould) {
  const double right = std::numbers::pi / 2;
  EXPECT_GT(SineAndCosine(std::nextafter(right, 0)).cosine, 0);
  EXPECT_LT(SineAndCosine(std::nextafter(right, 4)).cosine, 0);
  EXPECT_LT(SineAndCosine(-1e-9).sine, 0);
  EXPECT_TRUE(std::isnan(SineAndCosine(std::numeric_limits<double>::quiet_NaN()).sine));
}

}  // namespace
}  // namespace planish
