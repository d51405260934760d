#include "tests/bench/bench_meshes.h"

#include <algorithm>
#include <cmath>

#include "core/abf/topology.h"
#include "core/mesh/angles.h"
#include "core/mesh/diagnosis.h"
#include "gtest/gtest.h"
#include "tests/testing/discs.h"

namespace planish::bench {
namespace {

TEST(BenchMeshes, AreDiscsOfJustAsManyTriangles) {
  for (const std::string& name : MeshNames()) {
    for (const std::int64_t triangles : {100, 1796, 5001, 5002, 5003, 5020}) {
      const Mesh mesh = MakeMesh(name, triangles);
      EXPECT_EQ(mesh.num_faces(), triangles) << name;
      EXPECT_TRUE(CheckDisc(mesh).ok()) << name << " " << triangles << ": " << CheckDisc(mesh);
      EXPECT_EQ(CountIsolatedVertices(mesh), 0) << name;
      EXPECT_EQ(mesh.positions, MakeMesh(name, triangles).positions) << name;
    }
    EXPECT_GT(MeasuredAngles(MakeMesh(name, 5000)).minCoeff(), 0.05) << name;
  }
}

TEST(BenchMeshes, LoopSubdivisionKeepsDiscsAndPlanes) {
  Mesh mesh = MakeMesh("waves", 500);
  for (Vec3& p : mesh.positions) p.z() = 3;
  const Mesh fine = SubdivideLoop(SubdivideLoop(mesh));
  EXPECT_EQ(fine.num_faces(), 16 * mesh.num_faces());
  const auto coarse_disc = DiscTopology(mesh), fine_disc = DiscTopology(fine);
  ASSERT_TRUE(coarse_disc.ok() && fine_disc.ok());
  for (const Vec3& p : fine.positions) EXPECT_NEAR(p.z(), 3, 1e-14);
}

// An interior vertex of valence six: 5/8 of itself and 1/16 of each neighbour; an inner edge: 3/8 and 1/8.
TEST(BenchMeshes, LoopSubdivisionHasHisWeights) {
  Mesh mesh;
  mesh.positions.push_back({0, 0, 1});
  for (int i = 0; i < 6; ++i) {
    mesh.positions.push_back({std::cos(i * 1.0471975511965976), std::sin(i * 1.0471975511965976), 0});
    mesh.faces.push_back({0, 1 + i, 1 + (i + 1) % 6});
  }
  const Mesh fine = SubdivideLoop(mesh);
  EXPECT_NEAR(fine.positions[0].z(), 0.625, 1e-14);
  EXPECT_EQ(std::count_if(fine.positions.begin(), fine.positions.end(),
                          [](const Vec3& p) { return std::abs(p.z() - 0.375) < 1e-14; }),
            6);
}

TEST(BenchMeshes, AreNamedOnTheCommandLine) {
  EXPECT_EQ(LoadMesh("ear:300")->num_faces(), 300);
  EXPECT_EQ(LabelOf("ear:300"), "ear");
  EXPECT_EQ(LabelOf("/a/b.c/spot.obj"), "spot");
  EXPECT_EQ(LabelOf("/a/b.c/spot.obj@2"), "spot_L2");
  EXPECT_EQ(LabelOf("assembly:2000:3"), "assembly_2000_3");
  EXPECT_EQ(LoadMesh("assembly:2000:3")->faces, LoadMesh("assembly:2000:3")->faces);
  EXPECT_GT(LoadMesh("assembly:2000:3")->num_faces(), 500);
  EXPECT_FALSE(LoadMesh("nose:300:1").ok());
  EXPECT_FALSE(LoadMesh("nose:300").ok());
  EXPECT_FALSE(LoadMesh("/nowhere.obj@1").ok());
}

}  // namespace
}  // namespace planish::bench
