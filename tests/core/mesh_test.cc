#include <algorithm>
#include <cmath>
#include <random>

#include "core/base/error.h"
#include "core/mesh/angles.h"
#include "core/mesh/box_tree.h"
#include "core/mesh/disc_check.h"
#include "core/mesh/half_edges.h"
#include "core/mesh/predicates.h"
#include "gmock/gmock.h"
#include "gtest/gtest.h"
#include "tests/core/shapes.h"

namespace planish {
namespace {

using ::testing::HasSubstr;

std::string Reason(const Mesh& mesh) {
  return ErrorInfoOf(CheckDisc(mesh).status()).reason;
}
std::string Metadata(const Mesh& mesh, const std::string& key) {
  const ErrorInfo info = ErrorInfoOf(CheckDisc(mesh).status());
  const auto it = info.metadata.find(key);
  return it == info.metadata.end() ? "(none)" : it->second;
}
std::string Message(const Mesh& mesh) {
  return std::string(CheckDisc(mesh).status().message());
}

TEST(DiscCheck, DescribesADisc) {
  const auto topology = CheckDisc(testing::Plane(4, 3));
  ASSERT_TRUE(topology.ok()) << topology.status();
  EXPECT_EQ(topology->num_faces(), 24);
  EXPECT_EQ(topology->num_interior, 6);
  for (std::int32_t c = 0; c < topology->num_corners(); ++c) {
    const std::int32_t o = topology->opposite[c];
    if (o < 0) continue;
    EXPECT_EQ(topology->opposite[o], c);
    EXPECT_EQ(Origin(topology->faces, c), Target(topology->faces, o));
  }
  EXPECT_EQ(std::count(topology->opposite.begin(), topology->opposite.end(), -1), 14);
}

TEST(DiscCheck, AcceptsOneTriangleAndIgnoresIsolatedVertices) {
  const Mesh mesh = {{{5, 5, 5}, {0, 0, 0}, {1, 0, 0}, {NAN, 0, 0}, {0, 1, 0}}, {{1, 2, 4}}};
  ASSERT_TRUE(CheckDisc(mesh).ok()) << CheckDisc(mesh).status();
  EXPECT_EQ(CountIsolatedVertices(mesh), 2);
}

TEST(DiscCheck, NamesBadInput) {
  EXPECT_EQ(Reason(Mesh()), "MESH_EMPTY");

  Mesh index = testing::Plane(2, 2);
  index.faces[3][1] = 9;
  EXPECT_EQ(Reason(index), "MESH_INDEX_OUT_OF_RANGE");
  EXPECT_EQ(Metadata(index, "faces"), "3");
  index.faces[3][1] = -1;
  EXPECT_EQ(Reason(index), "MESH_INDEX_OUT_OF_RANGE");

  Mesh nan = testing::Plane(2, 2);
  nan.positions[4].y() = NAN;
  nan.positions[7].x() = INFINITY;
  EXPECT_EQ(Reason(nan), "MESH_POSITION_NOT_FINITE");
  EXPECT_EQ(Metadata(nan, "vertices"), "4,7");
  EXPECT_THAT(Message(nan), HasSubstr("vertices 4, 7"));
}

TEST(DiscCheck, NamesDegenerateAndDuplicateFaces) {
  Mesh repeated = testing::Plane(2, 2);
  repeated.faces[5][2] = repeated.faces[5][0];
  EXPECT_EQ(Reason(repeated), "MESH_FACE_DEGENERATE");
  EXPECT_EQ(Metadata(repeated, "faces"), "5");

  const Mesh collinear = {{{0, 0, 0}, {0.1, 0.1, 0.1}, {0.3, 0.3, 0.3}}, {{0, 1, 2}}};
  EXPECT_EQ(Reason(collinear), "MESH_FACE_DEGENERATE");

  Mesh twice = testing::Plane(2, 2);
  twice.faces.push_back({twice.faces[2][1], twice.faces[2][2], twice.faces[2][0]});
  EXPECT_EQ(Reason(twice), "MESH_FACE_DUPLICATE");
  EXPECT_EQ(Metadata(twice, "faces"), "8");
}

TEST(DiscCheck, NamesNonManifoldEdgesAndVertices) {
  Mesh fan = {{{0, 0, 0}, {0, 0, 1}, {1, 0, 0}, {0, 1, 0}, {-1, -1, 0}}, {{0, 1, 2}, {1, 0, 3}, {0, 1, 4}}};
  EXPECT_EQ(Reason(fan), "MESH_EDGE_NON_MANIFOLD");
  EXPECT_EQ(Metadata(fan, "edges"), "0-1");
  EXPECT_EQ(Metadata(fan, "faces"), "0,1,2");

  const Mesh bow_tie = {{{0, 0, 0}, {1, 0, 0}, {0, 1, 0}, {-1, 0, 0}, {0, -1, 0}}, {{0, 1, 2}, {0, 3, 4}}};
  EXPECT_EQ(Reason(bow_tie), "MESH_VERTEX_NON_MANIFOLD");
  EXPECT_EQ(Metadata(bow_tie, "vertices"), "0");
}

TEST(DiscCheck, TellsInconsistentFromNotOrientable) {
  Mesh turned = testing::Plane(3, 3);
  std::swap(turned.faces[8][0], turned.faces[8][1]);
  EXPECT_EQ(Reason(turned), "MESH_ORIENTATION_INCONSISTENT");
  EXPECT_EQ(Metadata(turned, "count"), "3");
  EXPECT_EQ(Reason(testing::MoebiusStrip(8)), "MESH_NOT_ORIENTABLE");
}

TEST(DiscCheck, NamesComponentsLoopsAndHandles) {
  Mesh two = testing::Plane(1, 1);
  for (const Vec3& p : testing::Plane(1, 1).positions) two.positions.push_back(p + Vec3(5, 0, 0));
  for (const Face& f : testing::Plane(1, 1).faces) two.faces.push_back({f[0] + 4, f[1] + 4, f[2] + 4});
  EXPECT_EQ(Reason(two), "MESH_SEVERAL_COMPONENTS");
  EXPECT_EQ(Metadata(two, "faces"), "0,2");

  EXPECT_EQ(Reason(testing::Tetrahedron()), "MESH_CLOSED");
  EXPECT_EQ(Metadata(testing::Torus(6, 5), "genus"), "1");
  EXPECT_EQ(Reason(testing::Cylinder(6, 3)), "MESH_SEVERAL_LOOPS");
  EXPECT_THAT(Message(testing::Cylinder(6, 3)),
              HasSubstr("2 boundary loops (6 edges through vertex 0, 6 edges through"));

  Mesh punctured = testing::Torus(6, 5);
  punctured.faces.pop_back();
  EXPECT_EQ(Reason(punctured), "MESH_HAS_HANDLES");
}

TEST(MeasuredAngles, AreAccurateForNeedlesFarFromTheOrigin) {
  const double height = 1e-6;
  const Mesh needle = {{{1e4, 0, 0}, {1e4 + 1, 0, 0}, {1e4 + 0.5, height, 0}}, {{0, 1, 2}}};
  const Eigen::VectorXd angles = MeasuredAngles(needle);
  EXPECT_NEAR(angles[0] / std::atan2(height, 0.5), 1, 1e-9);
  EXPECT_NEAR(angles.sum(), M_PI, 1e-15);
}

TEST(Orientation, IsExactWhereRoundingIsNot) {
  // Points on a line with slope 1, moved by single units in the last place.
  const double ulp = std::ldexp(1.0, -53);
  int mistakes = 0;
  for (int i = 0; i < 32; ++i) {
    for (int j = 0; j < 32; ++j) {
      const Vec2 a(0.5 + i * ulp, 0.5 + j * ulp), b(12, 12), c(24, 24);
      // b and c lie on x = y, so the sign is that of y_a - x_a.
      const int expected = (j > i) - (j < i);
      EXPECT_EQ(Orientation(b, c, a), expected) << i << " " << j;
      const double naive = (b.x() - a.x()) * (c.y() - a.y()) - (b.y() - a.y()) * (c.x() - a.x());
      mistakes += (naive > 0) - (naive < 0) != expected;
    }
  }
  EXPECT_GT(mistakes, 0) << "the example is too easy to show anything";
}

TEST(InteriorsMeet, SharedEdgesAndCornersDoNotCount) {
  const Vec2 a[3] = {{0, 0}, {1, 0}, {0, 1}}, b[3] = {{1, 0}, {1, 1}, {0, 1}}, c[3] = {{0, 0}, {-1, 0}, {0, -1}};
  const Vec2 d[3] = {{0.1, 0.1}, {2, 2}, {0.1, 0.2}}, inside[3] = {{0.1, 0.1}, {0.2, 0.1}, {0.1, 0.2}};
  EXPECT_FALSE(InteriorsMeet(a, b));
  EXPECT_FALSE(InteriorsMeet(a, c));
  EXPECT_TRUE(InteriorsMeet(a, d));
  EXPECT_TRUE(InteriorsMeet(a, inside));
  EXPECT_TRUE(InteriorsMeet(a, a));
}

TEST(SegmentsMeet, CountsTouchingEnds) {
  EXPECT_TRUE(SegmentsMeet({0, 0}, {2, 2}, {0, 2}, {2, 0}));
  EXPECT_TRUE(SegmentsMeet({0, 0}, {2, 0}, {1, 0}, {1, 1}));
  EXPECT_TRUE(SegmentsMeet({0, 0}, {2, 0}, {1, 0}, {3, 0}));
  EXPECT_FALSE(SegmentsMeet({0, 0}, {1, 0}, {2, 0}, {3, 0}));
  EXPECT_FALSE(SegmentsMeet({0, 0}, {1, 0}, {0, 1}, {1, 1}));
}

TEST(BoxTree, FindsWhatBruteForceFinds) {
  std::mt19937 random(7);
  std::uniform_real_distribution<double> place(0, 1), size(0, 0.1);
  std::vector<Box> boxes(300);
  for (Box& box : boxes) {
    const Vec2 p(place(random), place(random));
    box.Add(p);
    box.Add(p + Vec2(size(random), size(random)));
  }
  const BoxTree tree(boxes);
  for (const Box& box : boxes) {
    std::vector<std::int32_t> found, expected;
    tree.ForEachMeeting(box, [&](std::int32_t i) { return found.push_back(i), true; });
    for (std::int32_t i = 0; i < 300; ++i) {
      if (boxes[i].Meets(box)) expected.push_back(i);
    }
    EXPECT_THAT(found, ::testing::UnorderedElementsAreArray(expected));
  }
}

}  // namespace
}  // namespace planish
