#include "core/abf/boundary_control.h"

#include <cmath>
#include <numbers>
#include <set>

#include "core/abf/topology.h"
#include "core/mesh/angles.h"
#include "core/mesh/half_edges.h"
#include "core/unwrap/unwrap.h"
#include "core/unwrap/verify.h"
#include "gtest/gtest.h"
#include "tests/core/disc_options.h"
#include "tests/core/every_solver.h"
#include "tests/core/shapes.h"
#include "tests/testing/discs.h"

namespace planish {
namespace {

constexpr double kPi = std::numbers::pi;

// A strip one cell wide, bent by `turn` radians: no interior vertices, and every inner edge joins boundary vertices.
Mesh BentStrip(int cells, double turn) {
  return testing::Patch(cells, 1, [turn](double s, double t) {
    return Vec3((2 - t) * std::sin(turn * s), (t - 2) * std::cos(turn * s), 0);
  });
}

struct BoundedDisc {
  explicit BoundedDisc(const Mesh& mesh)
      : topology(DiscTopology(mesh).value()), target(MakeTargetAngles(topology, MeasuredAngles(mesh))) {}
  Flattening Flatten(FlattenOptions options = {}) const {
    options.boundary = BoundaryType::kConvex;
    return FlattenAngles(topology, target, options, {}).value();
  }
  // h_b of every boundary vertex: angles minus pi.
  Eigen::VectorXd Excess(const Eigen::VectorXd& x) const {
    return ActiveSet(topology, target).Pressures(x, Multipliers::Zero(topology));
  }
  Topology topology;
  TargetAngles target;
};

UnwrapResult UnwrapConvex(const Mesh& mesh) {
  UnwrapOptions options;
  options.flatten.boundary = BoundaryType::kConvex;
  return Unwrap(mesh, testing::AsDisc(options), {}).value();
}

// Sum of the delivered UV angles at every boundary vertex, the largest one.
double LargestBoundaryAngle(const Mesh& mesh, const CornerUv& uv) {
  const BoundedDisc disc(mesh);
  Eigen::VectorXd x(disc.topology.num_corners());
  const auto at = [&](std::int32_t f, int k) { return Vec2(uv[2 * (3 * f + k)], uv[2 * (3 * f + k) + 1]); };
  for (std::int32_t c = 0; c < disc.topology.num_corners(); ++c) {
    x[c] = testing::AngleAt(at(c / 3, c % 3), at(c / 3, Next(c % 3)), at(c / 3, Prev(c % 3)));
  }
  return kPi + disc.Excess(x).maxCoeff();
}

std::vector<Mesh> NonConvexMeshes() {
  return {testing::LShape(4),        testing::LShape(9),
          testing::Star(4),          testing::Star(6),
          BentStrip(24, 5.0),        testing::Hills(14, 12, 2),
          testing::Hills(20, 18, 1), testing::HalfCylinder(9, 7),
          testing::Cone(9, 2),       testing::PuncturedSphere(8, 1.0)};
}

TEST(BoundaryControl, MakesEveryOutlineConvexAndInjective) {
  for (const Mesh& mesh : NonConvexMeshes()) {
    const UnwrapResult result = UnwrapConvex(mesh);
    const FlattenSummary& summary = *result.charts.at(0).flatten;
    EXPECT_TRUE(summary.converged) << summary.stop_message;
    EXPECT_TRUE(summary.boundary.settled) << summary.stop_message;
    EXPECT_LE(summary.residual.Max(), 1e-9);
    EXPECT_EQ(result.quality.flipped + result.quality.degenerate, 0);
    const OrientationFaults orientation = CheckOrientations(result.uv);
    EXPECT_EQ(CheckOverlaps(DiscTopology(mesh).value().opposite, result.uv, orientation).pairs, 0);
    EXPECT_LT(LargestBoundaryAngle(mesh, result.uv), kPi + (result.precision == Precision::kDouble ? 1e-8 : 1e-3));
    for (const UnwrapWarning& warning : result.warnings) EXPECT_NE(warning.reason, "BOUNDARY_NOT_SETTLED");
  }
}

TEST(BoundaryControl, EndsWhereTheInequalitiesHoldAndTheirMultipliersHaveTheRightSign) {
  for (const Mesh& mesh : {testing::LShape(6), testing::Star(6), testing::Hills(14, 12, 2)}) {
    const BoundedDisc disc(mesh);
    const Flattening result = disc.Flatten();
    ASSERT_TRUE(result.summary.converged) << result.summary.stop_message;
    const Eigen::VectorXd excess = disc.Excess(result.angles);
    EXPECT_LE(excess.maxCoeff(), 1e-9);
    EXPECT_NEAR(excess.sum(), -2 * kPi, 1e-7) << "Gauss-Bonnet";
    const auto straight = (excess.array().abs() <= 1e-9).count();
    EXPECT_EQ(straight, result.summary.boundary.active);
    EXPECT_EQ(excess.size(), result.summary.boundary.vertices);
    EXPECT_GT(result.summary.boundary.set_changes, 0);

    // Releasing any one straight vertex must lead to more than pi there, at no higher energy: its multiplier was right.
    ActiveSet set(disc.topology, disc.target);
    Eigen::VectorXd wanted = Eigen::VectorXd::Constant(excess.size(), -1);
    for (Eigen::Index b = 0; b < excess.size(); ++b) {
      if (std::abs(excess[b]) <= 1e-9) wanted[b] = 1;
    }
    set.Update(wanted, 0, /*only_last=*/false);
    for (Eigen::Index b = 0, tried = 0; b < excess.size() && tried < 4; ++b) {
      if (wanted[b] < 0) continue;
      ++tried;
      ActiveSet released = set;
      Eigen::VectorXd one = wanted;
      one[b] = -1;
      EXPECT_EQ(released.Update(one, 0, /*only_last=*/false), 1);
      const Flattening other = FlattenAngles(released.ConstrainedTopology(), disc.target, {}, {}).value();
      ASSERT_TRUE(other.summary.converged) << other.summary.stop_message;
      EXPECT_GT(disc.Excess(other.angles)[b], -1e-9) << b;
      EXPECT_LE(other.summary.energy, result.summary.energy * (1 + 1e-9)) << b;
    }
  }
}

TEST(BoundaryControl, LeavesConvexOutlinesAlone) {
  for (const Mesh& mesh : {testing::Plane(6, 5, 0.2), testing::PuncturedSphere(8, 1.5), testing::Cone(7, 1)}) {
    const BoundedDisc disc(mesh);
    const Flattening free = FlattenAngles(disc.topology, disc.target, {}, {}).value();
    ASSERT_LE(disc.Excess(free.angles).maxCoeff(), 1e-9) << "the example must be convex by itself";
    const Flattening convex = disc.Flatten();
    EXPECT_TRUE(convex.summary.boundary.settled);
    EXPECT_EQ(convex.summary.boundary.active, 0);
    EXPECT_EQ(convex.summary.boundary.set_changes, 0);
    EXPECT_LT((convex.angles - free.angles).cwiseAbs().maxCoeff(), 1e-8);
  }
}

TEST(BoundaryControl, EverySolverFindsTheSameAngles) {
  const BoundedDisc disc(testing::LShape(5));
  const Flattening expected = disc.Flatten();
  EXPECT_EQ(expected.summary.boundary.type, BoundaryType::kConvex);
  for (const FlattenOptions& options : testing::EverySolver()) {
    const Flattening result = disc.Flatten(options);
    EXPECT_TRUE(result.summary.converged && result.summary.boundary.settled) << result.summary.stop_message;
    EXPECT_EQ(result.summary.boundary.active, expected.summary.boundary.active);
    EXPECT_LT((result.angles - expected.angles).cwiseAbs().maxCoeff(), 1e-6)
        << Name(options.solver) << " " << Name(options.system) << " " << Name(options.preconditioner);
  }
}

TEST(BoundaryControl, KeepsABarrierWhereAnglesWouldVanish) {
  const Flattening result = BoundedDisc(testing::PuncturedSphere(10, 0.1)).Flatten();
  EXPECT_TRUE(result.summary.converged) << result.summary.stop_message;
  EXPECT_EQ(result.summary.barrier, 0.01);
  EXPECT_TRUE(result.summary.boundary.settled);
}

TEST(BoundaryControl, SaysThatItRanOutOfIterations) {
  const BoundedDisc disc(testing::LShape(8));
  FlattenOptions options;
  for (const int limit : {1, 3}) {
    options.max_newton_iterations = limit;
    const Flattening result = disc.Flatten(options);
    EXPECT_FALSE(result.summary.converged);
    EXPECT_FALSE(result.summary.boundary.settled);
    EXPECT_EQ(result.summary.newton_iterations, limit);
    EXPECT_NE(result.summary.stop_message.find("has not settled"), std::string::npos) << result.summary.stop_message;
  }
}

TEST(BoundaryControl, CountsAndInterruptsOverAllSolves) {
  const BoundedDisc disc(testing::LShape(8));
  FlattenOptions options;
  options.boundary = BoundaryType::kConvex;
  int points = 0, newton = 0;
  std::vector<float> residuals;
  FlattenControl control;
  control.on_progress = [&](const FlattenProgress& progress) {
    ++points;
    EXPECT_GE(progress.newton_iteration, newton);
    newton = progress.newton_iteration;
    residuals.resize(newton + 1);
    residuals.back() = static_cast<float>(progress.residual.Max());
  };
  const Flattening result = FlattenAngles(disc.topology, disc.target, options, control).value();
  EXPECT_EQ(newton, result.summary.newton_iterations);
  EXPECT_EQ(result.summary.residuals, residuals);
  EXPECT_EQ(result.angles, disc.Flatten().angles) << "the same bytes every time";
  for (const int at : {1, points / 2, points - 2}) {
    Interrupter interrupter;
    int seen = 0;
    control.cancel = &interrupter;
    control.on_progress = [&](const FlattenProgress&) {
      if (seen++ == at) interrupter.Interrupt();
    };
    EXPECT_EQ(FlattenAngles(disc.topology, disc.target, options, control).status().code(),
              absl::StatusCode::kCancelled);
  }
}

TEST(ActiveSet, FollowsTheBoundaryCounterClockwise) {
  const Mesh mesh = testing::LShape(3);
  const BoundedDisc disc(mesh);
  const ActiveSet set(disc.topology, disc.target);
  ASSERT_EQ(set.num_vertices(), 24);
  double area = 0;
  for (std::int32_t b = 0; b < set.num_vertices(); ++b) {
    const Vec3 &p = mesh.positions[set.vertices()[b]], &q = mesh.positions[set.vertices()[(b + 1) % 24]];
    EXPECT_NEAR((q - p).norm(), 1.0 / 6, 1e-12);
    area += (p.x() * q.y() - q.x() * p.y()) / 2;
  }
  EXPECT_NEAR(area, 0.75, 1e-12);
}

TEST(ActiveSet, NeverAsksForAPolygonThatDoesNotExist) {
  for (const Mesh& mesh : {BentStrip(12, 3.0), testing::Plane(5, 4), testing::Cone(6, 1), testing::LShape(2)}) {
    const BoundedDisc disc(mesh);
    ActiveSet set(disc.topology, disc.target);
    const std::int32_t n = set.num_vertices();
    Eigen::VectorXd pressures(n);
    for (std::int32_t b = 0; b < n; ++b) pressures[b] = 1 + (b * 7) % n;
    const std::int32_t changed = set.Update(pressures, 0, /*only_last=*/false);
    EXPECT_EQ(set.num_active(), changed);
    EXPECT_LE(set.num_active(), n - 3);
    std::vector<std::int32_t> position(mesh.num_vertices(), -1);
    for (std::int32_t b = 0; b < n; ++b) position[set.vertices()[b]] = b;
    for (std::int32_t c = 0; c < disc.topology.num_corners(); ++c) {
      const std::int32_t from = position[Origin(mesh.faces, c)], to = position[Target(mesh.faces, c)];
      if (disc.topology.opposite[c] < 0 || from < 0 || to < 0) continue;
      bool bends = false;
      for (std::int32_t b = (from + 1) % n; b != to; b = (b + 1) % n) bends |= !set.active()[b];
      EXPECT_TRUE(bends) << "the edge " << c << " would lie on one straight side";
    }
  }
}

TEST(ActiveSet, CarriesMultipliersOfVerticesThatStay) {
  const BoundedDisc disc(testing::Cone(9, 1));
  ActiveSet set(disc.topology, disc.target);
  Eigen::VectorXd pressures = Eigen::VectorXd::Constant(9, -1);
  pressures[2] = pressures[5] = pressures[7] = 1;
  EXPECT_EQ(set.Update(pressures, 0, /*only_last=*/false), 3);
  const Topology topology = set.ConstrainedTopology();
  ASSERT_EQ(topology.num_rows, 1 + 3);
  EXPECT_EQ(topology.vertex_row[set.vertices()[5]], 2);
  Multipliers mu = Multipliers::Zero(topology);
  mu.pair << 1, 2, 20, 0, 50, 0, 70, 0;
  const std::vector<char> before = set.active();
  pressures[5] = -1;
  pressures[0] = 1;
  EXPECT_EQ(set.CountWrong(pressures, 0), 2);
  EXPECT_EQ(set.Update(pressures, 0, /*only_last=*/true), 1) << "the last one only";
  EXPECT_FALSE(set.active()[5]);
  EXPECT_EQ(set.Update(pressures, 0, /*only_last=*/false), 1);
  Eigen::VectorXd expected(8);
  expected << 1, 2, 0, 0, 20, 0, 70, 0;
  EXPECT_EQ(set.Carry(mu, before).pair, expected);
}

}  // namespace
}  // namespace planish
