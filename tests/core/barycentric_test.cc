// MapByBarycentres(): one to one on every disc, exact where the plane is known.
#include <cmath>
#include <numbers>

#include "core/abf/topology.h"
#include "core/mesh/predicates.h"
#include "core/unwrap/fixed_borders.h"
#include "core/unwrap/unwrap.h"
#include "gtest/gtest.h"
#include "tests/core/shapes.h"
#include "tests/testing/discs.h"

namespace planish {
namespace {

std::vector<Vec2> Map(const Mesh& mesh) {
  return MapByBarycentres(DiscTopology(mesh).value(), mesh.positions, {});
}

// No triangle is turned over; with an outline on a circle that is one to one.
void ExpectOneToOne(const Mesh& mesh, const std::vector<Vec2>& map) {
  ASSERT_EQ(map.size(), mesh.positions.size());
  for (const Face& face : mesh.faces) EXPECT_GT(Orientation(map[face[0]], map[face[1]], map[face[2]]), 0);
}

TEST(Barycentric, KeepsAFlatDiscOfRegularOutline) {
  // Rings of 24 vertices, of uneven radii and turned against each other.
  constexpr int kAround = 24;
  Mesh mesh;
  mesh.positions.push_back(Vec3(0.1, 0.05, 0));
  const std::vector<double> radii = {0.3, 0.45, 1};
  for (std::size_t ring = 0; ring < radii.size(); ++ring) {
    for (int i = 0; i < kAround; ++i) {
      const double turn = 2 * std::numbers::pi * i / kAround + 0.1 * static_cast<double>(ring);
      mesh.positions.push_back(Vec3(radii[ring] * std::cos(turn), radii[ring] * std::sin(turn), 0));
    }
  }
  const auto at = [](int ring, int i) { return 1 + kAround * ring + (i + kAround) % kAround; };
  for (int i = 0; i < kAround; ++i) {
    mesh.faces.push_back({0, at(0, i), at(0, i + 1)});
    for (int ring = 0; ring < 2; ++ring) {
      mesh.faces.push_back({at(ring, i), at(ring + 1, i), at(ring, i + 1)});
      mesh.faces.push_back({at(ring, i + 1), at(ring + 1, i), at(ring + 1, i + 1)});
    }
  }
  const std::vector<Vec2> map = Map(mesh);
  ExpectOneToOne(mesh, map);
  for (const Face& face : mesh.faces) {
    for (int k = 0; k < 3; ++k) {
      const std::int32_t v = face[k], w = face[(k + 1) % 3];
      EXPECT_NEAR((map[v] - map[w]).norm(), (mesh.positions[v] - mesh.positions[w]).norm(), 1e-9);
    }
  }
}

TEST(Barycentric, IsOneToOneWhereAbfIsNot) {
  for (const Mesh& mesh : {testing::PuncturedSphere(24, 0.4), testing::Star(6), testing::LShape(8),
                           testing::Hills(30, 30, 3), testing::Cone(9, 5)}) {
    ExpectOneToOne(mesh, Map(mesh));
  }
}

TEST(Barycentric, FacesWithoutAreaDoNoHarm) {
  Mesh mesh = testing::Plane(8, 8);
  const Topology disc = DiscTopology(mesh).value();
  mesh.positions[40] = mesh.positions[41];
  const std::vector<Vec2> map = MapByBarycentres(disc, mesh.positions, {});
  for (const Vec2& p : map) EXPECT_TRUE(p.allFinite());
  ExpectOneToOne(mesh, map);
}

TEST(Barycentric, NothingAfterAnInterrupt) {
  Interrupter interrupter;
  interrupter.Interrupt();
  Execution execution;
  execution.cancel = &interrupter;
  const Mesh mesh = testing::Plane(8, 8);
  EXPECT_TRUE(MapByBarycentres(DiscTopology(mesh).value(), mesh.positions, execution).empty());
}

// Two turns of a winding ramp unroll onto each other; its borders are to be kept.
TEST(Barycentric, KeepsTheBordersOfARampThatWindsOverItself) {
  const Mesh mesh = testing::Patch(160, 6, [](double u, double v) {
    const double turn = 4 * std::numbers::pi * u, radius = 1 + 0.5 * v;
    return Vec3(radius * std::cos(turn), radius * std::sin(turn), 0.3 * u);
  });
  UnwrapOptions options;
  options.seams.policy = SeamPolicy::kNeeded;
  const auto result = Unwrap(mesh, options, {});
  ASSERT_TRUE(result.ok()) << result.status();
  EXPECT_EQ(result->charts.size(), 1u);
  for (const UnwrapWarning& warning : result->warnings) EXPECT_NE(warning.reason, "SEAMS_ADDED");
  EXPECT_EQ(result->quality.flipped + result->quality.degenerate + result->quality.overlapping, 0);
  EXPECT_LT(result->quality.stretch_l2, 1.5) << "10 before it was relaxed";
}

}  // namespace
}  // namespace planish
