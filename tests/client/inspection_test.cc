// `planish inspect` without the command around it.
#include "client/cli/inspection.h"

#include <filesystem>
#include <map>
#include <sstream>

#include "client/cli/seams.h"
#include "gmock/gmock.h"
#include "gtest/gtest.h"
#include "tests/testing/files.h"

namespace planish::cli {
namespace {

namespace fs = std::filesystem;

using ::testing::ElementsAre;
using ::testing::HasSubstr;
using ::testing::IsEmpty;
using ::testing::Not;

class InspectionTest : public ::testing::Test {
 protected:
  MeshInput Input(const std::string& obj) {
    const std::string test = ::testing::UnitTest::GetInstance()->current_test_info()->name();
    const std::string path = directory_.Path(test + ".obj");
    PutFile(path, obj);
    return MeshInput(path);
  }

  static const Finding& Named(const Inspection& inspection, const std::string& name) {
    for (const Finding& finding : inspection.findings) {
      if (finding.name == name) return finding;
    }
    throw std::out_of_range(name);
  }

  const TempDir directory_;
};

constexpr char kDisc[] = "v 0 0 0\nv 1 0 0\nv 1 1 0\nv 0 1 0\nf 1 2 3 4\n";

TEST_F(InspectionTest, Disc) {
  const MeshInput input = Input(kDisc);
  const Inspection inspection = Inspect(input);
  EXPECT_FALSE(inspection.refusal);
  EXPECT_FALSE(inspection.not_a_disc);
  EXPECT_THAT(inspection.plan, ::testing::Contains(HasSubstr("one disc, one chart")));
  const std::string text = InspectionText(input, inspection);
  EXPECT_THAT(text, HasSubstr("Disc.obj: 4 vertices, 2 triangles in 1 polygon\n"));
  EXPECT_THAT(text, HasSubstr("Surface    1 component, a disc, 1 boundary loop with 4 edges, genus 0, Euler"));
  EXPECT_THAT(text, HasSubstr("Angles     45 to 90 degrees\n"));
  EXPECT_THAT(text, HasSubstr("Findings   none\n"));
  const Json json = InspectionJson(input, inspection);
  EXPECT_EQ(json["format"], "obj");
  EXPECT_EQ(json["surface"]["disc"], true);
  EXPECT_EQ(json["unwrap"]["accepted"], true);
  EXPECT_EQ(json["unwrap"]["seams_none"]["accepted"], true);
  EXPECT_FALSE(json["unwrap"].contains("error"));
}

// Elements are named as the file counts them: polygons, not triangles, and vertices with those that nobody uses.
TEST_F(InspectionTest, FindingsHavePlacesInTheFile) {
  const MeshInput input = Input(
      "v 9 9 9\nv 0 0 0\nv 1 0 0\nv 1 1 0\nv 0 1 0\nv 0.5 0 0\nv 0 0 0\n"  // vertices 0 to 6, lines 1 to 7
      "f 2 3 4 5\nf 2 6 3\nf 2 3 3\nf 4 3 2\nf 2 3 7\n");                  // polygons 0 to 4, lines 8 to 12
  const Inspection inspection = Inspect(input);
  EXPECT_EQ(inspection.diagnosis.vertices, 7);
  EXPECT_THAT(Named(inspection, "isolated_vertices").vertices, ElementsAre(0));
  EXPECT_THAT(Named(inspection, "coincident_vertices").vertices, ElementsAre(6));
  EXPECT_EQ(Named(inspection, "coincident_vertices").places, "vertex 6 (FindingsHavePlacesInTheFile.obj:7)");
  const Finding& flat = Named(inspection, "faces_without_area");
  EXPECT_EQ(flat.text, "2 triangles have no area");
  EXPECT_THAT(flat.faces, ElementsAre(1, 4));
  EXPECT_THAT(flat.places, HasSubstr("face 1 (FindingsHavePlacesInTheFile.obj:9)"));
  EXPECT_THAT(Named(inspection, "faces_repeating_a_vertex").faces, ElementsAre(2));
  EXPECT_THAT(Named(inspection, "duplicate_faces").faces, ElementsAre(3));
  EXPECT_THAT(inspection.plan, ::testing::Contains(HasSubstr("gives UV to 3 triangles without area")));
  ASSERT_TRUE(inspection.not_a_disc);
  EXPECT_EQ(inspection.not_a_disc->reason(), "MESH_FACE_DEGENERATE");
  EXPECT_THAT(inspection.not_a_disc->what(), HasSubstr("3 faces have no area"));
  EXPECT_EQ(inspection.not_a_disc->metadata().at("faces"), "1,2,4");

  const Json json = InspectionJson(input, inspection);
  EXPECT_EQ(json["findings"]["faces_without_area"]["count"], 2);
  EXPECT_EQ(json["findings"]["faces_without_area"]["lines"], Json({9, 12}));
  EXPECT_EQ(json["findings"]["non_manifold_edges"]["count"], 0) << "every kind is there";
  EXPECT_EQ(json["unwrap"]["seams_none"]["metadata"]["faces"], "1,2,4");
  EXPECT_EQ(json["findings"].size(), 11u);
}

TEST_F(InspectionTest, EdgesOfThreeFacesAreNamed) {
  const Inspection inspection =
      Inspect(Input("v 8 8 8\nv 0 0 0\nv 0 0 1\nv 1 0 0\nv 0 1 0\nv -1 0 0\nf 2 3 4\nf 3 2 5\nf 2 3 6\n"));
  const Finding& edges = Named(inspection, "non_manifold_edges");
  EXPECT_EQ(edges.text, "1 edge has more than two triangles");
  ASSERT_EQ(edges.edges.size(), 1u);
  EXPECT_THAT(edges.edges[0], ElementsAre(1, 2));
  EXPECT_THAT(edges.faces, ElementsAre(0, 1, 2));
  EXPECT_THAT(inspection.plan, ::testing::Contains("cuts along 1 edge of more than two triangles"));
  ASSERT_TRUE(inspection.not_a_disc);
  EXPECT_EQ(inspection.not_a_disc->reason(), "MESH_EDGE_NON_MANIFOLD");
}

TEST_F(InspectionTest, RefusalsSayWhy) {
  const auto refusal = [&](const std::string& obj) {
    const Inspection inspection = Inspect(Input(obj));
    EXPECT_TRUE(inspection.refusal) << obj;
    EXPECT_THAT(inspection.plan, IsEmpty());
    return inspection.refusal ? inspection.refusal->reason() : "";
  };
  EXPECT_EQ(refusal("v 0 0 0\nv nan 0 0\nv 0 1 0\nf 1 2 3\n"), "MESH_POSITION_NOT_FINITE");
  EXPECT_EQ(refusal("v 0 0 0\nv 1 0 0\nv 2 0 0\nf 1 2 3\n"), "MESH_FACE_DEGENERATE");
  EXPECT_EQ(refusal("v 0 0 0\nv 1e300 0 0\nv 0 1 0\nf 1 2 3\n"), "MESH_POSITION_INVALID");
  const MeshInput input = Input("v 0 0 0\nv 1 0 0\nv 2 0 0\nf 1 2 3\n");
  const std::string text = InspectionText(input, Inspect(input));
  EXPECT_THAT(text, HasSubstr("Surface    none: no triangle has area\n"));
  EXPECT_THAT(text, HasSubstr("Unwrap     refuses it: no face of the mesh has any area"));
  EXPECT_THAT(text, Not(HasSubstr("Angles")));
}

// Triangles are judged by the positions that travel: in a file of doubles this one has area.
TEST_F(InspectionTest, PositionsAreThoseThatTravel) {
  const Inspection inspection = Inspect(
      Input("v 100000000 0 0\nv 100000001 0 0\nv 100000000 1 0\nv 0 0 0\nv 1 0 0\nv 0 1 0\nf 1 2 3\nf 4 5 6\n"));
  EXPECT_THAT(Named(inspection, "faces_without_area").faces, ElementsAre(0));
}

TEST_F(InspectionTest, UvMaterialsAndGroups) {
  const MeshInput input = Input(
      "v 0 0 0\nv 1 0 0\nv 1 1 0\nv 0 1 0\nvt 0 0\nvt 1 0\nvt 1 1\nvt 0 1\nvt 0.5 0.5\n"
      "g left\nusemtl red\nf 1/1 2/2 3/3\ng right\nusemtl blue\nf 1/1 3/5 4/4\n");
  const Inspection inspection = Inspect(input);
  EXPECT_EQ(inspection.uv_islands, 2);
  EXPECT_EQ(inspection.uv_seams, 1);
  EXPECT_THAT(inspection.materials, ElementsAre("red", "blue"));
  EXPECT_THAT(inspection.groups, ElementsAre("left", "right"));
  EXPECT_THAT(InspectionText(input, inspection),
              HasSubstr("UV         2 islands, 1 seam edge\nMaterials  2: red, blue\nGroups     2: left, right\n"));
}

// The islands and seams that the shared collection's own tool counted.
TEST(InspectionSharedMeshes, UvIslands) {
  const fs::path meshes = PLANISH_SHARED_MESHES;
  if (!fs::exists(meshes / "MANIFEST.tsv")) GTEST_SKIP() << "no shared meshes at " << meshes;
  int compared = 0;
  for (TableRow& row : ReadTable(meshes / "MANIFEST.tsv")) {
    // Files of which not every corner has UV have no count.
    if (fs::path(row["file"]).extension() != ".obj" || row["uv_charts"] == "0" || row["uv_charts"] == "-") continue;
    SCOPED_TRACE(row["file"]);
    const MeshInput input((meshes / row["file"]).string());
    const PolygonEdges edges(input.file(), input.triangulation());
    EXPECT_EQ(edges.CountUvIslands(), std::stol(row["uv_charts"]));
    EXPECT_EQ(static_cast<long>(edges.UvBorders().size()), std::stol(row["uv_seams"]));
    ++compared;
  }
  EXPECT_GE(compared, 10);
}

}  // namespace
}  // namespace planish::cli
