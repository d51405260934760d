#include "core/pack/necks.h"

#include <algorithm>
#include <cmath>
#include <numbers>

#include "core/mesh/predicates.h"
#include "core/pack/outline.h"
#include "gtest/gtest.h"
#include "tests/testing/dice.h"

namespace planish {
namespace {

// Points every 0.25 along the sides of a polygon.
std::vector<Vec2> AlongSides(const std::vector<Vec2>& corners) {
  std::vector<Vec2> points;
  for (std::size_t i = 0; i < corners.size(); ++i) {
    const Vec2 &a = corners[i], &b = corners[(i + 1) % corners.size()];
    const double parts = std::round((b - a).norm() / 0.25);
    for (double k = 0; k < parts; ++k) points.push_back(a + k / parts * (b - a));
  }
  return points;
}

TEST(FindNecks, CutsTheArmsOfACrossFromItsMiddle) {
  const std::vector<Vec2> outline =
      AlongSides({{1, 1}, {1, 0}, {2, 0}, {2, 1}, {5, 1}, {5, 2}, {2, 2}, {2, 3}, {1, 3}, {1, 2}, {0, 2}, {0, 1}});
  // Hull and outline are 4.5 apart; a cut at x = 2 leaves 2, between the hull of the plus at the left and itself.
  const auto chords = FindNecks(outline, {1, 0.01});
  ASSERT_FALSE(chords.empty());
  EXPECT_EQ(outline[chords[0].from].x(), 2);
  EXPECT_EQ(outline[chords[0].to].x(), 2);
  for (const auto& [i, j, gain] : chords) {
    EXPECT_NEAR((outline[i] - outline[j]).norm(), 1, 0.5);
    EXPECT_GE(gain, 1);
    EXPECT_LE(gain, chords[0].gain);
  }
  EXPECT_TRUE(FindNecks(outline, {4, 0.01}).empty());
  EXPECT_TRUE(FindNecks(outline, {1, 10}).empty()) << "cuts cost more than they gain";
}

TEST(FindNecks, LeavesAConvexOutlineAlone) {
  EXPECT_TRUE(FindNecks(AlongSides({{0, 0}, {7, 0}, {9, 3}, {0, 4}}), {1e-9, 0}).empty());
}

TEST(FindNecks, CutsInsideOfAnOutlineOnly) {
  // A horseshoe: the chord between its ends would gain most, but runs outside.
  const std::vector<Vec2> outline = AlongSides({{0, 0}, {6, 0}, {6, 6}, {4, 6}, {4, 2}, {2, 2}, {2, 6}, {0, 6}});
  const auto chords = FindNecks(outline, {0.5, 0.01});
  ASSERT_FALSE(chords.empty());
  for (const auto& [i, j, gain] : chords) {
    const Vec2 middle = (outline[i] + outline[j]) / 2;
    EXPECT_FALSE(middle.x() > 2 && middle.x() < 4 && middle.y() > 2) << middle.transpose();
  }
}

// Points in every direction from the origin, at random distances.
std::vector<Vec2> Star(int n, testing::Dice* dice) {
  std::vector<Vec2> outline;
  for (int i = 0; i < n; ++i) {
    const double angle = 2 * std::numbers::pi * (i + dice->In(0.1, 0.9)) / n;
    outline.push_back(dice->In(0.2, 1) * Vec2(std::cos(angle), std::sin(angle)));
  }
  return outline;
}

// Whether the segment between points i and j of a star lies inside.
bool IsInsideStar(const std::vector<Vec2>& star, std::size_t i, std::size_t j) {
  const Vec2 middle = (star[i] + star[j]) / 2;
  for (std::size_t k = 0; k < star.size(); ++k) {
    const std::size_t next = (k + 1) % star.size();
    const Vec2 &a = star[k], &b = star[next];
    const bool is_in_sector = Orientation(Vec2(0, 0), a, middle) > 0 && Orientation(Vec2(0, 0), middle, b) > 0;
    if (is_in_sector && Orientation(a, b, middle) <= 0) return false;
    const bool has_end = k == i || k == j || next == i || next == j;
    if (!has_end && SegmentsMeet(star[i], star[j], a, b)) return false;
  }
  return true;
}

TEST(FindNecks, FindsTheCutThatGainsMost) {
  const auto hull_area = [](const std::vector<Vec2>& points) { return AreaWithin(ConvexHull(points)); };
  testing::Dice dice(7);
  int cut = 0;
  for (int round = 0; round < 300; ++round) {
    const std::vector<Vec2> star = Star(5 + dice.Below(25), &dice);
    const NeckOptions options = {dice.In(0.001, 0.1), dice.In(0, 0.05)};
    double most = 0;
    for (std::size_t i = 0; i < star.size(); ++i) {
      for (std::size_t j = i + 2; j < star.size() && j + 1 < star.size() + i; ++j) {
        if (!IsInsideStar(star, i, j)) continue;
        const auto from = star.begin() + static_cast<std::ptrdiff_t>(i),
                   to = star.begin() + static_cast<std::ptrdiff_t>(j);
        std::vector<Vec2> outer(star.begin(), from + 1);
        outer.insert(outer.end(), to, star.end());
        const double cost = options.width * (star[i] - star[j]).norm();
        most = std::max(most, hull_area(star) - hull_area({from, to + 1}) - hull_area(outer) - cost);
      }
    }
    const std::vector<Neck> necks = FindNecks(star, options);
    ASSERT_EQ(necks.empty(), most <= options.least_gain) << round;
    if (necks.empty()) continue;
    EXPECT_NEAR(necks[0].gain, most, 1e-12) << round;
    ++cut;
  }
  EXPECT_GT(cut, 200);
}

}  // namespace
}  // namespace planish
