#include <algorithm>
#include <cmath>
#include <random>

#include "core/abf/topology.h"
#include "core/base/error.h"
#include "core/base/radix_sort.h"
#include "core/mesh/angles.h"
#include "core/mesh/box_tree.h"
#include "core/mesh/diagnosis.h"
#include "core/mesh/half_edges.h"
#include "core/mesh/local_origin.h"
#include "core/mesh/predicates.h"
#include "core/mesh/spatial_order.h"
#include "core/mesh/visibility.h"
#include "gmock/gmock.h"
#include "gtest/gtest.h"
#include "tests/core/shapes.h"
#include "tests/testing/discs.h"

namespace planish {
namespace {

using ::testing::HasSubstr;

std::string Reason(const Mesh& mesh) {
  return ErrorInfoOf(CheckDisc(mesh)).reason;
}
std::string Metadata(const Mesh& mesh, const std::string& key) {
  const ErrorInfo info = ErrorInfoOf(CheckDisc(mesh));
  const auto it = info.metadata.find(key);
  return it == info.metadata.end() ? "(none)" : it->second;
}
std::string Message(const Mesh& mesh) {
  return std::string(CheckDisc(mesh).message());
}

double MeanVisibility(const Mesh& mesh) {
  double sum = 0;
  for (const float share : FaceVisibility(mesh)) {
    EXPECT_TRUE(share >= 0 && share <= 1) << share;
    sum += static_cast<double>(share) / static_cast<double>(mesh.faces.size());
  }
  return sum;
}

TEST(Visibility, IsTheOpenShareOfTheHemisphere) {
  Mesh ball = testing::PuncturedSphere(20, 0.01);
  EXPECT_GT(MeanVisibility(ball), 0.99);
  for (Face& face : ball.faces) std::swap(face[0], face[1]);
  EXPECT_LT(MeanVisibility(ball), 0.01);
  // Two sheets that face each other: from the middle of either the other one blocks 0.554 of the view (by the formula
  // for squares opposite each other), from a corner half of that or less.
  Mesh sheets = testing::Plane(40, 40);
  EXPECT_NEAR(MeanVisibility(sheets), 1, 1e-9);
  const Vec3 size = sheets.positions[0].cwiseMax(sheets.positions.back()) - sheets.positions[0];
  const auto count = static_cast<std::int32_t>(sheets.positions.size());
  for (std::int32_t v = 0; v < count; ++v) {
    sheets.positions.push_back(sheets.positions[v] + Vec3(0, 0, 0.5 * size.cwiseAbs().maxCoeff()));
  }
  for (std::size_t f = 0, n = sheets.faces.size(); f < n; ++f) {
    const auto [a, b, c] = sheets.faces[f];
    sheets.faces.push_back({count + a, count + c, count + b});
  }
  const float middle = FaceVisibility(sheets)[2 * (40 * 20 + 20)], corner = FaceVisibility(sheets)[0];
  EXPECT_NEAR(middle, 1 - 0.554, 0.1);
  EXPECT_GT(corner, middle + 0.15);
  sheets.positions.push_back({NAN, 0, 0});  // belongs to no face
  EXPECT_EQ(FaceVisibility(sheets)[2 * (40 * 20 + 20)], middle);
}

TEST(Visibility, IsTheSameForAnyNumberOfThreads) {
  const Mesh hills = testing::Hills(120, 120);
  ThreadTeam team(3);
  EXPECT_EQ(FaceVisibility(hills, {&team}), FaceVisibility(hills));
}

TEST(DiscCheck, DescribesADisc) {
  const auto topology = DiscTopology(testing::Plane(4, 3));
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
  ASSERT_TRUE(CheckDisc(mesh).ok()) << CheckDisc(mesh);
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
  EXPECT_THAT(Message(nan), HasSubstr("the position of 2 vertices is NaN")) << "ids are data only";
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
  EXPECT_THAT(Message(testing::Cylinder(6, 3)), HasSubstr("the mesh has 2 boundary loops (of 6, 6 edges)"));
  EXPECT_THAT(Metadata(testing::Cylinder(6, 3), "vertices"), ::testing::StartsWith("0,"));

  Mesh punctured = testing::Torus(6, 5);
  punctured.faces.pop_back();
  EXPECT_EQ(Reason(punctured), "MESH_HAS_HANDLES");
}

TEST(Rows, ListEveryCornerRoundEveryInteriorVertex) {
  const Topology topology = DiscTopology(testing::Plane(7, 5)).value();
  ASSERT_EQ(topology.num_rows, 24);
  ASSERT_EQ(topology.row_corner_begin.size(), 25u);
  const std::vector<std::int32_t> vertices = RowVertices(topology);
  for (std::int32_t row = 0; row < topology.num_rows; ++row) {
    EXPECT_EQ(topology.vertex_row[vertices[row]], row);
    std::vector<std::int32_t> expected;
    for (std::int32_t c = 0; c < topology.num_corners(); ++c) {
      if (topology.faces[c / 3][c % 3] == vertices[row]) expected.push_back(c);
      EXPECT_EQ(topology.corner_row[c], topology.vertex_row[topology.faces[c / 3][c % 3]]);
    }
    const auto begin = topology.row_corner.begin();
    EXPECT_EQ(
        std::vector<std::int32_t>(begin + topology.row_corner_begin[row], begin + topology.row_corner_begin[row + 1]),
        expected);
  }
}

TEST(Rows, BoundaryVerticesMayFollow) {
  Topology topology = DiscTopology(testing::Plane(3, 3)).value();
  std::vector<std::int32_t> vertices = RowVertices(topology);
  vertices.push_back(0);
  vertices.push_back(2);
  AssignRows(vertices, &topology);
  EXPECT_EQ(topology.num_rows, 6);
  EXPECT_EQ(topology.num_interior, 4);
  EXPECT_EQ(topology.vertex_row[2], 5);
  EXPECT_EQ(topology.row_corner_begin.size(), 7u);
  EXPECT_EQ(topology.row_corner_begin[6] - topology.row_corner_begin[5], 4) << "diagonals alternate";
  EXPECT_EQ(RowVertices(topology), vertices);
}

TEST(InSpatialOrder, VisitsEveryCellOfACubeByStepsToItsNeighbour) {
  std::vector<Vec3> positions;
  std::vector<std::int32_t> vertices;
  for (int i = 0; i < 512; ++i) {
    vertices.push_back(i);
    const int shuffled = i * 37 % 512;
    positions.emplace_back(shuffled % 8, shuffled / 8 % 8, shuffled / 64);
  }
  const std::vector<std::int32_t> order = InSpatialOrder(positions, vertices);
  EXPECT_THAT(order, ::testing::UnorderedElementsAreArray(vertices));
  for (int i = 1; i < 512; ++i) {
    EXPECT_EQ((positions[order[i]] - positions[order[i - 1]]).lpNorm<1>(), 1) << i;
  }
}

TEST(InSpatialOrder, TakesAnyFinitePositions) {
  const std::vector<std::int32_t> all = {2, 0, 1};
  EXPECT_EQ(InSpatialOrder({{1, 2, 3}, {1, 2, 3}, {1, 2, 3}}, all), all);
  EXPECT_EQ(InSpatialOrder({{NAN, 0, 0}, {1, 0, 0}, {0, 0, 0}}, {1, 2}), (std::vector<std::int32_t>{2, 1}));
  const double huge = 1.7e308, tiny = 5e-324;
  EXPECT_EQ(InSpatialOrder({{0, 0, 0}, {huge, huge, huge}, {-huge, -huge, -huge}}, all).size(), 3u);
  EXPECT_EQ(InSpatialOrder({{0, 0, 0}, {tiny, 0, 0}, {2 * tiny, 0, 0}}, all).size(), 3u);
  EXPECT_TRUE(InSpatialOrder({}, {}).empty());
}

TEST(SortByKey, IsStableOverAllBits) {
  std::mt19937_64 random(3);
  std::vector<KeyedIndex> entries;
  for (std::int32_t i = 0; i < 3000; ++i) entries.push_back({random() >> (i % 64), i});
  for (std::int32_t i = 0; i < 3000; ++i) entries.push_back({entries[i].key, 3000 + i});
  std::vector<KeyedIndex> expected = entries;
  std::stable_sort(expected.begin(), expected.end(), [](const auto& a, const auto& b) { return a.key < b.key; });
  SortByKey(&entries);
  for (std::size_t i = 0; i < entries.size(); ++i) ASSERT_EQ(entries[i].index, expected[i].index);
}

TEST(MeasuredAngles, AreAccurateForNeedlesFarFromTheOrigin) {
  const double height = 1e-6;
  const Mesh needle = {{{1e4, 0, 0}, {1e4 + 1, 0, 0}, {1e4 + 0.5, height, 0}}, {{0, 1, 2}}};
  const Eigen::VectorXd angles = MeasuredAngles(needle);
  EXPECT_NEAR(angles[0] / std::atan2(height, 0.5), 1, 1e-9);
  EXPECT_NEAR(angles.sum(), M_PI, 1e-15);
}

TEST(TriangleAngles, AreThoseOfTheCornersAndAddUpToPi) {
  std::mt19937 random(5);
  std::normal_distribution<double> normal;
  for (int i = 0; i < 100; ++i) {
    const double flat = i % 2 == 0 ? 1 : 1e-7;
    Vec3 p[3];
    for (Vec3& x : p) x = Vec3(normal(random), flat * normal(random), flat * normal(random));
    double angles[3];
    TriangleAngles(p, angles);
    EXPECT_NEAR(angles[0] + angles[1] + angles[2], M_PI, 1e-15);
    for (int k = 0; k < 3; ++k) EXPECT_NEAR(angles[k] / testing::AngleAt(p[k], p[Next(k)], p[Prev(k)]), 1, 1e-8);
  }
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
      // Products of much smaller numbers underflow, those of much larger ones overflow.
      for (const int exponent : {-1020, -540, -500, 500, 1018}) {
        const double scale = std::ldexp(1.0, exponent);
        EXPECT_EQ(Orientation(scale * b, scale * c, scale * a), expected) << i << " " << j << " " << exponent;
      }
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
  boxes[17] = Box();
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

// How far rounding to float moves a vertex, over the longest side of the box.
double RoundingError(const std::vector<Vec3>& positions, const Vec3& origin) {
  double worst = 0;
  Vec3 low = positions.front(), high = low;
  for (const Vec3& p : positions) {
    const Vec3 near = p - origin;
    worst = std::max(worst, (near.cast<float>().cast<double>() - near).cwiseAbs().maxCoeff());
    low = low.cwiseMin(p);
    high = high.cwiseMax(p);
  }
  return worst / (high - low).maxCoeff();
}

TEST(LocalOrigin, KeepsTheDigitsOfAMeshFarFromTheOrigin) {
  std::mt19937 random(7);
  std::uniform_real_distribution<double> unit(0, 1);
  for (const double side : {1e-3, 0.7, 30.0, 1e5}) {
    for (const double distance : {0.0, 1.0, 3.0, 1e3, 1e7}) {
      const Vec3 place(distance * side, -distance * side / 3, 0.1 * distance * side);
      std::vector<Vec3> positions;
      for (int i = 0; i < 200; ++i) {
        positions.push_back(place + side * Vec3(unit(random), 0.3 * unit(random), unit(random)));
      }
      const Vec3 origin = LocalOrigin(positions);
      EXPECT_LE(RoundingError(positions, origin), std::ldexp(1.0, -23)) << side << " " << distance;
      for (const Vec3& p : positions) {
        for (int axis = 0; axis < 3; ++axis) {
          EXPECT_EQ(static_cast<long double>(p[axis]) - origin[axis], p[axis] - origin[axis]) << "exactly";
        }
      }
    }
  }
}

TEST(LocalOrigin, IsZeroWhereNothingIsLost) {
  EXPECT_EQ(LocalOrigin({}), Vec3::Zero());
  EXPECT_EQ(LocalOrigin({{0.1, 0.2, 0.3}}), Vec3::Zero()) << "one point";
  EXPECT_EQ(LocalOrigin({{0, 0, 0}, {0.1, 0.7, 0.2}}), Vec3::Zero()) << "in a corner at the origin";
  EXPECT_EQ(LocalOrigin({{20000, 0, 0}, {20001, 1, 1}, {20000.5, 0, 1}}), Vec3::Zero()) << "floats";
  EXPECT_EQ(LocalOrigin({{20000.1, NAN, 0}, {20001, 1, INFINITY}, {20000, 0, 1}}), Vec3(20000.5, 0, 0));
}

}  // namespace
}  // namespace planish
