// All charts have the texel density that is told; where they cannot, a warning says so in the caller's faces
// (core/unwrap/density.cc, long_needles.h). On random polygons, which come as triangles that must not be parted.
#include <algorithm>
#include <cmath>
#include <cstdint>
#include <string>
#include <vector>

#include "core/unwrap/unwrap.h"
#include "gmock/gmock.h"
#include "gtest/gtest.h"
#include "tests/core/promises.h"
#include "tests/testing/dice.h"

namespace planish {
namespace {

using ::testing::ElementsAreArray;
using ::testing::IsEmpty;

// Polygons side by side, each cut up from its last corner.
struct PolygonSoup {
  Mesh mesh;
  std::vector<std::int32_t> polygon;                 // of each triangle
  std::vector<std::vector<std::int32_t>> triangles;  // of each polygon
  double place = 0;                                  // of the next polygon, along y

  // A polygon round a rectangle at the origin, moved to where there is room.
  void Add(const std::vector<Vec2>& corners) {
    const auto first = static_cast<std::int32_t>(mesh.positions.size());
    const auto last = first + static_cast<std::int32_t>(corners.size()) - 1;
    double height = 0;
    for (const Vec2& p : corners) {
      mesh.positions.emplace_back(p.x(), place + p.y(), 0);
      height = std::max(height, p.y());
    }
    place += height + 1;
    triangles.emplace_back();
    for (std::int32_t v = first; v + 1 < last; ++v) {
      const auto f = static_cast<std::int32_t>(mesh.faces.size());
      polygon.push_back(static_cast<std::int32_t>(triangles.size()) - 1);
      triangles.back().push_back(f);
      mesh.faces.push_back({v, v + 1, last});
    }
  }
  void AddRectangle(double width, double height) { Add({{0, 0}, {width, 0}, {width, height}, {0, height}}); }
  // With corners a hair beside the lower side: the triangles at these are needles as long as the rectangle.
  void AddRectangleWithNeedles(double width, double height, int needles, double hair) {
    std::vector<Vec2> corners = {{0, 0}};
    for (int i = 1; i <= needles; ++i) corners.emplace_back(width * i / (needles + 1), -hair * i * (needles + 1 - i));
    corners.insert(corners.end(), {Vec2(width, 0), Vec2(width, height), Vec2(0, height)});
    std::rotate(corners.begin(), corners.begin() + needles + 2, corners.end());
    Add(corners);
  }
  UnwrapOptions Options() const {
    UnwrapOptions options;
    options.face_polygon = polygon;
    return options;
  }
};

const UnwrapWarning* WarningIn(const UnwrapResult& result, const std::string& reason) {
  for (const UnwrapWarning& warning : result.warnings) {
    if (warning.reason == reason) return &warning;
  }
  return nullptr;
}

TEST(Density, IsTheSameWhereNeedlesLieInPolygons) {
  for (std::uint64_t seed = 1; seed <= 40; ++seed) {
    testing::Dice dice(seed);
    PolygonSoup soup;
    const int count = 2 + static_cast<int>(dice.In(0, 4));
    for (int i = 0; i < count; ++i) {
      soup.AddRectangleWithNeedles(dice.In(8, 20), dice.In(0.3, 1), static_cast<int>(dice.In(0, 4)),
                                   std::pow(10, dice.In(-7, -3)));
    }
    const UnwrapOptions options = soup.Options();
    const auto result = Unwrap(soup.mesh, options, {});
    ASSERT_TRUE(result.ok()) << result.status();
    EXPECT_THAT(testing::BrokenPromises(soup.mesh, options, result), IsEmpty()) << seed;
    EXPECT_EQ(WarningIn(*result, "CHARTS_REDUCED"), nullptr) << seed;
  }
}

TEST(Density, OfLongNeedlesIsNamedInPolygons) {
  PolygonSoup soup;
  for (int i = 0; i < 6; ++i) soup.AddRectangle(1, 1);
  soup.AddRectangle(3000, 1e-3);
  soup.AddRectangle(5000, 1e-3);
  const UnwrapOptions options = soup.Options();
  const auto result = Unwrap(soup.mesh, options, {});
  EXPECT_THAT(testing::BrokenPromises(soup.mesh, options, result), IsEmpty());
  const UnwrapWarning* const warning = WarningIn(*result, "CHARTS_REDUCED");
  ASSERT_NE(warning, nullptr);
  EXPECT_THAT(warning->message, ::testing::StartsWith("2 faces are needles")) << "not 4 triangles";
  EXPECT_EQ(warning->metadata.at("count"), "4");
  EXPECT_EQ(warning->metadata.at("polygons"), "2");
  std::vector<std::int32_t> faces = warning->faces;
  std::sort(faces.begin(), faces.end());
  EXPECT_THAT(faces, ElementsAreArray({12, 13, 14, 15}));
}

TEST(Density, IsSetByLongFacesWithAWarning) {
  for (std::uint64_t seed = 1; seed <= 30; ++seed) {
    testing::Dice dice(seed);
    PolygonSoup soup, cut;
    const int squares = 8 + static_cast<int>(dice.In(0, 20));
    for (int i = 0; i < squares; ++i) {
      const double side = dice.In(0.5, 1.5);
      soup.AddRectangle(side, side);
      cut.AddRectangle(side, side);
    }
    const double length = dice.In(50, 150), width = length / dice.In(300, 900);
    soup.AddRectangle(length, width);
    for (int i = 0; i < 50; ++i) cut.AddRectangle(length / 50, width);
    const UnwrapOptions options = soup.Options();
    const auto result = Unwrap(soup.mesh, options, {});
    EXPECT_THAT(testing::BrokenPromises(soup.mesh, options, result), IsEmpty()) << seed;
    const UnwrapWarning* const warning = WarningIn(*result, "FACES_TOO_LONG");
    ASSERT_NE(warning, nullptr) << seed;
    EXPECT_THAT(warning->faces, ElementsAreArray(soup.triangles.back())) << seed;
    EXPECT_EQ(warning->metadata.at("polygons"), "1");
    // What the warning says that others could have is about what they have once the face is cut.
    const auto with_cuts = Unwrap(cut.mesh, cut.Options(), {});
    ASSERT_TRUE(with_cuts.ok()) << with_cuts.status();
    EXPECT_EQ(WarningIn(*with_cuts, "FACES_TOO_LONG"), nullptr) << seed;
    const double denser = with_cuts->texels_per_unit / result->texels_per_unit;
    EXPECT_GT(denser, 2) << seed;
    EXPECT_NEAR(std::stod(warning->metadata.at("denser")) / denser, 1, 0.35) << seed;
  }
}

// The same is said of triangles, and with given seams, where nothing else may be cut.
TEST(Density, IsSetByLongTrianglesWithAWarning) {
  PolygonSoup soup;
  for (int i = 0; i < 20; ++i) soup.AddRectangle(1, 1);
  soup.Add({{0, 0}, {80, 0}, {0, 0.2}});
  for (const SeamPolicy policy : {SeamPolicy::kAuto, SeamPolicy::kNeeded, SeamPolicy::kKeep}) {
    UnwrapOptions options;
    options.seams.policy = policy;
    const auto result = Unwrap(soup.mesh, options, {});
    ASSERT_TRUE(result.ok()) << result.status();
    const UnwrapWarning* const warning = WarningIn(*result, "FACES_TOO_LONG");
    ASSERT_NE(warning, nullptr);
    EXPECT_THAT(warning->faces, ElementsAreArray({40}));
  }
}

TEST(Density, OfChartsBelowATexelIsNamed) {
  PolygonSoup soup;
  soup.AddRectangle(100, 100);
  for (int i = 0; i < 5; ++i) soup.AddRectangle(0.01, 0.01);
  const UnwrapOptions options = soup.Options();
  const auto result = Unwrap(soup.mesh, options, {});
  EXPECT_THAT(testing::BrokenPromises(soup.mesh, options, result), IsEmpty());
  const UnwrapWarning* const warning = WarningIn(*result, "DENSITY_VARIES");
  ASSERT_NE(warning, nullptr);
  EXPECT_EQ(warning->metadata.at("chart_count"), "5");
  EXPECT_EQ(warning->metadata.at("polygons"), "5");
}

}  // namespace
}  // namespace planish
