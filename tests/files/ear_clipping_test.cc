#include "client/files/ear_clipping.h"

#include <algorithm>
#include <cmath>
#include <set>

#include "Eigen/Geometry"
#include "gtest/gtest.h"

namespace planish {
namespace {

// Areas of the triangles, with the sign of the polygon's own side; fails where corners are lost or wound otherwise.
std::vector<double> Areas(const std::vector<Vec3>& outline) {
  const std::vector<Face> triangles = TrianglesOfPolygon(outline);
  EXPECT_EQ(triangles.size(), outline.size() - 2);
  Vec3 normal = Vec3::Zero();
  for (std::size_t i = 0; i < outline.size(); ++i) normal += outline[i].cross(outline[(i + 1) % outline.size()]);
  std::vector<double> areas;
  std::set<std::int32_t> used;
  for (const Face& face : triangles) {
    used.insert(face.begin(), face.end());
    const Vec3 cross = (outline[face[1]] - outline[face[0]]).cross(outline[face[2]] - outline[face[0]]);
    areas.push_back(cross.dot(normal.normalized()) / 2);
  }
  EXPECT_EQ(used.size(), outline.size());
  return areas;
}

void ExpectTiles(const std::vector<Vec3>& outline, double area) {
  double sum = 0;
  for (const double one : Areas(outline)) {
    EXPECT_GT(one, 1e-9);
    sum += one;
  }
  EXPECT_NEAR(sum, area, 1e-9);
}

TEST(EarClipping, ConvexPolygonsAreFans) {
  const std::vector<Vec3> hexagon = {{2, 0, 0}, {1, 2, 0}, {-1, 2, 0}, {-2, 0, 0}, {-1, -2, 0}, {1, -2, 0}};
  EXPECT_EQ(TrianglesOfPolygon(hexagon), (std::vector<Face>{{0, 1, 2}, {0, 2, 3}, {0, 3, 4}, {0, 4, 5}}));
  EXPECT_EQ(TrianglesOfPolygon({{0, 0, 0}, {1, 0, 0}, {0, 1, 0}}), (std::vector<Face>{{0, 1, 2}}));
}

TEST(EarClipping, QuadsAreFansWhateverTheirShape) {
  const std::vector<Vec3> dart = {{0, 0, 0}, {4, 0, 0}, {1, 1, 0}, {0, 4, 0}};
  for (std::size_t first = 0; first < 4; ++first) {
    std::vector<Vec3> outline;
    for (std::size_t k = 0; k < 4; ++k) outline.push_back(dart[(first + k) % 4]);
    EXPECT_EQ(TrianglesOfPolygon(outline), (std::vector<Face>{{0, 1, 2}, {0, 2, 3}})) << first;
  }
  // Unless that would leave a flat triangle.
  ExpectTiles({{0, 0, 0}, {1, 0, 0}, {2, 0, 0}, {0, 2, 0}}, 2);
}

TEST(EarClipping, ConcavePolygonsHaveNoFlippedTriangle) {
  // A dart with a broken edge, from each of its corners on, looked at from both sides and turned in space.
  const std::vector<Vec3> dart = {{0, 0, 0}, {2, -1, 0}, {4, 0, 0}, {1, 1, 0}, {0, 4, 0}};
  const Eigen::AngleAxisd turn(1.1, Vec3(1, 2, 3).normalized());
  for (std::size_t first = 0; first < 5; ++first) {
    std::vector<Vec3> outline;
    for (std::size_t k = 0; k < 5; ++k) outline.push_back(turn * dart[(first + k) % 5]);
    ExpectTiles(outline, 6);
    ExpectTiles({outline.rbegin(), outline.rend()}, 6);
  }
  // A comb with five teeth: no corner sees all others.
  std::vector<Vec3> comb;
  for (int tooth = 0; tooth < 5; ++tooth) {
    comb.insert(comb.end(), {Vec3(2 * tooth, 0, 0), Vec3(2 * tooth + 0.5, 5, 0), Vec3(2 * tooth + 1, 0, 0)});
  }
  comb.insert(comb.end(), {Vec3(9, -1, 0), Vec3(0, -1, 0)});
  std::reverse(comb.begin(), comb.end());
  ExpectTiles(comb, 5 * 2.5 + 9);
}

TEST(EarClipping, WhatLiesInNoPlaneIsAFan) {
  // Seen from above concave at corner 2; but the corner stands up steeply.
  const std::vector<Vec3> folded = {{0, 0, 0}, {4, 0, 0}, {1, 0.5, 3}, {4, 4, 0}, {0, 4, 0}};
  EXPECT_EQ(TrianglesOfPolygon(folded), (std::vector<Face>{{0, 1, 2}, {0, 2, 3}, {0, 3, 4}}));
  std::vector<Vec3> flat = folded;
  flat[2].z() = 0;
  ExpectTiles(flat, 16 - 1.5 * 4);
}

TEST(EarClipping, CornersInLineGiveNoFlatTriangle) {
  ExpectTiles({{0, 0, 0}, {1, 0, 0}, {2, 0, 0}, {2, 2, 0}, {0, 2, 0}}, 4);
  ExpectTiles({{0, 0, 0}, {1, 0, 0}, {2, 0, 0}, {2, 1, 0}, {2, 2, 0}, {1, 2, 0}, {0, 2, 0}, {0, 1, 0}}, 4);
}

TEST(EarClipping, HolesWithABridge) {
  ExpectTiles(
      {{0, 0, 0}, {4, 0, 0}, {4, 4, 0}, {0, 4, 0}, {0, 0, 0}, {1, 1, 0}, {1, 3, 0}, {3, 3, 0}, {3, 1, 0}, {1, 1, 0}},
      12);
}

TEST(EarClipping, WhatIsNoPolygonIsAFanAllTheSame) {
  const double nan = std::nan("");
  EXPECT_EQ(TrianglesOfPolygon({{0, 0, 0}, {1, 0, 0}, {2, 0, 0}, {3, 0, 0}}).size(), 2u);
  EXPECT_EQ(TrianglesOfPolygon({{0, 0, 0}, {nan, 0, 0}, {2, 1, 0}, {3, 0, 0}}).size(), 2u);
  EXPECT_EQ(TrianglesOfPolygon({{0, 0, 0}, {1, 1, 0}, {1, 0, 0}, {0, 1, 0}}).size(), 2u) << "a bow";
  EXPECT_EQ(TrianglesOfPolygon(std::vector<Vec3>(20000, Vec3(1, 1, 1))).size(), 19998u);
}

TEST(CrossesItself, FindsBowTiesThatBend) {
  EXPECT_TRUE(CrossesItself({{0, 0, 0}, {1, 1, 0}, {1, 0, 0}, {0, 1, 0}}));
  // Of a public mesh; the crossing sides pass each other at an eighth of the longest side.
  EXPECT_TRUE(
      CrossesItself({{3.134, 1.037, 0.034}, {3.993, 1.101, 0.078}, {3.198, 1.952, -0.402}, {3.857, 2.161, -0.130}}));
  EXPECT_FALSE(CrossesItself({{0, 0, 0}, {1, 0, 0.1}, {1, 1, 0}, {0, 1, 0.1}})) << "a saddle";
  EXPECT_FALSE(CrossesItself({{-1, 0, 0}, {0, 1, 0}, {1, 0, 0}, {0, 0.9, 0.1}})) << "folded along its diagonal";
  EXPECT_FALSE(CrossesItself({{0, 0, 0}, {1, 0, 0}, {0.5, 1, 0.5}, {0.5, 1, -0.5}})) << "a quarter turn of a ribbon";
  EXPECT_FALSE(CrossesItself({{1, 1, 1}, {1, 1, 1}, {1, 1, 1}, {1, 1, 1}}));
}

}  // namespace
}  // namespace planish
