// Needles longer than the texture do not set the scale of the atlas (core/unwrap/long_needles.h).
#include "core/unwrap/long_needles.h"

#include <cmath>
#include <string>

#include "core/unwrap/unwrap.h"
#include "gmock/gmock.h"
#include "gtest/gtest.h"
#include "tests/core/promises.h"

namespace planish {
namespace {

using ::testing::Each;
using ::testing::IsEmpty;

// A bumpy sheet of 2 * 24 * 24 triangles, 2 by 2; every third vertex of one side is drawn out to a fin so long.
Mesh SheetWithFins(double length) {
  constexpr std::int32_t n = 24;
  Mesh mesh;
  for (int j = 0; j <= n; ++j) {
    for (int i = 0; i <= n; ++i) {
      const double x = (i - n / 2) / 12.0, y = (j - n / 2) / 12.0;
      mesh.positions.emplace_back(x, y, 0.1 * std::sin(3 * x) * std::cos(4 * y));
    }
  }
  for (std::int32_t j = 0; j < n; ++j) {
    for (std::int32_t i = 0; i < n; ++i) {
      const std::int32_t a = j * (n + 1) + i;
      mesh.faces.push_back({a, a + 1, a + n + 2});
      mesh.faces.push_back({a, a + n + 2, a + n + 1});
    }
  }
  for (std::int32_t i = 0; i + 1 < n; i += 3) {
    mesh.positions.push_back(mesh.positions[i] + Vec3(0, -length, 0));
    mesh.faces.push_back({i + 1, i, static_cast<std::int32_t>(mesh.positions.size()) - 1});
  }
  return mesh;
}

bool HasWarning(const UnwrapResult& result, const std::string& reason) {
  for (const UnwrapWarning& warning : result.warnings) {
    if (warning.reason == reason) return true;
  }
  return false;
}

std::vector<char> LongNeedlesOf(const Mesh& mesh) {
  return FindLongNeedles(mesh, Polygons(mesh.num_faces(), {}), AtlasTuning());
}

TEST(LongNeedles, LeaveRoomForTheOthers) {
  for (const Precision precision : {Precision::kFloat, Precision::kDouble}) {
    const Mesh mesh = SheetWithFins(1e5);
    UnwrapOptions options;
    options.precision = precision;
    const auto result = Unwrap(mesh, options, {});
    ASSERT_TRUE(result.ok()) << result.status();
    EXPECT_THAT(testing::BrokenPromises(mesh, options, result), IsEmpty());
    EXPECT_GT(result->quality.packing_efficiency, 0.4);
    EXPECT_TRUE(HasWarning(*result, "CHARTS_REDUCED"));
  }
}

TEST(LongNeedles, AreThoseThatNoTextureShows) {
  const std::vector<char> found = LongNeedlesOf(SheetWithFins(1e5));
  ASSERT_EQ(found.size(), 2 * 24 * 24 + 8u);
  EXPECT_THAT(std::vector<char>(found.begin(), found.end() - 8), Each(0));
  EXPECT_THAT(std::vector<char>(found.end() - 8, found.end()), Each(1));
  EXPECT_THAT(LongNeedlesOf(SheetWithFins(1)), IsEmpty());
  // A mesh of nothing else keeps one scale.
  Mesh cables = SheetWithFins(1e5);
  cables.faces.erase(cables.faces.begin(), cables.faces.end() - 8);
  EXPECT_THAT(LongNeedlesOf(cables), IsEmpty());
}

}  // namespace
}  // namespace planish
