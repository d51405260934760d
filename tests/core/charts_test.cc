#include <algorithm>
#include <cmath>
#include <map>
#include <numbers>
#include <set>

#include "Eigen/Geometry"
#include "core/charts/merging.h"
#include "core/charts/segmentation.h"
#include "core/charts/stretch_estimate.h"
#include "core/charts/surface.h"
#include "gtest/gtest.h"
#include "tests/core/shapes.h"

namespace planish {
namespace {

// By the book: vertices of a chart are classes of corners that glued edges join; V - E + F = 1 and one piece make a
// disc.
void ExpectDisc(const Surface& surface, const Gluing& gluing, const std::vector<std::int32_t>& faces) {
  std::map<std::int32_t, std::int32_t> parent;
  for (const std::int32_t f : faces) {
    for (std::int32_t c = 3 * f; c < 3 * f + 3; ++c) parent[c] = c;
  }
  const auto root = [&](std::int32_t c) {
    while (parent.at(c) != c) c = parent.at(c);
    return c;
  };
  std::map<std::int32_t, std::int32_t> piece;
  for (const std::int32_t f : faces) piece[f] = f;
  const auto piece_root = [&](std::int32_t f) {
    while (piece.at(f) != f) f = piece.at(f);
    return f;
  };
  std::int64_t glued = 0;
  for (const std::int32_t f : faces) {
    for (std::int32_t c = 3 * f; c < 3 * f + 3; ++c) {
      const std::int32_t o = gluing.opposite()[c];
      if (o < 0) continue;
      ASSERT_EQ(gluing.opposite()[o], c);
      ASSERT_EQ(surface.origin(c), surface.target(o));
      ASSERT_TRUE(parent.count(o)) << "glued to another chart";
      ++glued;
      parent[root(3 * f + Next(c % 3))] = root(3 * (o / 3) + Prev(o % 3));
      parent[root(3 * f + Prev(c % 3))] = root(3 * (o / 3) + Next(o % 3));
      piece[piece_root(f)] = piece_root(o / 3);
    }
  }
  std::set<std::int32_t> vertices, pieces;
  for (const auto& [c, unused] : parent) vertices.insert(root(c));
  for (const auto& [f, unused] : piece) pieces.insert(piece_root(f));
  const auto num_faces = static_cast<std::int64_t>(faces.size());
  EXPECT_EQ(pieces.size(), 1u);
  EXPECT_EQ(static_cast<std::int64_t>(vertices.size()) - (3 * num_faces - glued / 2) + num_faces, 1);
}

void ExpectDiscs(const Surface& surface, const Segmentation& segmentation) {
  std::vector<char> seen(surface.num_faces(), 0);
  for (std::size_t i = 0; i < segmentation.charts().size(); ++i) {
    ExpectDisc(surface, segmentation.gluing(), segmentation.charts()[i]);
    for (const std::int32_t f : segmentation.charts()[i]) {
      EXPECT_EQ(segmentation.chart()[f], static_cast<std::int32_t>(i));
      EXPECT_FALSE(std::exchange(seen[f], 1));
    }
  }
  EXPECT_EQ(std::count(seen.begin(), seen.end(), 1),
            std::count(surface.takes_part.begin(), surface.takes_part.end(), 1));
}

std::vector<Mesh> AllKinds() {
  Mesh fan = testing::Plane(2, 2);  // a third face at an inner edge
  fan.positions.push_back({0.5, 0.5, 1});
  fan.faces.push_back({fan.faces[0][0], fan.faces[0][1], static_cast<std::int32_t>(fan.positions.size()) - 1});
  Mesh sheets = testing::Plane(3, 3);  // double-sided
  for (const Face& face : testing::Plane(3, 3).faces) sheets.faces.push_back({face[0], face[2], face[1]});
  return {testing::Tetrahedron(),
          testing::Torus(12, 8),
          testing::Cylinder(12, 6),
          testing::MoebiusStrip(12),
          testing::PuncturedSphere(8, 0.3),
          testing::Hills(14, 14),
          testing::LShape(4),
          fan,
          sheets};
}

TEST(Segmentation, EveryChartIsADisc) {
  for (const Mesh& mesh : AllKinds()) {
    const Surface surface = MakeSurface(mesh, {});
    for (const auto kind : {Segmentation::Kind::kWhole, Segmentation::Kind::kStretch}) {
      Segmentation segmentation(surface, kind, 1.05, {});
      ExpectDiscs(surface, segmentation);
      // And they stay discs however they are split.
      for (int round = 0; round < 3; ++round) {
        std::vector<Segmentation::Cut> cuts;
        for (std::size_t i = 0; i < segmentation.charts().size(); ++i) cuts.push_back({static_cast<std::int32_t>(i)});
        const std::size_t before = segmentation.charts().size();
        const std::vector<std::int32_t> changed = segmentation.Split(cuts, {});
        EXPECT_GE(segmentation.charts().size(), before);
        EXPECT_EQ(segmentation.charts().size() - before, changed.size() / 2);
        ExpectDiscs(surface, segmentation);
      }
    }
  }
}

TEST(Segmentation, SplitPartsTheFacesAskedFor) {
  const Mesh mesh = testing::Plane(8, 8);
  const Surface surface = MakeSurface(mesh, {});
  Segmentation segmentation(surface, Segmentation::Kind::kWhole, 1.05, {});
  ASSERT_EQ(segmentation.charts().size(), 1u);
  segmentation.Split({{0, 3, 90}}, {});
  EXPECT_EQ(segmentation.charts().size(), 2u);
  EXPECT_NE(segmentation.chart()[3], segmentation.chart()[90]);
}

TEST(Segmentation, SplitMakesThePartsItIsGiven) {
  const Mesh mesh = testing::Plane(12, 12);
  const Surface surface = MakeSurface(mesh, {});
  Segmentation segmentation(surface, Segmentation::Kind::kWhole, 1.05, {});
  Segmentation::Cut cut = {0};
  for (std::int32_t f = 0; f < mesh.num_faces(); ++f) {
    const auto& [a, b, c] = mesh.faces[f];
    const Vec3 middle = (mesh.positions[a] + mesh.positions[b] + mesh.positions[c]) / 3;
    cut.part.push_back(static_cast<std::int32_t>(3 * middle.x() / mesh.positions.back().x()));
  }
  const std::int32_t parts = *std::max_element(cut.part.begin(), cut.part.end()) + 1;
  ASSERT_GT(parts, 1);
  EXPECT_EQ(segmentation.Split({cut}, {}).size(), static_cast<std::size_t>(parts));
  ASSERT_EQ(segmentation.charts().size(), static_cast<std::size_t>(parts));
  ExpectDiscs(surface, segmentation);
  for (std::int32_t f = 0; f < mesh.num_faces(); ++f) EXPECT_EQ(segmentation.chart()[f], cut.part[f]);
}

TEST(Segmentation, WholeKeepsWhatIsADisc) {
  for (const Mesh& mesh : {testing::Hills(10, 10), testing::PuncturedSphere(8, 0.1)}) {
    const Surface surface = MakeSurface(mesh, {});
    const Segmentation segmentation(surface, Segmentation::Kind::kWhole, 1.05, {});
    EXPECT_EQ(segmentation.charts().size(), 1u);
    EXPECT_FALSE(segmentation.HasSlit(0));
  }
  const Mesh torus = testing::Torus(12, 8);
  const Surface surface = MakeSurface(torus, {});
  const Segmentation segmentation(surface, Segmentation::Kind::kWhole, 1.05, {});
  EXPECT_EQ(segmentation.charts().size(), 1u);
  EXPECT_TRUE(segmentation.HasSlit(0));
}

// The same faces together after a rigid motion and a change of scale.
TEST(Segmentation, KnowsNoPlaceTurnOrScale) {
  for (const Mesh& mesh : {testing::Torus(20, 12), testing::Hills(20, 20, 2)}) {
    const Surface surface = MakeSurface(mesh, {});
    const Segmentation segmentation(surface, Segmentation::Kind::kStretch, 1.02, {});
    EXPECT_GT(segmentation.charts().size(), 1u);
    for (const double scale : {1e-6, 3.0, 1e6}) {
      Mesh moved = mesh;
      const Eigen::Matrix3d turn = Eigen::AngleAxisd(1.1, Vec3(1, 2, 3).normalized()).toRotationMatrix();
      for (Vec3& p : moved.positions) p = scale * (turn * p + Vec3(5, -7, 11));
      const Surface moved_surface = MakeSurface(moved, {});
      EXPECT_EQ(Segmentation(moved_surface, Segmentation::Kind::kStretch, 1.02, {}).chart(), segmentation.chart());
    }
  }
}

TEST(Segmentation, LowerLimitsTakeMoreCharts) {
  const Mesh mesh = testing::Torus(40, 20);
  const Surface surface = MakeSurface(mesh, {});
  std::size_t last = 0;
  for (const double limit : {2.0, 1.1, 1.02, 1.005}) {
    const Segmentation segmentation(surface, Segmentation::Kind::kStretch, limit, {});
    EXPECT_GE(segmentation.charts().size(), last);
    last = segmentation.charts().size();
    StretchEstimate estimate(segmentation.gluing());
    for (const auto& faces : segmentation.charts()) EXPECT_LE(estimate(faces, {}), 1.02 * limit);
  }
  EXPECT_GT(last, 4u);
}

// Half a sphere: the map is stereographic, its scale 2 / (1 + t) at height t, evenly spread over [0, 1]: the mean of
// its square is 2, of the inverse 7 / 12.
TEST(StretchEstimate, OfHalfASphere) {
  const Mesh mesh = testing::PuncturedSphere(24, std::numbers::pi / 2);
  const Surface surface = MakeSurface(mesh, {});
  const Segmentation whole(surface, Segmentation::Kind::kWhole, 1.05, {});
  StretchEstimate estimate(whole.gluing());
  EXPECT_NEAR(estimate(whole.charts()[0], {}), std::sqrt(2 * 7.0 / 12), 0.03);
}

TEST(StretchEstimate, OfWhatUnrollsIsOne) {
  for (const Mesh& mesh : {testing::Plane(9, 9), testing::HalfCylinder(12, 6)}) {
    const Surface surface = MakeSurface(mesh, {});
    const Segmentation whole(surface, Segmentation::Kind::kWhole, 1.05, {});
    StretchEstimate estimate(whole.gluing());
    EXPECT_NEAR(estimate(whole.charts()[0], {}), 1, 1e-6);
  }
}

TEST(Surface, EndsWhereChartsMust) {
  const Mesh strip = testing::MoebiusStrip(8);
  EXPECT_GT(MakeSurface(strip, {}).clashing_edges, 0);
  Mesh fan = testing::Plane(1, 1);
  fan.positions.push_back({0, 0, 1});
  const std::int32_t shared[2] = {fan.faces[0][0], fan.faces[0][2]};
  ASSERT_TRUE(std::count(fan.faces[1].begin(), fan.faces[1].end(), shared[0]) &&
              std::count(fan.faces[1].begin(), fan.faces[1].end(), shared[1]));
  fan.faces.push_back({shared[0], shared[1], 4});
  const Surface surface = MakeSurface(fan, {});
  EXPECT_EQ(surface.non_manifold_edges, 1);
  EXPECT_EQ(std::count(surface.across.begin(), surface.across.end(), -1), 9);
}

TEST(Surface, GivenSeamsAndHardEdgesEndChartsAndUncutEdgesDoNot) {
  const Mesh mesh = testing::Plane(2, 2);
  const Surface all = MakeSurface(mesh, {});
  const auto inner = std::find_if(all.across.begin(), all.across.end(), [](std::int32_t o) { return o >= 0; });
  const auto c = static_cast<std::int32_t>(inner - all.across.begin());
  EXPECT_EQ(MakeSurface(mesh, {{c}, {}, 0}).across[c], -1);
  EXPECT_EQ(MakeSurface(mesh, {{c}, {}, 0}).across[*inner], -1);

  const Mesh tetrahedron = testing::Tetrahedron();
  const auto open = [&](const GivenSeams& seams) {
    const Surface surface = MakeSurface(tetrahedron, seams);
    return std::count(surface.across.begin(), surface.across.end(), -1);
  };
  EXPECT_EQ(open({{}, {}, 0}), 0);
  EXPECT_EQ(open({{}, {}, 60}), 12);
  EXPECT_EQ(open({{}, {0}, 60}), 10);
  EXPECT_EQ(open({{0}, {0}, 60}), 12);  // what the caller asks for counts more
}

TEST(Surface, FacesWithoutAreaHaveAnglesAllTheSame) {
  Mesh mesh = testing::Plane(1, 1);
  mesh.positions.push_back((mesh.positions[mesh.faces[0][0]] + mesh.positions[mesh.faces[0][1]]) / 2);
  mesh.faces.push_back({mesh.faces[0][1], mesh.faces[0][0], 4});
  mesh.faces.push_back({0, 0, 1});
  const Surface surface = MakeSurface(mesh, {});
  EXPECT_TRUE(surface.takes_part[2]);
  EXPECT_TRUE(surface.is_flat[2]);
  double sum = 0;
  for (int k = 0; k < 3; ++k) {
    EXPECT_GT(surface.angle[6 + k], 1e-4);
    sum += surface.angle[6 + k];
  }
  EXPECT_NEAR(sum, std::numbers::pi, 1e-12);
  EXPECT_FALSE(surface.takes_part[3]);
}

}  // namespace
}  // namespace planish
