// Seams that a file has or that a list names, found in the triangulation.
#include <filesystem>

#include "client/cli/seams.h"
#include "gmock/gmock.h"
#include "gtest/gtest.h"
#include "planish/error.h"
#include "tests/testing/files.h"

namespace planish::cli {
namespace {

using ::testing::ElementsAre;
using ::testing::HasSubstr;
using ::testing::IsEmpty;

// Two quads side by side, 0 1 4 3 and 1 2 5 4, which meet at the edge 1-4, and a triangle 2 6 5 at the edge 2-5.
// Triangles: (0 1 4) (0 4 3) (1 2 5) (1 5 4) (2 6 5); their corners are numbered 0 to 14. Corner 2 faces 0-1, and so
// on.
class PolygonEdgesTest : public ::testing::Test {
 protected:
  PolygonEdgesTest() {
    file_.path = "quads.obj";
    file_.mesh.positions = {{0, 0, 0}, {1, 0, 0}, {2, 0, 0}, {0, 1, 0}, {1, 1, 0}, {2, 1, 0}, {3, 0, 0}};
    file_.mesh.polygon_begin = {0, 4, 8, 11};
    file_.mesh.corner_vertex = {0, 1, 4, 3, 1, 2, 5, 4, 2, 6, 5};
    triangles_ = Triangulate(file_.mesh);
  }

  std::string Write(const std::string& text) {
    const std::string path = directory_.Path("seam_edges.txt");
    PutFile(path, text);
    return path;
  }

  // The message of the error that ListedIn throws.
  std::string Complaint(const std::string& text) {
    try {
      PolygonEdges(file_, triangles_).ListedIn(Write(text));
    } catch (const Error& error) {
      EXPECT_EQ(error.reason(), "FILE_MALFORMED");
      return error.what();
    }
    return "";
  }

  const TempDir directory_;
  MeshFile file_;
  Triangulation triangles_;
};

constexpr std::int32_t kFaces14 = 0;  // corner 0 of (0 1 4)
constexpr std::int32_t kFaces25 = 6;  // corner 0 of (1 2 5)

// --preset=lightmap asks for seams of the UV; a file without UV was refused with words about --seams=uv.
TEST_F(PolygonEdgesTest, APresetTakesSeamsOfUvWhereThereAreAny) {
  SeamList list;
  list.uv = true;
  EXPECT_THROW(SeamCorners(file_, triangles_, list), Error);
  list.uv_is_optional = true;
  EXPECT_THAT(SeamCorners(file_, triangles_, list), IsEmpty());
  file_.mesh.texcoords.resize(11);
  file_.mesh.corner_texcoord = {0, 1, 2, 3, 4, 5, 6, 7, 8, 9, 10};
  EXPECT_EQ(SeamCorners(file_, triangles_, list).size(), 2u);
}

TEST_F(PolygonEdgesTest, UvBordersAreWhereIdsDifferAtAnEnd) {
  EXPECT_THAT(PolygonEdges(file_, triangles_).UvBorders(), IsEmpty()) << "no UV at all";
  file_.mesh.texcoords.resize(9);
  file_.mesh.corner_texcoord = {0, 1, 4, 3, 1, 2, 5, 4, 2, 6, 5};
  EXPECT_THAT(PolygonEdges(file_, triangles_).UvBorders(), IsEmpty());
  EXPECT_EQ(PolygonEdges(file_, triangles_).CountUvIslands(), 1);
  file_.mesh.corner_texcoord = {0, 1, 4, 3, 1, 2, 5, 7, 2, 6, 5};
  EXPECT_THAT(PolygonEdges(file_, triangles_).UvBorders(), ElementsAre(kFaces14));
  EXPECT_EQ(PolygonEdges(file_, triangles_).CountUvIslands(), 2);
  file_.mesh.corner_texcoord = {0, 1, 4, 3, 8, 2, 5, 7, 2, 6, -1};
  EXPECT_THAT(PolygonEdges(file_, triangles_).UvBorders(), ElementsAre(kFaces14, kFaces25));
  EXPECT_EQ(PolygonEdges(file_, triangles_).CountUvIslands(), 3);
  file_.mesh.corner_texcoord = {0, 1, 4, 3, 8, 2, -1, 7, 2, 6, -1};
  EXPECT_THAT(PolygonEdges(file_, triangles_).UvBorders(), ElementsAre(kFaces14)) << "none on either side";
}

// A flat pouch of two sheets that hang together at all sides, the back mirrored onto the front in the map. It
// cannot lie flat unfolded, so that its folds are seams; two sheets that hang together at one side can.
TEST_F(PolygonEdgesTest, UvFoldsAreWhereOneHalfIsMirroredOntoTheOther) {
  const auto folds = [](bool is_pouch) {
    MeshFile file;
    PolygonMesh& mesh = file.mesh;
    for (const double z : {0.0, 0.1}) {
      for (const double y : {0.0, 1.0}) {
        for (const double x : {0.0, 1.0}) mesh.positions.emplace_back(x, y, z);
      }
    }
    mesh.texcoords = {Vec2(0, 0), Vec2(1, 0), Vec2(0, 1), Vec2(1, 1)};
    // Both sheets, and between them nothing: the back has the front's vertices along the sides that hang together.
    const std::int32_t other = is_pouch ? 0 : 4;
    mesh.polygon_begin = {0, 4, 8};
    mesh.corner_vertex = {0, 1, 3, 2, 0, 2, 3 + other, 1 + other};
    mesh.corner_texcoord = {0, 1, 3, 2, 0, 2, 3, 1};
    const Triangulation triangles = Triangulate(mesh);
    return PolygonEdges(file, triangles).UvFolds().size();
  };
  EXPECT_EQ(folds(true), 4u);
  EXPECT_EQ(folds(false), 0u);
}

TEST_F(PolygonEdgesTest, MaterialAndGroupBorders) {
  file_.mesh.polygon_material = {0, 0, 1};
  file_.mesh.polygon_group = {-1, 0, 0};
  const PolygonEdges edges(file_, triangles_);
  EXPECT_THAT(edges.MaterialBorders(), ElementsAre(kFaces25));
  EXPECT_THAT(edges.GroupBorders(), ElementsAre(kFaces14));
  SeamList list;
  list.materials = list.groups = true;
  EXPECT_THAT(SeamCorners(file_, triangles_, list), ElementsAre(kFaces14, kFaces25));
}

TEST_F(PolygonEdgesTest, AnEdgeOfThreePolygonsCountsIfAnyTwoDiffer) {
  file_.mesh.positions.push_back({1, 0.5, 1});
  file_.mesh.corner_vertex.insert(file_.mesh.corner_vertex.end(), {1, 4, 7});
  file_.mesh.polygon_begin.push_back(14);
  triangles_ = Triangulate(file_.mesh);
  file_.mesh.polygon_material = {0, 0, 0, 0};
  EXPECT_THAT(PolygonEdges(file_, triangles_).MaterialBorders(), IsEmpty());
  file_.mesh.polygon_material = {0, 0, 0, 1};
  EXPECT_THAT(PolygonEdges(file_, triangles_).MaterialBorders(), ElementsAre(kFaces14));
}

TEST_F(PolygonEdgesTest, ListsCountVerticesAsTheFileDoes) {
  const std::string list = "# two seams\n\n2 5   # the middle\n  6\t3\r\n5 2\n";
  EXPECT_THAT(PolygonEdges(file_, triangles_).ListedIn(Write(list)), ElementsAre(kFaces14, kFaces25));
  file_.format = MeshFormat::kPly;
  EXPECT_THAT(PolygonEdges(file_, triangles_).ListedIn(Write("1 4\n5 2\n")), ElementsAre(kFaces14, kFaces25));
}

TEST_F(PolygonEdgesTest, ListsAreCheckedLineByLine) {
  EXPECT_THAT(Complaint("2 5\n1 5\n"), HasSubstr("seam_edges.txt:2: no face of quads.obj has an edge from vertex 1"))
      << "a diagonal of the triangulation";
  EXPECT_THAT(Complaint("0 1\n"), HasSubstr(":1: \"0\" is no vertex of quads.obj, which has 1 to 7"));
  EXPECT_THAT(Complaint("1 8\n"), HasSubstr("\"8\" is no vertex"));
  EXPECT_THAT(Complaint("1 2 3\n"), HasSubstr(":1: expected the numbers of two vertices"));
  EXPECT_THAT(Complaint("1 x\n"), HasSubstr("\"x\" is no vertex"));
  EXPECT_THAT(Complaint("3 3\n"), HasSubstr("no face"));
  file_.format = MeshFormat::kStl;
  EXPECT_THAT(Complaint("1 2\n"), HasSubstr("STL"));
  EXPECT_THROW(PolygonEdges(file_, triangles_).ListedIn("/nonexistent/list"), Error);
}

TEST_F(PolygonEdgesTest, UncutEdgesAreThoseOfTheList) {
  EXPECT_THAT(UncutCorners(file_, triangles_, {}), IsEmpty()) << "diagonals travel as polygons";
  SeamList list;
  list.uncut_files = {Write("2 5\n1 2\n")};
  EXPECT_THAT(UncutCorners(file_, triangles_, list), ElementsAre(0, 2)) << "1-4 and 0-1";
}

TEST_F(PolygonEdgesTest, SourcesThatTheFileDoesNotHaveAreRefused) {
  for (bool SeamList::*source : {&SeamList::uv, &SeamList::materials, &SeamList::groups}) {
    SeamList list;
    list.*source = true;
    try {
      SeamCorners(file_, triangles_, list);
      ADD_FAILURE() << "nothing was thrown";
    } catch (const Error& error) {
      EXPECT_EQ(error.reason(), "OPTIONS_INVALID");
      EXPECT_THAT(error.what(), HasSubstr("quads.obj has no"));
    }
  }
  EXPECT_THAT(SeamCorners(file_, triangles_, {}), IsEmpty());
}

}  // namespace
}  // namespace planish::cli
