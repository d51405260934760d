#include "tests/bench/uv_islands.h"

#include "gtest/gtest.h"

namespace planish::bench {
namespace {

// Two squares of two triangles each, side by side with a common edge on the surface.
Mesh TwoSquares() {
  Mesh mesh;
  for (int y = 0; y < 2; ++y) {
    for (int x = 0; x < 3; ++x) mesh.positions.emplace_back(x, y, 0);
  }
  mesh.faces = {{0, 1, 4}, {0, 4, 3}, {1, 2, 5}, {1, 5, 4}};
  return mesh;
}

// As on the surface, the second square moved away by `gap`, and the first mirrored in v if so wanted.
CornerUv Map(const Mesh& mesh, double gap, bool mirrored) {
  CornerUv uv;
  for (std::size_t f = 0; f < mesh.faces.size(); ++f) {
    for (const std::int32_t v : mesh.faces[f]) {
      uv.push_back(mesh.positions[v].x() + (f < 2 ? 0 : gap));
      uv.push_back(mirrored && f < 2 ? 1 - mesh.positions[v].y() : mesh.positions[v].y());
    }
  }
  return uv;
}

const std::vector<char> kNone(4, 0);

TEST(UvIslands, AreJoinedWhereBothEndsOfAnEdgeAgree) {
  const Mesh mesh = TwoSquares();
  const UvIslands whole = FindUvIslands(mesh, Map(mesh, 0, false), kNone);
  EXPECT_EQ(whole.count, 1);
  EXPECT_EQ(whole.opposite[3 * 0], 3 * 3 + 1);
  const UvIslands apart = FindUvIslands(mesh, Map(mesh, 0.25, false), kNone);
  EXPECT_EQ(apart.count, 2);
  EXPECT_EQ(apart.chart, (std::vector<std::int32_t>{0, 0, 1, 1}));
  EXPECT_EQ(apart.opposite[3 * 0], -1);
  // The same place, but the ends of the edge exchanged.
  EXPECT_EQ(FindUvIslands(mesh, Map(mesh, 0, true), kNone).count, 2);
}

TEST(UvIslands, LeaveOutIgnoredFaces) {
  const Mesh mesh = TwoSquares();
  const UvIslands islands = FindUvIslands(mesh, Map(mesh, 0, false), {0, 0, 0, 1});
  EXPECT_EQ(islands.count, 2);
  EXPECT_EQ(islands.chart, (std::vector<std::int32_t>{0, 0, 1, -1}));
}

TEST(UvIslands, ChartsNearerThanTheDistanceAreCountedOnce) {
  const Mesh mesh = TwoSquares();
  const CornerUv apart = Map(mesh, 0.25, false), touching = Map(mesh, 0, true), overlapping = Map(mesh, -0.5, true);
  EXPECT_EQ(CountTooNear(FindUvIslands(mesh, apart, kNone), apart, 0.24), 0);
  EXPECT_EQ(CountTooNear(FindUvIslands(mesh, apart, kNone), apart, 0.26), 1);
  EXPECT_EQ(CountTooNear(FindUvIslands(mesh, touching, kNone), touching, 1e-9), 1);
  EXPECT_EQ(CountTooNear(FindUvIslands(mesh, overlapping, kNone), overlapping, 1e-9), 1);
}

}  // namespace
}  // namespace planish::bench
