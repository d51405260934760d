// Pieces with holes and given seams: the map keeps the borders as they are, or a warning says where a slit was needed.
#include "core/unwrap/holes.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <cstdint>
#include <map>
#include <numbers>
#include <random>
#include <set>
#include <string>
#include <utility>
#include <vector>

#include "core/base/error.h"
#include "core/mesh/half_edges.h"
#include "core/unwrap/chart.h"
#include "core/unwrap/unwrap.h"
#include "core/unwrap/verify.h"
#include "gmock/gmock.h"
#include "gtest/gtest.h"
#include "tests/core/shapes.h"

namespace planish {
namespace {

// The mesh without the faces whose middles fulfil `is_hole`.
template <typename IsHole>
Mesh WithHoles(Mesh mesh, const IsHole& is_hole) {
  std::erase_if(mesh.faces, [&](const Face& face) {
    return is_hole(Vec3((mesh.positions[face[0]] + mesh.positions[face[1]] + mesh.positions[face[2]]) / 3));
  });
  return mesh;
}

// A wavy plate of 20 x 20 cells with round and long holes.
Mesh HoledPlate(std::uint32_t seed) {
  std::mt19937 random(seed);
  const auto draw = [&](double low, double high) {
    return low + (high - low) * static_cast<double>(random() % 10'000) / 10'000;
  };
  const double height = draw(0, 0.3), wave = draw(2, 8), turn = draw(0, 3);
  const Mesh whole = testing::Patch(
      20, 20, [&](double u, double v) { return Vec3(u, v, height * std::sin(wave * u + turn) * std::cos(wave * v)); },
      draw(0, 0.3));
  struct Hole {
    double u, v, a, b;
  };
  std::vector<Hole> holes;
  for (std::uint32_t i = 0; i < 1 + seed % 4; ++i) {
    const double long_way = draw(0.08, 0.17), short_way = draw(0.06, 0.1);
    const bool is_tall = random() % 2 == 0;
    holes.push_back(
        {0.25 + 0.5 * (i % 2), 0.25 + 0.5 * (i / 2), is_tall ? short_way : long_way, is_tall ? long_way : short_way});
  }
  return WithHoles(whole, [&](const Vec3& p) {
    return std::any_of(holes.begin(), holes.end(),
                       [&](const Hole& h) { return std::hypot((p.x() - h.u) / h.a, (p.y() - h.v) / h.b) < 1; });
  });
}

// A ring of a cone, or a tube: from radius 1 to `inner`, `height` high.
Mesh RingOf(int columns, int rows, double inner, double height) {
  Mesh mesh;
  for (int j = 0; j <= rows; ++j) {
    const double t = static_cast<double>(j) / rows, r = 1 + (inner - 1) * t;
    for (int i = 0; i < columns; ++i) {
      const double a = 2 * std::numbers::pi * i / columns;
      mesh.positions.emplace_back(r * std::cos(a), r * std::sin(a), height * t);
    }
  }
  for (int j = 0; j < rows; ++j) {
    for (int i = 0; i < columns; ++i) {
      const std::int32_t a = j * columns + i, b = j * columns + (i + 1) % columns;
      mesh.faces.push_back({a, b, b + columns});
      mesh.faces.push_back({a, b + columns, a + columns});
    }
  }
  return mesh;
}

// A cap of a sphere with four holes: a button.
Mesh HoledButton() {
  const Mesh cap = testing::PuncturedSphere(14, 1.9);
  return WithHoles(cap,
                   [](const Vec3& p) { return std::hypot(std::abs(p.x()) - 0.33, std::abs(p.y()) - 0.33) < 0.17; });
}

// Inner edges of the mesh whose sides have different UV.
std::int64_t PartedEdges(const Mesh& mesh, const UnwrapResult& result) {
  std::int64_t parted = 0;
  const EdgeGroups edges = GroupHalfEdges(mesh.faces, mesh.num_vertices());
  const auto uv = [&](std::int32_t c, std::int32_t v) {
    for (int k = 0; k < 3; ++k) {
      if (mesh.faces[c / 3][k] == v) return UvOf(result.uv, c / 3 * 3 + k);
    }
    return Vec2(0, 0);
  };
  for (std::int32_t e = 0; e < edges.count(); ++e) {
    if (edges[e].size() != 2) continue;
    const std::int32_t a = Origin(mesh.faces, edges[e][0]), b = Target(mesh.faces, edges[e][0]);
    parted += uv(edges[e][0], a) != uv(edges[e][1], a) || uv(edges[e][0], b) != uv(edges[e][1], b);
  }
  return parted;
}

const UnwrapWarning* WarningOf(const UnwrapResult& result, const std::string& reason) {
  for (const UnwrapWarning& warning : result.warnings) {
    if (warning.reason == reason) return &warning;
  }
  return nullptr;
}

UnwrapOptions ByPolicy(SeamPolicy policy) {
  UnwrapOptions options;
  options.seams.policy = policy;
  return options;
}

// What is promised whatever the piece: no faults in the bytes, and every edge that is parted is told.
void ExpectHolePromises(const Mesh& mesh, const absl::StatusOr<UnwrapResult>& result, const std::string& what) {
  ASSERT_TRUE(result.ok()) << what << result.status();
  const std::vector<std::int32_t> nothing_glued(3 * mesh.faces.size(), -1);
  const OrientationFaults turned = CheckOrientations(result->uv);
  EXPECT_EQ(turned.flipped + turned.degenerate, 0) << what;
  EXPECT_EQ(CheckOverlaps(nothing_glued, result->uv, turned).pairs, 0) << what;
  const UnwrapWarning* const added = WarningOf(*result, "SEAMS_ADDED");
  EXPECT_EQ(PartedEdges(mesh, *result), added == nullptr ? 0 : std::stoll(added->metadata.at("slit_edges"))) << what;
  EXPECT_TRUE(added == nullptr || !added->faces.empty()) << what;
  EXPECT_TRUE(result->quality.stretch_l2 <= 2 || WarningOf(*result, "STRETCH_HIGH") != nullptr) << what;
}

TEST(Holes, OfPlatesAreKept) {
  for (std::uint32_t seed = 0; seed < 12; ++seed) {
    const Mesh mesh = HoledPlate(seed);
    const auto kept = Unwrap(mesh, ByPolicy(SeamPolicy::kKeep), {});
    ExpectHolePromises(mesh, kept, "plate " + std::to_string(seed));
    EXPECT_EQ(WarningOf(*kept, "SEAMS_ADDED"), nullptr) << seed;
    EXPECT_LT(kept->quality.stretch_l2, 1.1) << seed;
    EXPECT_EQ(kept->charts.size(), 1u);
    if (seed >= 4) continue;
    ExpectHolePromises(mesh, Unwrap(mesh, ByPolicy(SeamPolicy::kNeeded), {}), "needed, plate " + std::to_string(seed));
  }
}

TEST(Holes, OfButtonsAndRingsAreKept) {
  for (const Mesh& mesh : {HoledButton(), RingOf(24, 4, 0.5, 0), RingOf(24, 4, 0.5, 0.5), RingOf(40, 3, 0.9, 0.1),
                           RingOf(7, 1, 0.3, 0.2), testing::Cylinder(24, 1)}) {
    const auto kept = Unwrap(mesh, ByPolicy(SeamPolicy::kKeep), {});
    ExpectHolePromises(mesh, kept, std::to_string(mesh.num_faces()));
    EXPECT_EQ(WarningOf(*kept, "SEAMS_ADDED"), nullptr) << mesh.num_faces();
    EXPECT_EQ(kept->charts.size(), 1u);
  }
}

// A tube is stretched as a ring, which is what kKeep asks for. With kNeeded it is slit along a straight line, and the
// warning says why.
TEST(Holes, OfATubeAreJoinedByAStraightSlitWhereThatIsAllowed) {
  const Mesh mesh = RingOf(16, 24, 1, 8);
  const auto kept = Unwrap(mesh, ByPolicy(SeamPolicy::kKeep), {});
  ExpectHolePromises(mesh, kept, "kept tube");
  EXPECT_EQ(WarningOf(*kept, "SEAMS_ADDED"), nullptr);
  EXPECT_LT(kept->quality.stretch_l2, 2);
  const auto slit = Unwrap(mesh, ByPolicy(SeamPolicy::kNeeded), {});
  ExpectHolePromises(mesh, slit, "slit tube");
  const UnwrapWarning* const added = WarningOf(*slit, "SEAMS_ADDED");
  ASSERT_NE(added, nullptr);
  EXPECT_EQ(added->metadata.at("slit"), "1");
  EXPECT_EQ(added->metadata.at("slit_edges"), "24");
  EXPECT_THAT(added->message, ::testing::HasSubstr("1 chart with holes was slit open"));
  EXPECT_NEAR(slit->quality.stretch_l2, 1, 1e-3);
}

// A long box without its ends, of few faces: no ring of it is stretched by 2 or less.
TEST(Holes, AreSlitWithKeepWhereNoOtherMapIsOfUse) {
  Mesh mesh = RingOf(3, 40, 1, 400);
  const auto result = Unwrap(mesh, ByPolicy(SeamPolicy::kKeep), {});
  ExpectHolePromises(mesh, result, "long box");
  const UnwrapWarning* const added = WarningOf(*result, "SEAMS_ADDED");
  ASSERT_NE(added, nullptr);
  EXPECT_THAT(added->message, ::testing::HasSubstr("stretched beyond 2"));
}

// Slits are as few edges as join all holes to the outline, one path to each, whatever they were before.
TEST(Holes, AreReachedByShortSlits) {
  const Mesh mesh = WithHoles(testing::Plane(12, 12), [](const Vec3& p) {
    const auto near = [&](double u, double v) { return std::max(std::abs(p.x() - u), std::abs(p.y() - v)) < 1.0 / 12; };
    return near(0.25, 0.5) || near(0.5, 0.5);
  });
  FlatMesh disc = {mesh.faces, {}, mesh.positions};
  disc.opposite.assign(3 * mesh.faces.size(), -1);
  const EdgeGroups edges = GroupHalfEdges(mesh.faces, mesh.num_vertices());
  std::vector<std::pair<std::int32_t, std::int32_t>> slits;
  for (std::int32_t e = 0; e < edges.count(); ++e) {
    if (edges[e].size() == 2) slits.emplace_back(edges[e][0], edges[e][1]);
  }
  // As if every face lay by itself.
  disc.faces = FacesOfFans(disc.opposite, [](std::int32_t) {});
  disc.positions.clear();
  for (std::int32_t c = 0; c < 3 * std::ssize(mesh.faces); ++c)
    disc.positions.push_back(mesh.positions[mesh.faces[c / 3][c % 3]]);
  const auto cost = [&](std::int32_t c) {
    return (disc.positions[Target(disc.faces, c)] - disc.positions[Origin(disc.faces, c)]).norm();
  };
  SlitAlongShortPaths(cost, &disc, &slits);
  EXPECT_EQ(slits.size(), 3u);  // two cells from the rim to the first hole, one to the second
  EXPECT_EQ(BoundaryLoops(disc.opposite).count(), 1);
}

TEST(Holes, AreNotWhatClosedPiecesHave) {
  for (const Mesh& mesh : {testing::Tetrahedron(), testing::Torus(12, 8)}) {
    const auto refused = Unwrap(mesh, ByPolicy(SeamPolicy::kKeep), {});
    EXPECT_EQ(ErrorInfoOf(refused.status()).reason, "PIECE_NOT_A_DISC");
    EXPECT_EQ(ErrorInfoOf(refused.status()).metadata.at("faces"), "0");
    EXPECT_TRUE(Unwrap(mesh, ByPolicy(SeamPolicy::kNeeded), {}).ok());
  }
}

}  // namespace
}  // namespace planish
