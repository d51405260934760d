#include "core/mesh/diagnosis.h"

#include <limits>
#include <random>

#include "core/base/error.h"
#include "core/base/interrupter.h"
#include "gmock/gmock.h"
#include "gtest/gtest.h"
#include "tests/core/shapes.h"

namespace planish {
namespace {

using ::testing::ElementsAre;
using ::testing::IsEmpty;
using ::testing::SizeIs;

constexpr double kNan = std::numeric_limits<double>::quiet_NaN();

Diagnosis Examined(const Mesh& mesh) {
  const auto diagnosis = Diagnose(mesh);
  EXPECT_TRUE(diagnosis.ok()) << diagnosis.status();
  return diagnosis.ok() ? *diagnosis : Diagnosis();
}

// "reason: metadata[key]".
std::string Refused(const Mesh& mesh, const std::string& key) {
  const ErrorInfo info = ErrorInfoOf(Examined(mesh).Refusal());
  const auto it = info.metadata.find(key);
  return info.reason + ": " + (it == info.metadata.end() ? "(none)" : it->second);
}

Mesh Joined(Mesh a, const Mesh& b) {
  const auto shift = static_cast<std::int32_t>(a.num_vertices());
  a.positions.insert(a.positions.end(), b.positions.begin(), b.positions.end());
  for (const Face& f : b.faces) a.faces.push_back({f[0] + shift, f[1] + shift, f[2] + shift});
  return a;
}

TEST(Diagnosis, Shapes) {
  Diagnosis d = Examined(testing::Plane(4, 3));
  EXPECT_TRUE(d.is_disc());
  EXPECT_EQ(d.faces, 24);
  EXPECT_EQ(d.edges, 43);
  EXPECT_EQ(d.boundary_edges, 14);
  EXPECT_EQ(d.euler_characteristic(), 1);
  EXPECT_NEAR(d.area, (d.box_max - d.box_min).head<2>().prod(), 1e-12);

  d = Examined(testing::Tetrahedron());
  EXPECT_FALSE(d.is_disc());
  EXPECT_EQ(d.boundary_loops(), 0);
  EXPECT_EQ(d.euler_characteristic(), 2);
  EXPECT_EQ(d.handles(), 0);

  d = Examined(testing::Torus(8, 6));
  EXPECT_EQ(d.handles(), 1);
  EXPECT_EQ(d.euler_characteristic(), 0);

  d = Examined(testing::Cylinder(8, 3));
  EXPECT_EQ(d.boundary_loops(), 2);
  EXPECT_EQ(d.handles(), 0);

  d = Examined(testing::MoebiusStrip(12));
  EXPECT_FALSE(d.is_orientable());
  ASSERT_THAT(d.components, SizeIs(1));
  EXPECT_EQ(d.components[0].crosscaps, 1);
  EXPECT_EQ(d.components[0].boundary_loops, 1);
  EXPECT_GT(d.inconsistent_edges.count, 0);
}

TEST(Diagnosis, ComponentsEachByThemselves) {
  const Mesh torus = testing::Torus(8, 6);
  const Diagnosis d = Examined(Joined(Joined(testing::Plane(2, 2), torus), testing::MoebiusStrip(9)));
  ASSERT_THAT(d.components, SizeIs(3));
  EXPECT_TRUE(d.components[0].IsDisc());
  EXPECT_EQ(d.components[0].boundary_edges, 8);
  EXPECT_EQ(d.components[1].first_face, 8);
  EXPECT_EQ(d.components[1].faces, torus.num_faces());
  EXPECT_EQ(d.components[1].handles, 1);
  EXPECT_TRUE(d.components[1].orientable);
  EXPECT_EQ(d.components[2].crosscaps, 1);
  EXPECT_EQ(d.handles(), 1);
}

TEST(Diagnosis, FacesThatAreNoneAreSetAside) {
  Mesh mesh = testing::Plane(2, 1);  // 6 vertices, 4 faces
  mesh.positions.push_back(0.5 * (mesh.positions[0] + mesh.positions[1]));
  mesh.faces.push_back({0, 1, 0});  // 4
  mesh.faces.push_back({0, 6, 1});  // 5: on a line
  const Face copied = mesh.faces[2];
  mesh.faces.push_back({copied[1], copied[2], copied[0]});  // 6
  mesh.faces.push_back({copied[1], copied[0], copied[2]});  // 7: turned over
  mesh.faces.push_back({6, 0, 1});                          // 8: on a line again
  const Diagnosis d = Examined(mesh);
  EXPECT_THAT(d.faces_repeating_a_vertex.first, ElementsAre(4));
  EXPECT_THAT(d.faces_without_area.first, ElementsAre(5, 8));
  EXPECT_THAT(d.duplicate_faces.first, ElementsAre(6, 7, 8));
  EXPECT_THAT(d.isolated_vertices.first, IsEmpty()) << "a face without area is a face";
  EXPECT_EQ(d.surface_faces, 4);
  EXPECT_EQ(d.non_manifold_edges.count, 0);
  ASSERT_THAT(d.components, SizeIs(1));
  EXPECT_TRUE(d.components[0].IsDisc());
  EXPECT_FALSE(d.is_disc()) << "there are faces that a disc has not";
  EXPECT_TRUE(d.Refusal().ok());
}

TEST(Diagnosis, ElementsThatDoNotFitTogether) {
  Mesh mesh;
  mesh.positions = {{0, 0, 0}, {0, 0, 1}, {1, 0, 0}, {0, 1, 0}, {-1, 0, 0}, {5, 5, 5}, {0, 0, 0}, {-0.0, 0, 1}};
  mesh.faces = {{0, 1, 2}, {1, 0, 3}, {0, 1, 4}};
  Diagnosis d = Examined(mesh);
  ASSERT_EQ(d.non_manifold_edges.count, 1);
  EXPECT_THAT(d.non_manifold_edges.first[0], ElementsAre(0, 1));
  EXPECT_THAT(d.non_manifold_edges.faces, ElementsAre(0, 1, 2));
  EXPECT_THAT(d.non_manifold_vertices.first, ElementsAre(0, 1));
  EXPECT_THAT(d.isolated_vertices.first, ElementsAre(5, 6, 7));
  EXPECT_THAT(d.coincident_vertices.first, ElementsAre(6, 7));
  EXPECT_THAT(d.components, SizeIs(3)) << "nothing hangs together over an edge of three faces";
  EXPECT_EQ(d.boundary_edges, 6);
  EXPECT_EQ(d.components[0].boundary_edges, 3) << "the cut has its sides";

  mesh.faces = {{0, 1, 2}, {0, 1, 3}};
  d = Examined(mesh);
  ASSERT_EQ(d.inconsistent_edges.count, 1);
  EXPECT_THAT(d.inconsistent_edges.first[0], ElementsAre(0, 1));
  EXPECT_THAT(d.inconsistent_edges.faces, ElementsAre(0, 1));
  EXPECT_TRUE(d.is_orientable()) << "one of them turned over would do";
  EXPECT_THAT(d.components, SizeIs(1));
  EXPECT_EQ(d.oriented_pieces, 2);
  EXPECT_THAT(d.non_manifold_vertices.first, IsEmpty());

  mesh.faces = {{0, 1, 2}, {0, 3, 4}};
  d = Examined(mesh);
  EXPECT_THAT(d.non_manifold_vertices.first, ElementsAre(0));
}

TEST(Diagnosis, RefusesWhatHasNoMap) {
  Mesh mesh;
  EXPECT_EQ(Refused(mesh, "count"), "MESH_EMPTY: 0");
  mesh.positions = {{0, 0, 0}, {1, 0, 0}, {0, 1, 0}, {kNan, 0, 0}, {2, 0, 0}};
  mesh.faces = {{0, 1, 2}};
  EXPECT_TRUE(Examined(mesh).Refusal().ok()) << "nobody uses the NaN";
  mesh.faces = {{0, 1, 2}, {0, 1, 3}};
  EXPECT_EQ(Refused(mesh, "vertices"), "MESH_POSITION_NOT_FINITE: 3");
  EXPECT_THAT(Examined(mesh).faces_not_finite.first, ElementsAre(1));
  mesh.faces = {{0, 1, 2}, {0, 1, 5}, {0, -1, 2}};
  EXPECT_EQ(Refused(mesh, "faces"), "MESH_INDEX_OUT_OF_RANGE: 1,2");
  mesh.faces = {{0, 1, 4}, {1, 1, 2}};
  EXPECT_EQ(Refused(mesh, "count"), "MESH_FACE_DEGENERATE: 2");
  EXPECT_EQ(Examined(mesh).area, 0);
}

TEST(Diagnosis, NamesTheFirstSixteen) {
  Mesh mesh = testing::Plane(10, 10);
  for (int i = 0; i < 50; ++i) mesh.faces.push_back({i, i, i + 1});
  const Diagnosis d = Examined(mesh);
  EXPECT_EQ(d.faces_repeating_a_vertex.count, 50);
  EXPECT_THAT(d.faces_repeating_a_vertex.first, SizeIs(16));
  EXPECT_EQ(d.faces_repeating_a_vertex.first[15], 215);
}

TEST(Diagnosis, NeedlesAndAngles) {
  Mesh mesh;
  mesh.positions = {{0, 0, 0}, {100, 0, 0}, {100, 1, 0}, {0, 100, 0}};
  mesh.faces = {{0, 1, 2}, {0, 2, 3}};
  const Diagnosis d = Examined(mesh);
  EXPECT_THAT(d.needles.first, ElementsAre(0));
  EXPECT_NEAR(d.angle_min_degrees, 0.5729, 1e-4);
  EXPECT_NEAR(d.angle_max_degrees, 90, 1e-12);
}

// Any soup has a diagnosis that adds up, and where it says disc, CheckDisc agrees.
TEST(Diagnosis, AddsUpForAnySoup) {
  std::mt19937 random(7);
  int discs = 0, refused = 0;
  for (int round = 0; round < 4000; ++round) {
    Mesh mesh;
    const int vertices = 3 + static_cast<int>(random() % 6);
    for (int v = 0; v < vertices; ++v) {
      const auto coordinate = [&] { return static_cast<double>(random() % 4); };
      mesh.positions.emplace_back(coordinate(), coordinate(), round % 2 == 0 ? 0.0 : coordinate());
    }
    if (random() % 20 == 0) mesh.positions[0].x() = kNan;
    const auto id = [&] { return static_cast<std::int32_t>(random() % (vertices + (round % 10 == 0 ? 1 : 0))); };
    for (unsigned f = 0; f < 1 + random() % 8; ++f) mesh.faces.push_back({id(), id(), id()});
    const Diagnosis d = Examined(mesh);
    std::int64_t faces = 0;
    for (const Component& c : d.components) {
      faces += c.faces;
      EXPECT_EQ(c.euler_characteristic, 2 - 2 * c.handles - c.crosscaps - c.boundary_loops);
      EXPECT_GE(c.handles, 0);
      EXPECT_GE(c.crosscaps, c.orientable ? 0 : 1);
      EXPECT_GE(c.boundary_edges, 2 * c.boundary_loops);
    }
    EXPECT_EQ(faces, d.surface_faces);
    EXPECT_GE(d.oriented_pieces, static_cast<std::int64_t>(d.components.size()));
    EXPECT_EQ(CheckDisc(mesh).ok(), d.is_disc());
    discs += d.is_disc() ? 1 : 0;
    refused += d.Refusal().ok() ? 0 : 1;
  }
  EXPECT_GT(discs, 20);
  EXPECT_GT(refused, 100);
}

TEST(Diagnosis, ThreadsChangeNothingAndAnInterruptEndsIt) {
  Mesh mesh = testing::Hills(120, 90);
  for (std::int32_t i = 0; i < 9000; i += 7) mesh.faces.push_back({i, i + 1, i + 500});
  ThreadTeam team(3);
  const Diagnosis alone = Examined(mesh);
  const auto together = Diagnose(mesh, {&team, nullptr});
  ASSERT_TRUE(together.ok());
  EXPECT_EQ(alone.area, together->area);
  EXPECT_EQ(alone.angle_min_degrees, together->angle_min_degrees);
  EXPECT_EQ(alone.duplicate_faces.first, together->duplicate_faces.first);
  EXPECT_EQ(alone.non_manifold_edges.first, together->non_manifold_edges.first);
  EXPECT_EQ(alone.components.size(), together->components.size());
  Interrupter interrupter;
  interrupter.Interrupt();
  EXPECT_EQ(Diagnose(mesh, {nullptr, &interrupter}).status().code(), absl::StatusCode::kCancelled);
}

}  // namespace
}  // namespace planish
