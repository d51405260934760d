#include <algorithm>
#include <cmath>
#include <map>
#include <numbers>
#include <numeric>
#include <optional>
#include <set>
#include <string>

#include "Eigen/Geometry"
#include "core/charts/segmentation.h"
#include "core/charts/steps.h"
#include "core/charts/stretch_estimate.h"
#include "core/charts/surface.h"
#include "core/mesh/near_symmetry.h"
#include "gtest/gtest.h"
#include "tests/core/shapes.h"
#include "tests/testing/families.h"

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
      const HalfedgeHandle h = HalfEdgeOf(*surface.mesh, c), across = gluing.Across(h);
      if (!across.is_valid()) continue;
      const std::int32_t o = CornerOf(*surface.mesh, across);
      ASSERT_EQ(gluing.Across(across), h);
      ASSERT_EQ(surface.mesh->from_vertex_handle(h), surface.mesh->to_vertex_handle(across));
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
    const Surface surface = MakeSurface(mesh, {}).value();
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

// Slits of the folded mesh cut pieces off, small ones and large ones, where the triangles of the mesh lie otherwise.
TEST(Segmentation, ChartsLikeThoseOfAFoldedMeshAreDiscs) {
  int folds = 0;
  for (const std::uint64_t seed : {90000, 90010, 90020, 90030, 90041, 90050}) {
    for (const std::string family : {"copies", "high_genus"}) {
      const Mesh mesh = testing::MakeFamily(family, seed, 140);
      const std::optional<FoldedMesh> folded = FoldNearlySymmetric(mesh, {}, 3'000);
      if (!folded) continue;
      ++folds;
      SCOPED_TRACE(family + std::to_string(seed));
      const Surface surface = MakeSurface(mesh, {}).value(), folded_surface = MakeSurface(folded->mesh, {}).value();
      for (const auto kind : {Segmentation::Kind::kWhole, Segmentation::Kind::kStretch}) {
        const Segmentation other(folded_surface, kind, 1.3, {});
        Segmentation made = Segmentation::Like(surface, other, folded->like, {});
        made.DropEmpty();
        ExpectDiscs(surface, made);
      }
    }
  }
  EXPECT_GE(folds, 3) << "the test needs other meshes";
}

TEST(Segmentation, SplitPartsTheFacesAskedFor) {
  const Mesh mesh = testing::Plane(8, 8);
  const Surface surface = MakeSurface(mesh, {}).value();
  Segmentation segmentation(surface, Segmentation::Kind::kWhole, 1.05, {});
  ASSERT_EQ(segmentation.charts().size(), 1u);
  segmentation.Split({{0, 3, 90}}, {});
  EXPECT_EQ(segmentation.charts().size(), 2u);
  EXPECT_NE(segmentation.chart()[3], segmentation.chart()[90]);
}

TEST(Segmentation, SplitMakesThePartsItIsGiven) {
  const Mesh mesh = testing::Plane(12, 12);
  const Surface surface = MakeSurface(mesh, {}).value();
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
    const Surface surface = MakeSurface(mesh, {}).value();
    const Segmentation segmentation(surface, Segmentation::Kind::kWhole, 1.05, {});
    EXPECT_EQ(segmentation.charts().size(), 1u);
    EXPECT_FALSE(segmentation.HasSlit(0));
  }
  const Mesh torus = testing::Torus(12, 8);
  const Surface surface = MakeSurface(torus, {}).value();
  const Segmentation segmentation(surface, Segmentation::Kind::kWhole, 1.05, {});
  EXPECT_EQ(segmentation.charts().size(), 1u);
  EXPECT_TRUE(segmentation.HasSlit(0));
}

// The same faces together after a rigid motion and a change of scale.
TEST(Segmentation, KnowsNoPlaceTurnOrScale) {
  for (const Mesh& mesh : {testing::Torus(20, 12), testing::Hills(20, 20, 2)}) {
    const Surface surface = MakeSurface(mesh, {}).value();
    const Segmentation segmentation(surface, Segmentation::Kind::kStretch, 1.02, {});
    EXPECT_GT(segmentation.charts().size(), 1u);
    for (const double scale : {1e-6, 3.0, 1e6}) {
      Mesh moved = mesh;
      const Eigen::Matrix3d turn = Eigen::AngleAxisd(1.1, Vec3(1, 2, 3).normalized()).toRotationMatrix();
      for (Vec3& p : moved.positions) p = scale * (turn * p + Vec3(5, -7, 11));
      const Surface moved_surface = MakeSurface(moved, {}).value();
      EXPECT_EQ(Segmentation(moved_surface, Segmentation::Kind::kStretch, 1.02, {}).chart(), segmentation.chart());
    }
  }
}

StretchEstimate::Sums EstimateOf(const Surface& surface, const std::vector<std::int32_t>& faces,
                                 StretchEstimate* estimate) {
  double area = 0;
  for (const std::int32_t f : faces) area += surface.area[f];
  StretchEstimate::Work work;
  const StretchEstimate::Sums sums = estimate->Whole({estimate->InteriorOf(faces)}, area, &work);
  estimate->Keep(work);
  return sums;
}

TEST(Segmentation, LowerLimitsTakeMoreCharts) {
  const Mesh mesh = testing::Torus(40, 20);
  const Surface surface = MakeSurface(mesh, {}).value();
  std::size_t last = 0;
  for (const double limit : {2.0, 1.1, 1.02, 1.005}) {
    const Segmentation segmentation(surface, Segmentation::Kind::kStretch, limit, {});
    EXPECT_GE(segmentation.charts().size(), last);
    last = segmentation.charts().size();
    const AtlasTuning tuning;
    StretchEstimate estimate(segmentation.gluing(), tuning);
    for (const auto& faces : segmentation.charts()) {
      EXPECT_LE(EstimateOf(surface, faces, &estimate).Stretch(), 1.02 * limit);
    }
  }
  EXPECT_GT(last, 4u);
}

// Half a sphere: the map is stereographic, its scale 2 / (1 + t) at height t, evenly spread over [0, 1]: the mean of
// its square is 2, of the inverse 7 / 12.
TEST(StretchEstimate, OfHalfASphere) {
  const Mesh mesh = testing::PuncturedSphere(24, std::numbers::pi / 2);
  const Surface surface = MakeSurface(mesh, {}).value();
  const Segmentation whole(surface, Segmentation::Kind::kWhole, 1.05, {});
  const AtlasTuning tuning;
  StretchEstimate estimate(whole.gluing(), tuning);
  EXPECT_NEAR(EstimateOf(surface, whole.charts()[0], &estimate).Stretch(), std::sqrt(2 * 7.0 / 12), 0.03);
}

TEST(StretchEstimate, OfWhatUnrollsIsOne) {
  for (const Mesh& mesh : {testing::Plane(9, 9), testing::HalfCylinder(12, 6)}) {
    const Surface surface = MakeSurface(mesh, {}).value();
    const Segmentation whole(surface, Segmentation::Kind::kWhole, 1.05, {});
    const AtlasTuning tuning;
    StretchEstimate estimate(whole.gluing(), tuning);
    EXPECT_NEAR(EstimateOf(surface, whole.charts()[0], &estimate).Stretch(), 1, 1e-6);
  }
}

// A cap glued to the rest of half a sphere: what is solved for next to the cap alone is about what all of it gives, and
// keeping it makes the next estimate the same again.
TEST(StretchEstimate, OfASmallDiscJoinedToALargeOne) {
  const Mesh mesh = testing::PuncturedSphere(24, std::numbers::pi / 2);
  const Surface surface = MakeSurface(mesh, {}).value();
  std::vector<std::int32_t> cap, rest, piece;
  const double top = std::max_element(mesh.positions.begin(), mesh.positions.end(), [](const Vec3& p, const Vec3& q) {
                       return p.x() < q.x();
                     })->x();
  for (std::int32_t f = 0; f < mesh.num_faces(); ++f) {
    const auto& [a, b, c] = mesh.faces[f];
    const double x = (mesh.positions[a] + mesh.positions[b] + mesh.positions[c]).x() / 3;
    piece.push_back(x > 0.9 * top);
    (piece.back() != 0 ? cap : rest).push_back(f);
  }
  ASSERT_GT(cap.size(), 10u);
  ASSERT_GT(rest.size(), 10 * cap.size());
  Gluing gluing(surface);
  GluePieces(piece, &gluing);
  const AtlasTuning tuning;
  StretchEstimate estimate(gluing, tuning);
  const StretchEstimate::Sums of_rest = EstimateOf(surface, rest, &estimate);
  const StretchEstimate::Sums of_cap = EstimateOf(surface, cap, &estimate);
  const StretchEstimate::Sums before = {of_rest.area + of_cap.area, of_rest.larger + of_cap.larger,
                                        of_rest.smaller + of_cap.smaller};
  for (const EdgeHandle e : surface.mesh->edges()) {
    if (!surface.mesh->is_boundary(e)) gluing.Glue(surface.mesh->halfedge_handle(e, 0));
  }
  StretchEstimate::Work work;
  const StretchEstimate::Sums joined = estimate.Joined(cap, before, &work);
  estimate.Keep(work);
  StretchEstimate anew(gluing, tuning);
  std::vector<std::int32_t> all = rest;
  all.insert(all.end(), cap.begin(), cap.end());
  EXPECT_NEAR(joined.Stretch(), EstimateOf(surface, all, &anew).Stretch(), 0.03);
  EXPECT_NEAR(estimate.Joined(cap, joined, &work).Stretch(), joined.Stretch(), 1e-3);
  EXPECT_NEAR(joined.area, before.area, 1e-12);
}

// Half-edges with a face and none across.
std::int64_t CountOpen(const Surface& surface) {
  const auto half_edges = surface.mesh->halfedges();
  return std::count_if(half_edges.begin(), half_edges.end(),
                       [&](HalfedgeHandle h) { return surface.mesh->is_boundary(h); });
}

TEST(Surface, EndsWhereChartsMust) {
  const Mesh strip = testing::MoebiusStrip(8);
  EXPECT_GT(MakeSurface(strip, {})->clashing_edges, 0);
  Mesh fan = testing::Plane(1, 1);
  fan.positions.push_back({0, 0, 1});
  const std::int32_t shared[2] = {fan.faces[0][0], fan.faces[0][2]};
  ASSERT_TRUE(std::count(fan.faces[1].begin(), fan.faces[1].end(), shared[0]) &&
              std::count(fan.faces[1].begin(), fan.faces[1].end(), shared[1]));
  fan.faces.push_back({shared[0], shared[1], 4});
  const Surface surface = MakeSurface(fan, {}).value();
  EXPECT_EQ(surface.non_manifold_edges, 1);
  EXPECT_EQ(CountOpen(surface), 7) << "the flat pair stays joined";
}

TEST(Segmentation, ChartsAreJoinedPartedAndNumberedAnew) {
  const Surface surface = MakeSurface(testing::Torus(16, 12), {}).value();
  AtlasTuning tuning;
  tuning.widest_tip = tuning.seams_widest_tip;
  Segmentation segmentation(surface, Segmentation::Kind::kStretch, 1.02, {}, tuning);
  const auto chart = segmentation.chart();
  std::vector<std::vector<HalfedgeHandle>> outlines;
  for (std::size_t i = 0; i < segmentation.charts().size(); ++i) {
    outlines.push_back(segmentation.Outline(static_cast<std::int32_t>(i)));
  }
  const std::vector<Segmentation::Joint> joints = segmentation.Joints(std::move(outlines));
  ASSERT_FALSE(joints.empty());
  for (const Segmentation::Joint& joint : joints) {
    EXPECT_LT(joint.chart, joint.other);
    for (const HalfedgeHandle h : joint.border) {
      EXPECT_EQ(chart[surface.mesh->face_handle(h).idx()], joint.chart);
      EXPECT_EQ(chart[surface.face_across(h)], joint.other);
    }
  }
  int joined = 0, with_dart = 0;
  for (const Segmentation::Joint& joint : joints) {
    for (const bool is_part : {false, true}) {
      Segmentation::Joint glued = joint;
      if (is_part && glued.border.size() < 2) continue;
      glued.is_part = is_part;
      if (is_part) glued.border.pop_back();
      const auto done = segmentation.Join(glued);
      if (!done) continue;
      ++joined;
      EXPECT_TRUE(segmentation.charts()[joint.other].empty());
      ExpectDisc(surface, segmentation.gluing(), segmentation.charts()[joint.chart]);
      if (is_part) {
        ++with_dart;
        EXPECT_TRUE(segmentation.gluing().IsOutline(joint.border.back()));
        EXPECT_TRUE(segmentation.HasSlit(joint.chart));
      }
      segmentation.UndoJoin(*done);
      ExpectDiscs(surface, segmentation);
      EXPECT_EQ(segmentation.chart(), chart);
    }
  }
  EXPECT_GT(with_dart, 0);
  EXPECT_GT(joined, with_dart);
  const auto is_kept = [&](const Segmentation::Joint& joint) { return segmentation.Join(joint).has_value(); };
  ASSERT_TRUE(std::any_of(joints.begin(), joints.end(), is_kept));
  const std::size_t before = segmentation.charts().size();
  segmentation.DropEmpty();
  EXPECT_EQ(segmentation.charts().size(), before - 1);
  for (const std::vector<std::int32_t>& faces : segmentation.charts()) EXPECT_FALSE(faces.empty());
  ExpectDiscs(surface, segmentation);
}

// A cube of six squares of two triangles, with a third triangle on each that has the other diagonal. Import joins the
// twelve triangles of the cube at its edges, and the six flaps among themselves.
Mesh CubeWithFlaps() {
  Mesh mesh;
  for (int i = 0; i < 8; ++i) mesh.positions.emplace_back(i & 1, i >> 1 & 1, i >> 2);
  const std::int32_t squares[6][4] = {{0, 2, 3, 1}, {4, 5, 7, 6}, {0, 1, 5, 4},
                                      {2, 6, 7, 3}, {0, 4, 6, 2}, {1, 3, 7, 5}};
  for (const auto& [a, b, c, d] : squares) mesh.faces.insert(mesh.faces.end(), {{a, b, c}, {a, c, d}, {a, b, d}});
  return mesh;
}

TEST(Rejoining, ChartsGoOnInOthersWhereMoreThanTwoFacesMeet) {
  const Mesh mesh = CubeWithFlaps();
  const Surface surface = MakeSurface(mesh, {}).value();
  ASSERT_FALSE(surface.crowded_edges.empty());
  const Segmentation before(surface, Segmentation::Kind::kStretch, 1.05, {});
  ExpectDiscs(surface, before);
  const auto pairs = PairsToRejoin(before.gluing(), before.chart());
  ASSERT_FALSE(pairs.empty());
  const Surface rejoined = Rejoin(mesh, surface, pairs);
  for (const auto& [c, d] : pairs) {
    const HalfedgeHandle h = HalfEdgeOf(*rejoined.mesh, c), g = HalfEdgeOf(*rejoined.mesh, d);
    EXPECT_EQ(rejoined.mesh->opposite_halfedge_handle(h), g);
    EXPECT_EQ(rejoined.mesh->data(rejoined.mesh->from_vertex_handle(h)).source,
              surface.mesh->data(surface.mesh->from_vertex_handle(HalfEdgeOf(*surface.mesh, c))).source);
    EXPECT_EQ(rejoined.angle[h.idx()], surface.angle[HalfEdgeOf(*surface.mesh, c).idx()]);
    EXPECT_NE(before.chart()[c / 3], before.chart()[d / 3]);
  }
  const Segmentation after(rejoined, before, 1.05, {});
  ExpectDiscs(rejoined, after);
  EXPECT_LT(after.charts().size(), before.charts().size());
}

TEST(Rejoining, RespectsGivenSeamsAndHardEdges) {
  const Mesh mesh = CubeWithFlaps();
  const auto pairs = [&](const GivenSeams& seams) {
    const Surface surface = MakeSurface(mesh, seams).value();
    const Segmentation segmentation(surface, Segmentation::Kind::kStretch, 1.05, {});
    return PairsToRejoin(segmentation.gluing(), segmentation.chart());
  };
  std::vector<std::int32_t> all(3 * mesh.faces.size());
  std::iota(all.begin(), all.end(), 0);
  EXPECT_TRUE(pairs({all, {}, 0}).empty());
  EXPECT_TRUE(pairs({{}, {}, 80}).empty()) << "all edges of a cube are hard";
  EXPECT_FALSE(pairs({{}, {}, 100}).empty());
}

TEST(Surface, GivenSeamsAndHardEdgesEndChartsAndUncutEdgesDoNot) {
  const Mesh mesh = testing::Plane(2, 2);
  const Surface all = MakeSurface(mesh, {}).value();
  const auto across = [&](const GivenSeams& seams, std::int32_t c) {
    const Surface surface = MakeSurface(mesh, seams).value();
    return surface.face_across(HalfEdgeOf(*surface.mesh, c));
  };
  std::int32_t c = 0;
  while (across({}, c) < 0) ++c;
  const std::int32_t other = CornerOf(*all.mesh, all.mesh->opposite_halfedge_handle(HalfEdgeOf(*all.mesh, c)));
  EXPECT_EQ(across({{c}, {}, 0}, c), -1);
  EXPECT_EQ(across({{c}, {}, 0}, other), -1);

  const Mesh tetrahedron = testing::Tetrahedron();
  const auto open = [&](const GivenSeams& seams) { return CountOpen(MakeSurface(tetrahedron, seams).value()); };
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
  const Surface surface = MakeSurface(mesh, {}).value();
  EXPECT_TRUE(surface.takes_part[2]);
  EXPECT_TRUE(surface.is_flat[2]);
  double sum = 0;
  for (int k = 0; k < 3; ++k) {
    const double angle = surface.angle[HalfEdgeOf(*surface.mesh, 6 + k).idx()];
    EXPECT_GT(angle, 1e-4);
    sum += angle;
  }
  EXPECT_NEAR(sum, std::numbers::pi, 1e-12);
  EXPECT_FALSE(surface.takes_part[3]);
}

}  // namespace
}  // namespace planish
