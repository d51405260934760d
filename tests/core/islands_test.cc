#include "core/pack/islands.h"

#include <cmath>

#include "gmock/gmock.h"
#include "gtest/gtest.h"

namespace planish {
namespace {

using ::testing::ElementsAre;

// Squares of two faces side by side on the surface, one unit each.
Mesh Squares(int n) {
  Mesh mesh;
  for (int i = 0; i <= n; ++i) {
    mesh.positions.emplace_back(i, 0, 0);
    mesh.positions.emplace_back(i, 1, 0);
  }
  for (int i = 0; i < n; ++i) {
    mesh.faces.push_back({2 * i, 2 * i + 2, 2 * i + 3});
    mesh.faces.push_back({2 * i, 2 * i + 3, 2 * i + 1});
  }
  return mesh;
}

std::vector<double> UvOf(const Mesh& mesh, const std::vector<std::int32_t>& ids, const std::vector<Vec2>& values) {
  std::vector<double> uv;
  for (std::size_t c = 0; c < 3 * mesh.faces.size(); ++c) {
    uv.push_back(values[ids[c]].x());
    uv.push_back(values[ids[c]].y());
  }
  return uv;
}

double SignedArea(const std::vector<double>& uv, std::size_t f) {
  const Vec2 a(uv[6 * f], uv[6 * f + 1]), b(uv[6 * f + 2], uv[6 * f + 3]), c(uv[6 * f + 4], uv[6 * f + 5]);
  return ((b - a).x() * (c - a).y() - (b - a).y() * (c - a).x()) / 2;
}

TEST(FindIslands, JoinsAcrossEdgesWithTheSameUv) {
  // The second square has its own UV at the edge between them.
  const std::vector<std::int32_t> apart = {0, 1, 2, 0, 2, 3, 4, 5, 6, 4, 6, 7};
  EXPECT_THAT(FindIslands(Squares(2), apart), ElementsAre(0, 0, 1, 1));
  const std::vector<std::int32_t> joined = {0, 1, 2, 0, 2, 3, 1, 4, 5, 1, 5, 2};
  EXPECT_THAT(FindIslands(Squares(2), joined), ElementsAre(0, 0, 0, 0));
}

TEST(FindIslands, TellsIslandsThatLieOnEachOtherApart) {
  const std::vector<std::int32_t> stacked = {0, 1, 2, 0, 2, 3, 0, 1, 2, 0, 2, 3};
  EXPECT_THAT(FindIslands(Squares(2), stacked), ElementsAre(0, 0, 1, 1));
}

TEST(FindIslands, IgnoresThatAFileHasAVertexTwice) {
  Mesh mesh = Squares(1);
  mesh.positions.push_back(mesh.positions[0]);
  mesh.positions.push_back(mesh.positions[3]);
  mesh.faces[1] = {4, 5, 1};
  EXPECT_THAT(FindIslands(mesh, {0, 1, 2, 0, 2, 3}), ElementsAre(0, 0));
}

TEST(Repack, KeepsTurnsOfFacesAndEqualizesDensity) {
  const Mesh mesh = Squares(2);
  // The second island is mirrored and a quarter as long.
  const std::vector<std::int32_t> ids = {0, 1, 2, 0, 2, 3, 4, 5, 6, 4, 6, 7};
  const std::vector<Vec2> values = {{0, 0}, {1, 0}, {1, 1}, {0, 1}, {0, 0}, {-0.25, 0}, {-0.25, 0.25}, {0, 0.25}};
  const std::vector<double> uv = UvOf(mesh, ids, values);
  const Repacking equal = Repack(mesh, uv, ids, IslandDensity::kEqual, {});
  EXPECT_THAT(equal.face_island, ElementsAre(0, 0, 1, 1));
  EXPECT_GT(SignedArea(equal.corner_uv, 0), 0);
  EXPECT_LT(SignedArea(equal.corner_uv, 2), 0);
  EXPECT_NEAR(SignedArea(equal.corner_uv, 0), -SignedArea(equal.corner_uv, 2), 1e-9);
  const Repacking kept = Repack(mesh, uv, ids, IslandDensity::kKeep, {});
  EXPECT_NEAR(SignedArea(kept.corner_uv, 0), -16 * SignedArea(kept.corner_uv, 2), 1e-9);
  for (const double x : kept.corner_uv) EXPECT_TRUE(x > 0 && x < 1);
}

TEST(Repack, MovesAnIslandThatOverlapsItselfAsOne) {
  const Mesh mesh = Squares(1);
  const std::vector<std::int32_t> ids = {0, 1, 2, 0, 2, 1};  // folded along its diagonal
  const Repacking repacking = Repack(mesh, UvOf(mesh, ids, {{0, 0}, {1, 0}, {1, 1}}), ids, IslandDensity::kEqual, {});
  EXPECT_EQ(repacking.packing.charts.size(), 1);
  for (int k = 0; k < 2; ++k) {
    EXPECT_EQ(repacking.corner_uv[k], repacking.corner_uv[6 + k]);
    EXPECT_EQ(repacking.corner_uv[2 + k], repacking.corner_uv[10 + k]);
  }
  EXPECT_NEAR(SignedArea(repacking.corner_uv, 0), -SignedArea(repacking.corner_uv, 1), 1e-12);
}

}  // namespace
}  // namespace planish
