#include "core/unwrap/unwrap.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <limits>
#include <map>
#include <numeric>
#include <random>
#include <utility>

#include "core/abf/layout.h"
#include "core/abf/target_angles.h"
#include "core/abf/topology.h"
#include "core/base/error.h"
#include "core/base/execution.h"
#include "core/mesh/angles.h"
#include "core/mesh/box_tree.h"
#include "core/mesh/diagnosis.h"
#include "core/mesh/half_edges.h"
#include "core/pack/outline.h"
#include "core/unwrap/distortion.h"
#include "core/unwrap/verify.h"
#include "gmock/gmock.h"
#include "gtest/gtest.h"
#include "tests/core/disc_options.h"
#include "tests/core/shapes.h"
#include "tests/testing/discs.h"

namespace planish {
namespace {

CornerUv PlanarUv(const Mesh& mesh) {
  CornerUv uv;
  for (const Face& face : mesh.faces) {
    for (const auto v : face) uv.insert(uv.end(), {mesh.positions[v].x(), mesh.positions[v].y()});
  }
  return uv;
}

// Overlapping pairs by comparing all triangles.
std::int64_t BruteForceOverlaps(const Topology& topology, const CornerUv& uv) {
  OrientationFaults pretend;
  pretend.flipped = 1;  // keeps CheckOverlaps from the short cut
  return CheckOverlaps(topology.opposite, uv, pretend).pairs;
}

TEST(Verify, CountsPlantedFaults) {
  const Mesh mesh = testing::Plane(6, 6);
  const Topology topology = DiscTopology(mesh).value();
  const CornerUv uv = PlanarUv(mesh);
  EXPECT_EQ(CheckOrientations(uv).flipped, 0);
  EXPECT_EQ(CheckOverlaps(topology.opposite, uv, CheckOrientations(uv)).pairs, 0);

  CornerUv mirrored = uv;
  for (std::size_t i = 0; i < mirrored.size(); i += 2) mirrored[i] = -mirrored[i];
  EXPECT_EQ(CheckOrientations(mirrored).flipped, topology.num_faces());

  CornerUv collapsed = uv;
  std::copy_n(collapsed.begin() + 6 * 5, 2, collapsed.begin() + 6 * 5 + 2);
  const OrientationFaults faults = CheckOrientations(collapsed);
  EXPECT_EQ(faults.degenerate, 1);
  EXPECT_THAT(faults.faces, ::testing::ElementsAre(5));
}

TEST(Verify, FindsAChartThatRunsOverItself) {
  // A ring that turns by more than a full circle, without a single flip.
  const Mesh spiral = testing::Patch(60, 2, [](double s, double t) {
    const double a = 7.2 * s, r = 1 + 0.5 * t;
    return Vec3(r * std::sin(a), r * std::cos(a), 0);
  });
  const Topology topology = DiscTopology(spiral).value();
  const CornerUv uv = PlanarUv(spiral);
  ASSERT_EQ(CheckOrientations(uv).flipped, 0);
  const Overlaps overlaps = CheckOverlaps(topology.opposite, uv, CheckOrientations(uv));
  EXPECT_GT(overlaps.pairs, 20);
  EXPECT_FALSE(overlaps.limited);
  EXPECT_FALSE(overlaps.faces.empty());
}

TEST(Verify, ShortCutAgreesWithAllPairs) {
  for (const double turn : {5.0, 6.2, 6.5}) {
    const Mesh ring = testing::Patch(40, 3, [turn](double s, double t) {
      const double a = turn * s, r = 1 + t;
      return Vec3(r * std::sin(a), r * std::cos(a), 0);
    });
    const Topology topology = DiscTopology(ring).value();
    const CornerUv uv = PlanarUv(ring);
    ASSERT_EQ(CheckOrientations(uv).flipped, 0);
    const std::int64_t pairs = CheckOverlaps(topology.opposite, uv, CheckOrientations(uv)).pairs;
    EXPECT_EQ(pairs, BruteForceOverlaps(topology, uv));
    EXPECT_EQ(pairs > 0, turn > 2 * M_PI) << turn;
  }
}

std::vector<std::int32_t> AllFaces(const Mesh& mesh) {
  std::vector<std::int32_t> faces(mesh.faces.size());
  std::iota(faces.begin(), faces.end(), 0);
  return faces;
}

TEST(Distortion, OfKnownMaps) {
  const Mesh mesh = testing::Plane(5, 4, 0.3);
  const Topology topology = DiscTopology(mesh).value();
  const Eigen::VectorXd measured = MeasuredAngles(mesh);
  const TargetAngles target = MakeTargetAngles(topology, measured);
  const auto quality = [&](const Eigen::Matrix2d& map) {
    CornerUv uv = PlanarUv(mesh);
    for (std::size_t i = 0; i < uv.size(); i += 2) {
      const Vec2 p = map * Vec2(uv[i], uv[i + 1]);
      uv[i] = p.x();
      uv[i + 1] = p.y();
    }
    Quality q;
    MeasureDistortion(mesh, AllFaces(mesh), measured, target, uv, {}).Fill(&q);
    return q;
  };
  Eigen::Matrix2d similarity, stretch;
  similarity << 0.3, -0.4, 0.4, 0.3;
  stretch << 2, 0, 0, 0.5;
  EXPECT_NEAR(quality(similarity).conformal_distortion_max, 1, 1e-9);
  EXPECT_NEAR(quality(similarity).stretch_l2, 1, 1e-12);
  EXPECT_NEAR(quality(similarity).angle_error_max_deg, 0, 1e-9);
  EXPECT_NEAR(quality(similarity).packing_efficiency, 0.25, 1e-12);
  EXPECT_NEAR(quality(stretch).conformal_distortion_mean, 4, 1e-9);
  EXPECT_NEAR(quality(stretch).conformal_distortion_max, 4, 1e-9);
  EXPECT_NEAR(quality(stretch).stretch_l2, std::sqrt((4 + 0.25) / 2), 1e-9);
  EXPECT_GT(quality(stretch).abf_energy, 0.1);
}

TEST(PlaceInUnitSquare, TurnsTheLongSideAlongU) {
  std::vector<Vec2> points;
  const double c = std::cos(0.7), s = std::sin(0.7);
  for (const Vec2& p : {Vec2(0, 0), Vec2(4, 0), Vec2(4, 1), Vec2(0, 1), Vec2(2, 0.5)}) {
    points.push_back(Vec2(c * p.x() - s * p.y(), s * p.x() + c * p.y()) + Vec2(10, -3));
  }
  PlaceInUnitSquare(points, &points);
  Vec2 low = points[0], high = points[0];
  for (const Vec2& p : points) {
    low = low.cwiseMin(p);
    high = high.cwiseMax(p);
  }
  EXPECT_NEAR(low.norm(), 0, 1e-12);
  EXPECT_NEAR(high.x(), 1, 1e-12);
  EXPECT_NEAR(high.y(), 0.25, 1e-12);
  EXPECT_NEAR(points[4].x(), 0.5, 1e-12);
}

// Every stage sees an interrupt by itself, before it has done anything to speak of.
TEST(Interrupt, IsNoticedInEveryStage) {
  const Mesh mesh = testing::Hills(90, 90);
  const Topology topology = DiscTopology(mesh).value();
  const Eigen::VectorXd measured = MeasuredAngles(mesh);
  const TargetAngles target = MakeTargetAngles(topology, measured);
  const CornerUv collapsed(2 * static_cast<std::size_t>(topology.num_corners()), 0.5);
  Interrupter interrupter;
  interrupter.Interrupt();
  for (const int threads : {1, 3}) {
    ThreadTeam team(threads);
    const Execution execution = {&team, &interrupter};
    EXPECT_EQ(CheckDisc(mesh, execution).code(), absl::StatusCode::kCancelled);
    EXPECT_EQ(GroupHalfEdges(mesh.faces, mesh.num_vertices(), execution).count(), 0);
    EXPECT_TRUE(LayOut(topology, measured, execution).empty());
    std::vector<Vec2> points = {{0, 0}, {4, 0}, {4, 1}, {0, 1}};
    PlaceInUnitSquare(points, &points, execution);
    EXPECT_EQ(points[2], Vec2(4, 1));
    EXPECT_EQ(CheckOrientations(collapsed, execution).degenerate, 0);
    OrientationFaults pretend;
    pretend.flipped = 1;
    const Overlaps overlaps = CheckOverlaps(topology.opposite, collapsed, pretend, execution);
    EXPECT_TRUE(overlaps.limited);
    EXPECT_EQ(overlaps.pairs, 0);
    Quality quality;
    MeasureDistortion(mesh, AllFaces(mesh), measured, target, collapsed, {}, execution).Fill(&quality);
    EXPECT_EQ(quality.packing_efficiency, 0);
    EXPECT_EQ(quality.stretch_l2, 1);
    const BoxTree tree(std::vector<Box>(9000, {{0, 0}, {1, 1}}), execution);
    EXPECT_TRUE(tree.ForEachMeeting({{0, 0}, {1, 1}}, [](std::int32_t) { return false; })) << "it has nothing";
  }
}

// Seams are the edges whose two faces have different UV there.
TEST(Quality, SeamLengthIsThatOfTheEdgesThatTheUvParts) {
  for (const Mesh& mesh : {testing::Torus(16, 10), testing::Tetrahedron(), testing::Plane(4, 3)}) {
    const auto result = Unwrap(mesh, {}, {});
    ASSERT_TRUE(result.ok()) << result.status();
    double length = 0, area = 0;
    std::map<std::pair<std::int32_t, std::int32_t>, std::array<double, 4>> uv_of_edge;
    for (std::int32_t f = 0; f < mesh.num_faces(); ++f) {
      const auto& [a, b, c] = mesh.faces[f];
      area += (mesh.positions[b] - mesh.positions[a]).cross(mesh.positions[c] - mesh.positions[a]).norm() / 2;
      for (int k = 0; k < 3; ++k) {
        int from = k, to = (k + 1) % 3;
        if (mesh.faces[f][from] > mesh.faces[f][to]) std::swap(from, to);
        const double* uv = &result->uv[6 * static_cast<std::size_t>(f)];
        const std::array<double, 4> own = {uv[2 * from], uv[2 * from + 1], uv[2 * to], uv[2 * to + 1]};
        const std::int32_t v = mesh.faces[f][from], w = mesh.faces[f][to];
        const auto [other, is_first] = uv_of_edge.emplace(std::pair(v, w), own);
        if (!is_first && other->second != own) length += (mesh.positions[v] - mesh.positions[w]).norm();
      }
    }
    EXPECT_NEAR(result->quality.seam_length, length / std::sqrt(area), 1e-9);
    EXPECT_EQ(length > 0, mesh.num_faces() != testing::Plane(4, 3).num_faces());
  }
}

// An interrupt at the announcement of a stage ends the call before the next one is announced.
TEST(Interrupt, EndsTheStageThatIsUnderWay) {
  const Mesh mesh = testing::Hills(90, 90);
  for (const UnwrapStage last :
       {UnwrapStage::kCharts, UnwrapStage::kSolve, UnwrapStage::kLayout, UnwrapStage::kPack, UnwrapStage::kVerify}) {
    Interrupter interrupter;
    UnwrapStage seen = UnwrapStage::kCharts;
    UnwrapControl control;
    control.cancel = &interrupter;
    control.on_progress = [&](const UnwrapProgress& progress) {
      seen = progress.stage;
      if (seen == last) interrupter.Interrupt();
    };
    UnwrapOptions options;
    options.threads = 2;
    EXPECT_EQ(Unwrap(mesh, testing::AsDisc(options), control).status().code(), absl::StatusCode::kCancelled);
    EXPECT_EQ(seen, last);
  }
}

TEST(Threads, ChangeNoBit) {
  for (const Mesh& mesh : {testing::Hills(70, 50), testing::PuncturedSphere(40, 0.6)}) {
    UnwrapOptions options;
    options.precision = Precision::kDouble;
    const auto alone = Unwrap(mesh, testing::AsDisc(options), {});
    ASSERT_TRUE(alone.ok()) << alone.status();
    for (const int threads : {2, 3}) {
      options.threads = threads;
      const auto together = Unwrap(mesh, testing::AsDisc(options), {});
      ASSERT_TRUE(together.ok()) << together.status();
      EXPECT_EQ(together->uv, alone->uv) << threads;
      EXPECT_EQ(together->quality.abf_energy, alone->quality.abf_energy);
      EXPECT_EQ(together->quality.conformal_distortion_mean, alone->quality.conformal_distortion_mean);
      EXPECT_EQ(together->quality.stretch_l2, alone->quality.stretch_l2);
    }
  }
}

TEST(Threads, OutOfRangeAreRefused) {
  for (const int threads : {0, -1, kMaxThreads + 1}) {
    UnwrapOptions options;
    options.threads = threads;
    const ErrorInfo info = ErrorInfoOf(Unwrap(testing::Plane(2, 2), testing::AsDisc(options), {}).status());
    EXPECT_EQ(info.reason, "OPTIONS_INVALID");
    EXPECT_EQ(info.metadata.at("field"), "threads");
  }
}

// A map folded onto itself many times over: more overlaps than are counted.
TEST(Verify, CountingEndsAtTheSamePlaceForAnyTeam) {
  const Mesh mesh = testing::Plane(60, 60);
  const Topology topology = DiscTopology(mesh).value();
  CornerUv uv;
  for (std::int32_t f = 0; f < topology.num_faces(); ++f) {
    for (const Vec2& p : {Vec2(0, 0), Vec2(1, 0), Vec2(f / 1e6, 1)}) uv.insert(uv.end(), {p.x(), p.y()});
  }
  const Overlaps alone = CheckOverlaps(topology.opposite, uv, CheckOrientations(uv));
  EXPECT_EQ(alone.pairs, kMaxOverlaps);
  EXPECT_TRUE(alone.limited);
  EXPECT_EQ(alone.faces.size(), 16u);
  ThreadTeam team(3);
  for (int i = 0; i < 5; ++i) {
    const Overlaps together = CheckOverlaps(topology.opposite, uv, CheckOrientations(uv), {&team, nullptr});
    EXPECT_EQ(together.pairs, kMaxOverlaps);
    EXPECT_EQ(together.faces, alone.faces);
  }
}

TEST(PlaceInUnitSquare, FindsTheLeastRectangleRoundAnyPoints) {
  std::mt19937 random(11);
  std::normal_distribution<double> normal;
  for (const int n : {1, 2, 3, 5, 40, 20000}) {
    std::vector<Vec2> points;
    for (int i = 0; i < n; ++i) {
      const Vec2 p(3 * normal(random), normal(random));
      points.push_back(Vec2(0.8 * p.x() - 0.6 * p.y(), 0.6 * p.x() + 0.8 * p.y()));
    }
    // Against all directions of a fine fan.
    double best = std::numeric_limits<double>::infinity();
    for (int i = 0; i < 2000; ++i) {
      const Vec2 u(std::cos(i * M_PI / 4000), std::sin(i * M_PI / 4000)), v(-u.y(), u.x());
      Vec2 low = Vec2::Constant(std::numeric_limits<double>::infinity()), high = -low;
      for (const Vec2& p : points) {
        low = low.cwiseMin(Vec2(p.dot(u), p.dot(v)));
        high = high.cwiseMax(Vec2(p.dot(u), p.dot(v)));
      }
      best = std::min(best, (high - low).prod());
    }
    const std::vector<Vec2> before = points;
    PlaceInUnitSquare(points, &points);
    if (n == 1) continue;
    double height = 0;
    for (const Vec2& p : points) height = std::max(height, p.y());
    const double scale = (points[1] - points[0]).norm() / (before[1] - before[0]).norm();
    EXPECT_LE(height, best * scale * scale + 1e-12) << n;
  }
}

TEST(Unwrap, DeliversAVerifiedMap) {
  const Mesh mesh = testing::ReadTriangleObj(std::string(PLANISH_TEST_DATA) + "/spot_seam.obj");
  std::vector<UnwrapStage> stages;
  UnwrapControl control;
  control.on_progress = [&](const UnwrapProgress& progress) {
    if (stages.empty() || stages.back() != progress.stage) stages.push_back(progress.stage);
  };
  const auto result = Unwrap(mesh, testing::AsDisc(), control);
  ASSERT_TRUE(result.ok()) << result.status();
  EXPECT_TRUE(result->charts.at(0).flatten->converged);
  EXPECT_LE(result->charts[0].flatten->residual.Max(), 1e-9);
  EXPECT_EQ(result->quality.flipped, 0);
  EXPECT_EQ(result->quality.degenerate, 0);
  EXPECT_NEAR(result->quality.abf_energy, 0.000775257, 1e-8);
  EXPECT_NEAR(result->quality.conformal_distortion_mean, 1.03296, 1e-5);
  EXPECT_EQ(result->precision, Precision::kFloat);
  ASSERT_EQ(result->uv.size(), 6 * mesh.faces.size());
  for (const double x : result->uv) {
    ASSERT_EQ(x, static_cast<double>(static_cast<float>(x)));
    ASSERT_GE(x, 0);
    ASSERT_LE(x, 1);
  }
  // In glTF v counts downwards.
  for (std::size_t i = 1; i < result->uv.size(); i += 2) {
    const double v = result->uv[i];
    ASSERT_EQ(1 - v, static_cast<double>(static_cast<float>(1 - v)));
  }
  EXPECT_THAT(stages, ::testing::ElementsAre(UnwrapStage::kCharts, UnwrapStage::kSolve, UnwrapStage::kLayout,
                                             UnwrapStage::kPack, UnwrapStage::kVerify));
}

TEST(Unwrap, DeliversDoubleOnlyWhereFloatLosesTheMap) {
  const Mesh mesh = testing::PuncturedSphere(60, 0.05);
  UnwrapOptions options;
  const auto automatic = Unwrap(mesh, testing::AsDisc(options), {});
  ASSERT_TRUE(automatic.ok()) << automatic.status();
  EXPECT_EQ(automatic->precision, Precision::kFloat);

  // The same map with a speck of it shrunk below what float resolves near 1.
  Mesh speck = testing::Plane(4, 4);
  const Vec3 centre = speck.positions[12];
  const auto at_centre = std::find_if(speck.faces.begin(), speck.faces.end(),
                                      [](const Face& f) { return std::find(f.begin(), f.end(), 12) != f.end(); });
  const Face split = *at_centre;
  const auto n = static_cast<std::int32_t>(speck.positions.size());
  const Vec3 a = speck.positions[split[0]], b = speck.positions[split[1]], c = speck.positions[split[2]];
  const Vec3 p = centre + 1e-9 * ((a + b + c) / 3 - centre) / ((a + b + c) / 3 - centre).norm();
  speck.positions.push_back(p);
  *at_centre = {split[0], split[1], n};
  speck.faces.push_back({split[1], split[2], n});
  speck.faces.push_back({split[2], split[0], n});
  const auto fine = Unwrap(speck, testing::AsDisc(options), {});
  ASSERT_TRUE(fine.ok()) << fine.status();
  EXPECT_EQ(fine->precision, Precision::kDouble);
  EXPECT_EQ(fine->quality.flipped + fine->quality.degenerate, 0);
  ASSERT_FALSE(fine->warnings.empty());
  EXPECT_EQ(fine->warnings[0].reason, "UV_PRECISION");

  options.precision = Precision::kFloat;
  const auto coarse = Unwrap(speck, testing::AsDisc(options), {});
  ASSERT_TRUE(coarse.ok());
  EXPECT_EQ(coarse->precision, Precision::kFloat);
  EXPECT_EQ(coarse->quality.flipped + coarse->quality.degenerate, 0);
  EXPECT_FALSE(coarse->widened.empty()) << "the speck";
}

TEST(Unwrap, SaysWhatFloatCosts) {
  const Mesh mesh = testing::PuncturedSphere(60, 0.05);
  UnwrapOptions options;
  const auto in_float = Unwrap(mesh, testing::AsDisc(options), {});
  options.precision = Precision::kDouble;
  const auto in_double = Unwrap(mesh, testing::AsDisc(options), {});
  ASSERT_TRUE(in_float.ok() && in_double.ok());
  ASSERT_EQ(in_float->precision, Precision::kFloat);
  const auto warned = [](const UnwrapResult& result) {
    return std::any_of(result.warnings.begin(), result.warnings.end(),
                       [](const UnwrapWarning& warning) { return warning.reason == "UV_PRECISION"; });
  };
  EXPECT_FALSE(warned(*in_double));
  EXPECT_EQ(warned(*in_float), in_float->quality.abf_energy > 1.001 * in_double->quality.abf_energy + 1e-4)
      << in_float->quality.abf_energy << " " << in_double->quality.abf_energy;
}

TEST(Unwrap, CanBeInterruptedInEveryStage) {
  const Mesh mesh = testing::Hills(20, 20);
  for (const UnwrapStage stage :
       {UnwrapStage::kCharts, UnwrapStage::kSolve, UnwrapStage::kLayout, UnwrapStage::kPack, UnwrapStage::kVerify}) {
    Interrupter interrupter;
    UnwrapControl control;
    control.cancel = &interrupter;
    control.on_progress = [&](const UnwrapProgress& progress) {
      if (progress.stage == stage) interrupter.Interrupt();
    };
    EXPECT_EQ(Unwrap(mesh, testing::AsDisc(), control).status().code(), absl::StatusCode::kCancelled)
        << static_cast<int>(stage);
  }
}

const UnwrapWarning* Find(const UnwrapResult& result, const std::string& reason) {
  for (const UnwrapWarning& warning : result.warnings) {
    if (warning.reason == reason) return &warning;
  }
  return nullptr;
}

// Counted anew from the bytes as delivered.
void ExpectNoFlips(const UnwrapResult& result) {
  const OrientationFaults faults = CheckOrientations(result.uv);
  EXPECT_EQ(faults.flipped, 0);
  EXPECT_EQ(faults.degenerate, 0);
}

TEST(Unwrap, KeepsTheBestMapWhenStoppedInAnyStage) {
  const Mesh mesh = testing::Hills(60, 60, 0.7);
  for (const int threads : {1, 2}) {
    for (const UnwrapStage stage :
         {UnwrapStage::kCharts, UnwrapStage::kSolve, UnwrapStage::kLayout, UnwrapStage::kPack, UnwrapStage::kVerify}) {
      SCOPED_TRACE(static_cast<int>(stage));
      Interrupter stop;
      UnwrapControl control;
      control.stop = &stop;
      control.on_progress = [&](const UnwrapProgress& progress) {
        if (progress.stage == stage) stop.Interrupt();
      };
      UnwrapOptions options;
      options.threads = threads;
      const auto result = Unwrap(mesh, testing::AsDisc(options), control);
      ASSERT_TRUE(result.ok()) << result.status();
      ExpectNoFlips(*result);
      EXPECT_EQ(CheckOverlaps(DiscTopology(mesh)->opposite, result->uv, {}).pairs, 0);
      const bool in_solve = stage <= UnwrapStage::kSolve;
      EXPECT_EQ(result->charts[0].flatten->stopped, in_solve);
      EXPECT_EQ(result->charts[0].flatten->converged, !in_solve);
      EXPECT_EQ(Find(*result, "NOT_CONVERGED") != nullptr, in_solve);
      const UnwrapWarning* warning = Find(*result, "STOPPED");
      ASSERT_EQ(warning != nullptr, stage != UnwrapStage::kVerify) << "the verifier judges what there is already";
      if (warning != nullptr) {
        EXPECT_EQ(warning->metadata.at("charts_cut_short"), in_solve ? "1" : "0");
      }
    }
  }
}

TEST(Unwrap, KeepsTheBestMapWhenStoppedInAnyLinearSolve) {
  const Mesh mesh = testing::Hills(40, 40, 2);
  const auto whole = Unwrap(mesh, testing::AsDisc(), {});
  ASSERT_TRUE(whole.ok());
  UnwrapOptions options;
  options.flatten.preconditioner = PreconditionerType::kJacobi;  // long solves: stops fall inside
  for (int point = 0; point < 40; point += 3) {
    Interrupter stop;
    UnwrapControl control;
    control.stop = &stop;
    int seen = 0;
    control.on_progress = [&](const UnwrapProgress&) {
      if (seen++ == point) stop.Interrupt();
    };
    const auto result = Unwrap(mesh, testing::AsDisc(options), control);
    ASSERT_TRUE(result.ok()) << point << ": " << result.status();
    ExpectNoFlips(*result);
    EXPECT_LT(result->quality.abf_energy, 1.1 * whole->quality.abf_energy + 1e-6) << point;
  }
}

TEST(Unwrap, KeepsTheBestMapWhenStoppedOnTheWayToAConvexOutline) {
  const Mesh mesh = testing::Hills(24, 24, 2);
  UnwrapOptions options;
  options.flatten.boundary = BoundaryType::kConvex;
  int points = 0;
  UnwrapControl count;
  count.on_progress = [&](const UnwrapProgress&) { ++points; };
  ASSERT_TRUE(Unwrap(mesh, testing::AsDisc(options), count).ok());
  int cut_short = 0;
  for (int point = 0; point < points; point += std::max(1, points / 15)) {
    Interrupter stop;
    UnwrapControl control;
    control.stop = &stop;
    int seen = 0, after = 0;
    control.on_progress = [&](const UnwrapProgress& progress) {
      if (seen++ == point) stop.Interrupt();
      after += stop.IsInterrupted() && progress.stage == UnwrapStage::kSolve;
    };
    const auto result = Unwrap(mesh, testing::AsDisc(options), control);
    ASSERT_TRUE(result.ok()) << point << ": " << result.status();
    ExpectNoFlips(*result);
    EXPECT_LT(after, 12) << "the stop was not heeded";
    const FlattenSummary& flatten = *result->charts[0].flatten;
    EXPECT_NE(flatten.stopped, flatten.converged);
    cut_short += flatten.stopped;
  }
  EXPECT_GT(cut_short, 5);
}

TEST(Unwrap, StoppedBeforeAnythingStillMakesAMap) {
  Interrupter stop;
  stop.Interrupt();
  UnwrapControl control;
  control.stop = &stop;
  for (const BoundaryType boundary : {BoundaryType::kFree, BoundaryType::kConvex}) {
    UnwrapOptions options;
    options.flatten.boundary = boundary;
    const auto result = Unwrap(testing::PuncturedSphere(20, 0.05), testing::AsDisc(options), control);
    ASSERT_TRUE(result.ok()) << result.status();
    ExpectNoFlips(*result);
    EXPECT_NE(Find(*result, "STOPPED"), nullptr);
    EXPECT_TRUE(result->charts[0].flatten->stopped);
    EXPECT_EQ(result->charts[0].flatten->stop_message.substr(0, 7), "stopped");
  }
}

TEST(Unwrap, SaysThatAStopCameTooEarly) {
  Interrupter stop;
  stop.Interrupt();
  UnwrapControl control;
  control.stop = &stop;
  UnwrapOptions options;
  options.flatten.system = SystemType::kFull;
  options.flatten.preconditioner = PreconditionerType::kNone;  // gets nowhere in the time that is left
  const absl::Status status = Unwrap(testing::PuncturedSphere(80, 0.02), testing::AsDisc(options), control).status();
  EXPECT_EQ(status.code(), absl::StatusCode::kAborted) << status;
  EXPECT_EQ(ErrorInfoOf(status).reason, "STOPPED_EARLY");
}

TEST(Unwrap, CancelWinsOverStop) {
  Interrupter stop, cancel;
  UnwrapControl control;
  control.stop = &stop;
  control.cancel = &cancel;
  control.on_progress = [&](const UnwrapProgress& progress) {
    if (progress.stage >= UnwrapStage::kSolve) stop.Interrupt();
    if (progress.stage >= UnwrapStage::kPack) cancel.Interrupt();
  };
  EXPECT_EQ(Unwrap(testing::Hills(20, 20), testing::AsDisc(), control).status().code(), absl::StatusCode::kCancelled);
}

TEST(Unwrap, AStopThatIsNeverSetChangesNothing) {
  Interrupter stop;
  UnwrapControl control;
  control.stop = &stop;
  for (const SeamPolicy policy : {SeamPolicy::kNone, SeamPolicy::kAuto}) {
    UnwrapOptions options;
    options.seams.policy = policy;
    const Mesh mesh = testing::Hills(60, 60, 3);
    const auto with = Unwrap(mesh, options, control), without = Unwrap(mesh, options, {});
    ASSERT_TRUE(with.ok() && without.ok());
    EXPECT_EQ(with->uv, without->uv);
    EXPECT_EQ(Find(*with, "STOPPED"), nullptr);
  }
}

TEST(Unwrap, WarnsOfIsolatedVertices) {
  Mesh mesh = testing::Plane(3, 3);
  mesh.positions.push_back({9, 9, 9});
  const auto result = Unwrap(mesh, testing::AsDisc(), {});
  ASSERT_TRUE(result.ok()) << result.status();
  ASSERT_EQ(result->warnings.size(), 1u);
  EXPECT_EQ(result->warnings[0].reason, "ISOLATED_VERTICES");
}

}  // namespace
}  // namespace planish
