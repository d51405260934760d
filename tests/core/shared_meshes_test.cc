// Every real mesh of the shared collection that is an OBJ of triangles; skipped where the collection is not there.
#include <cmath>
#include <filesystem>
#include <map>

#include "core/abf/topology.h"
#include "core/base/error.h"
#include "core/mesh/angles.h"
#include "core/unwrap/unwrap.h"
#include "gtest/gtest.h"
#include "tests/core/disc_options.h"
#include "tests/core/shapes.h"
#include "tests/core/uv_digest.h"
#include "tests/testing/discs.h"
#include "tests/testing/files.h"

namespace planish {
namespace {

const std::filesystem::path kMeshes = PLANISH_SHARED_MESHES;

class SharedMeshes : public ::testing::Test {
 protected:
  void SetUp() override {
    if (!std::filesystem::exists(kMeshes / "MANIFEST.tsv")) GTEST_SKIP() << "no shared meshes on this machine";
  }
};

TEST_F(SharedMeshes, EveryDiscComesBackFlat) {
  std::map<std::string, double> reference;
  for (const auto& row : ReadTable(kMeshes / "REFERENCE.tsv")) {
    reference[row.at("file")] = std::stod(row.at("abf_energy_per_angle"));
  }
  ASSERT_GT(reference.size(), 10u);
  for (const auto& [file, energy] : reference) {
    const Mesh mesh = testing::ReadTriangleObj(kMeshes / file);
    UnwrapOptions options;
    const auto result = Unwrap(mesh, testing::AsDisc(options), {});
    ASSERT_TRUE(result.ok()) << file << " " << result.status();
    const FlattenSummary& summary = *result->charts.at(0).flatten;
    EXPECT_TRUE(summary.converged) << file << " " << summary.stop_message;
    EXPECT_LE(summary.residual.Max(), 1e-8) << file;
    EXPECT_LE(summary.newton_iterations, 15) << file;
    EXPECT_EQ(result->quality.flipped, 0) << file;
    EXPECT_EQ(result->quality.degenerate, 0) << file;
    const bool needs_double = file == "hand_lowres_1602.obj" || file == "hand_cut_15749.obj";
    EXPECT_EQ(result->precision == Precision::kDouble, needs_double) << file;
    if (file == "goathead_cut_5279.obj") {
      ASSERT_FALSE(result->warnings.empty());
      EXPECT_EQ(result->warnings[0].reason, "UV_PRECISION") << "float keeps every triangle but not the energy";
    }
    // The energy of the angles, before any rounding. The reference for koala_seam lies 0.4 % above what is found here,
    // so only more than the reference is a failure.
    const double found = summary.energy / (3.0 * static_cast<double>(mesh.num_faces()));
    EXPECT_LT(found, energy * (1 + 1e-4) + 1e-12) << file;
    if (file != "koala_seam_99994.obj") {
      EXPECT_GT(found, energy * (1 - 1e-4) - 1e-12) << file;
    }
  }
}

// Of 19,704 faces 4,637 are needles far longer than the texture would be; what was left of them kept strips whole that
// were as long as the texture, and so all else small: 0.30 of it was used.
TEST_F(SharedMeshes, LongNeedlesLeaveRoom) {
  UnwrapOptions options;
  options.seams.prefer = SeamPreference::kTexture;
  const auto result = Unwrap(testing::ReadTriangleObj(kMeshes / "twin_needles_19704.obj"), options, {});
  ASSERT_TRUE(result.ok()) << result.status();
  EXPECT_GT(result->quality.packing_efficiency, 0.4);
  EXPECT_EQ(result->quality.flipped + result->quality.degenerate + result->quality.overlapping, 0);
}

TEST_F(SharedMeshes, LongNeedlesAreMappedForFloat) {
  UnwrapOptions options;
  options.precision = Precision::kFloat;
  const auto result = Unwrap(testing::ReadTriangleObj(kMeshes / "twin_needles_19704.obj"), options, {});
  ASSERT_TRUE(result.ok()) << result.status();
  EXPECT_EQ(result->quality.flipped + result->quality.degenerate + result->quality.overlapping, 0);
}

TEST_F(SharedMeshes, TheSameUvOnEveryCpu) {
  testing::ExpectTheSameOnEveryCpu([] {
    return testing::UvDigest(testing::ReadTriangleObj(kMeshes / "boot_g12_39906.obj"), {}) + " " +
           testing::UvDigest(testing::ReadTriangleObj(kMeshes / "hand_cut_15749.obj"), {});
  });
}

TEST_F(SharedMeshes, EveryDiscCanHaveAConvexOutline) {
  for (const auto& row : ReadTable(kMeshes / "MANIFEST.tsv")) {
    const std::string& file = row.at("file");
    if (row.at("group") != "a") continue;
    // On koala_seam Newton's method does not converge with most of the seam held straight; boot_seam converges, but its
    // scale varies beyond double.
    if (file == "koala_seam_99994.obj" || file == "boot_seam_39906.obj") continue;
    UnwrapOptions options;
    options.flatten.boundary = BoundaryType::kConvex;
    const auto result = Unwrap(testing::ReadTriangleObj(kMeshes / file), testing::AsDisc(options), {});
    ASSERT_TRUE(result.ok()) << file << " " << result.status();
    const FlattenSummary& summary = *result->charts.at(0).flatten;
    EXPECT_TRUE(summary.converged && summary.boundary.settled) << file << " " << summary.stop_message;
    EXPECT_LE(summary.residual.Max(), 1e-8) << file;
    EXPECT_EQ(std::to_string(summary.boundary.vertices), row.at("bnd_edges")) << file;
    EXPECT_LE(summary.boundary.active, summary.boundary.vertices - 3) << file;
    EXPECT_LE(summary.boundary.set_changes, 20) << file;
    EXPECT_EQ(result->quality.flipped + result->quality.degenerate + result->quality.overlapping, 0) << file;
  }
}

TEST_F(SharedMeshes, TheSolversAsInThePaperAgreeWithTheDirectOne) {
  for (const std::string file :
       {"hand_lowres_1602.obj", "lego_3072.obj", "bff_hemisphere_4000.obj", "goathead_cut_5279.obj"}) {
    const Mesh mesh = testing::ReadTriangleObj(kMeshes / file);
    const Topology topology = DiscTopology(mesh).value();
    const TargetAngles target = MakeTargetAngles(topology, MeasuredAngles(mesh));
    FlattenOptions direct;
    direct.solver = SolverType::kDirect;
    const Eigen::VectorXd expected = FlattenAngles(topology, target, direct, {})->angles;
    for (const SolverType solver : {SolverType::kMinres, SolverType::kUzawa}) {
      FlattenOptions paper;
      paper.solver = solver;
      paper.system = SystemType::kFull;
      paper.preconditioner = PreconditionerType::kNone;
      const auto result = FlattenAngles(topology, target, paper, {});
      ASSERT_TRUE(result.ok()) << result.status();
      EXPECT_TRUE(result->summary.converged) << file << " " << result->summary.stop_message;
      EXPECT_LT((result->angles - expected).cwiseAbs().maxCoeff(), 1e-6) << file << " " << Name(solver);
    }
  }
}

TEST_F(SharedMeshes, TheSphereThroughAThreeEdgeHoleConverges) {
  const auto result = Unwrap(testing::ReadTriangleObj(kMeshes / "punctured_sphere_223.obj"), testing::AsDisc(), {});
  ASSERT_TRUE(result.ok()) << result.status();
  EXPECT_TRUE(result->charts.at(0).flatten->converged) << result->charts[0].flatten->stop_message;
  EXPECT_LE(result->charts[0].flatten->newton_iterations, 15);
  EXPECT_EQ(result->quality.flipped + result->quality.degenerate + result->quality.overlapping, 0);
  EXPECT_EQ(result->warnings.at(0).reason, "BARRIER_KEPT");
}

TEST_F(SharedMeshes, MoreStretchDoesNotMeanMoreCharts) {
  for (const char* const file : {"wuson_3732.obj", "spider_1368.obj", "featuretype_needles_3476.obj"}) {
    const Mesh mesh = testing::ReadTriangleObj(kMeshes / file);
    double before = static_cast<double>(mesh.num_faces());
    for (const double limit : {1.05, 1.1, 1.25, 1.5, 2.0}) {
      UnwrapOptions options;
      options.seams.max_stretch = limit;
      const auto result = Unwrap(mesh, options, {});
      ASSERT_TRUE(result.ok()) << result.status();
      const auto charts = static_cast<double>(result->charts.size());
      EXPECT_LE(charts, 1.05 * before) << file << " at " << limit;
      before = charts;
    }
  }
}

// 4,612 of its 19,704 faces are needles much longer than the texture, and too thin for float. Charts of them overlap
// when they are rounded to float, but only until the needles are widened: no reason to cut them into charts of a few.
TEST_F(SharedMeshes, NeedlesStayInChartsOfMany) {
  const auto result = Unwrap(testing::ReadTriangleObj(kMeshes / "twin_needles_19704.obj"), {}, {});
  ASSERT_TRUE(result.ok()) << result.status();
  EXPECT_LE(result->charts.size(), 200u);
  EXPECT_GT(result->quality.packing_efficiency, 0.28);
  EXPECT_EQ(result->quality.flipped + result->quality.degenerate + result->quality.overlapping, 0);
}

TEST_F(SharedMeshes, WhatIsNoDiscIsRefusedWithTheFault) {
  const std::map<std::string, std::string> expected = {
      {"sphere_1280.obj", "MESH_CLOSED"},
      {"spot_23062.obj", "MESH_CLOSED"},
      {"koala_99994.obj", "MESH_CLOSED"},
      {"boot_g12_39906.obj", "MESH_CLOSED"},
      {"hole_capsule_152.obj", "MESH_SEVERAL_LOOPS"},
      {"plane_holes_16747.obj", "MESH_SEVERAL_LOOPS"},
      {"punctured_torus_9184.obj", "MESH_HAS_HANDLES"},
      {"multiple_tetrahedrons_20.obj", "MESH_SEVERAL_COMPONENTS"},
      {"inf_nan.obj", "MESH_POSITION_NOT_FINITE"},
      {"degenerate_mesh.obj", "MESH_FACE_DEGENERATE"},
      {"zero_area_face.obj", "MESH_FACE_DEGENERATE"},
      {"zero_length_edge.obj", "MESH_FACE_DEGENERATE"},
      {"fan3.obj", "MESH_EDGE_NON_MANIFOLD"},
      {"hourglass_ico.obj", "MESH_VERTEX_NON_MANIFOLD"},
      {"inverted_triangles_24685.obj", "MESH_ORIENTATION_INCONSISTENT"},
      {"capsule_degenerate_10200.obj", "MESH_FACE_DEGENERATE"},
      {"soup_100.obj", "MESH_SEVERAL_COMPONENTS"},
  };
  for (const auto& [file, reason] : expected) {
    const auto result = Unwrap(testing::ReadTriangleObj(kMeshes / file), testing::AsDisc(), {});
    EXPECT_EQ(ErrorInfoOf(result.status()).reason, reason) << file << " " << result.status();
  }
}

}  // namespace
}  // namespace planish
