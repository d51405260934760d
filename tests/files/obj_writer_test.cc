#include <bit>

#include "client/files/readers.h"
#include "gtest/gtest.h"
#include "tests/files/sample_meshes.h"

namespace planish {
namespace {

// UV that are the same for all corners of a vertex: (vertex / 8, 0.5).
std::vector<double> UvByVertex(const PolygonMesh& mesh) {
  std::vector<double> uv;
  for (const std::int32_t vertex : mesh.corner_vertex) {
    uv.push_back(vertex / 8.0);
    uv.push_back(0.5);
  }
  return uv;
}

std::string Write(const std::string& text) {
  const MeshFile file = ReadObjText(text);
  return WriteObjWithUv(file, UvByVertex(file.mesh), true);
}

TEST(ObjWriter, PutsUvBehindTheVertices) {
  EXPECT_EQ(Write("# head\nv 0 0 0\nv 1 0 0\nv 0 1 0\nvn 0 0 1\n# faces\ng a b\nusemtl red\ns 1\nf 1//1 2//1 3//1\n"),
            "# head\nv 0 0 0\nv 1 0 0\nv 0 1 0\nvn 0 0 1\nvt 0 0.5\nvt 0.125 0.5\nvt 0.25 0.5\n# faces\ng a b\n"
            "usemtl red\ns 1\nf 1/1/1 2/2/1 3/3/1\n");
}

TEST(ObjWriter, TakesThePlaceOfOldUv) {
  EXPECT_EQ(Write("v 0 0 0\nvt 9 9 9 # old\n# between\nv 1 0 0\nv 0 1 0\n vt 8 \\\n8\nf 1/1 2/2 3/-1\nvt 7 7"),
            "v 0 0 0\nvt 0 0.5\nvt 0.125 0.5\nvt 0.25 0.5\n# between\nv 1 0 0\nv 0 1 0\nf 1/1 2/2 3/3\n");
}

TEST(ObjWriter, KeepsEveryOtherByte) {
  EXPECT_EQ(Write("\xEF\xBB\xBF# caf\xC3\xA9 \\\r\nmtllib a b.mtl  \r\no \tthing\r\n"
                  "v  0.10 0 -0.0  1.0 1 1 # corner\r\n\tv 1e0 0 0\r\n\r\nv 0 1. 0\t\r\nvn 0 0 1\r\n"
                  "vp 1 2\r\ns off\r\ng\r\n"
                  "f  -3/1/-1\t2/ 3//1   # all \\ kinds\r\n"
                  "f 1 \\\r\n   2 \\\r\n 3#x\r\n"
                  "unknown f 1 2 3\r\n"
                  "f 3 2 1  "),
            "\xEF\xBB\xBF# caf\xC3\xA9 \\\r\nmtllib a b.mtl  \r\no \tthing\r\n"
            "v  0.10 0 -0.0  1.0 1 1 # corner\r\n\tv 1e0 0 0\r\n\r\nv 0 1. 0\t\r\nvn 0 0 1\r\n"
            "vt 0 0.5\r\nvt 0.125 0.5\r\nvt 0.25 0.5\r\n"
            "vp 1 2\r\ns off\r\ng\r\n"
            "f  -3/1/-1\t2/2 3/3/1   # all \\ kinds\r\n"
            "f 1/1 \\\r\n   2/2 \\\r\n 3/3#x\r\n"
            "unknown f 1 2 3\r\n"
            "f 3/3 2/2 1/1  ");
}

TEST(ObjWriter, OtherElementsLoseTheirUv) {
  EXPECT_EQ(Write("v 0 0 0\nv 1 0 0\nv 0 1 0\nvt 0 0\nl 1/1 2/1 # line\nl 1 -1\np 1\nl 1/1\\\n 3/1\n"
                  "surf 0 1 0 1 1/1/1 2//1 3/1\nf 1/1 2/1 3/1\nl 2/1"),
            "v 0 0 0\nv 1 0 0\nv 0 1 0\nvt 0 0.5\nvt 0.125 0.5\nvt 0.25 0.5\nl 1 2 # line\nl 1 -1\np 1\nl 1\\\n 3\n"
            "surf 0 1 0 1 1//1 2//1 3\nf 1/1 2/2 3/3\nl 2");
}

TEST(ObjWriter, UvComeBeforeTheFirstFaceWhateverTheOrder) {
  EXPECT_EQ(Write("f 1 2 3\nv 0 0 0\nv 1 0 0\nv 0 1 0\nvt 0 0\n"),
            "vt 0 0.5\nvt 0.125 0.5\nvt 0.25 0.5\nf 1/1 2/2 3/3\nv 0 0 0\nv 1 0 0\nv 0 1 0\n");
  EXPECT_EQ(Write("v 0 0 0\nv 1 0 0\nv 0 1 0\nf 1 2 3\nv 1 1 1\nvt 0 0\nf 1/1 2/1 4/1\n"),
            "v 0 0 0\nv 1 0 0\nv 0 1 0\nvt 0 0.5\nvt 0.125 0.5\nvt 0.25 0.5\nvt 0.375 0.5\n"
            "f 1/1 2/2 3/3\nv 1 1 1\nf 1/1 2/2 4/4\n");
}

TEST(ObjWriter, OldMacLineEndsStay) {
  EXPECT_EQ(Write("v 0 0 0\rv 1 0 0\rv 0 1 0\rf 1 2 3\r"),
            "v 0 0 0\rv 1 0 0\rv 0 1 0\rvt 0 0.5\rvt 0.125 0.5\rvt 0.25 0.5\rf 1/1 2/2 3/3\r");
}

// Found by mutation: the CR in the comment was taken for the line end of the file.
TEST(ObjWriter, AStrayCarriageReturnIsNoLineEnd) {
  EXPECT_EQ(Write("# a\rb\nv 0 0 0\nv 1 0 0\nv 0 1 0\r \nf 1 2 3\n"),
            "# a\rb\nv 0 0 0\nv 1 0 0\nv 0 1 0\r \nvt 0 0.5\nvt 0.125 0.5\nvt 0.25 0.5\nf 1/1 2/2 3/3\n");
}

TEST(ObjWriter, WritingTwiceChangesNothing) {
  const std::string once = Write(SampleObj() + "l 1 2\n");
  EXPECT_EQ(Write(once), once);
}

TEST(ObjWriter, OneUvPerVertexAndValue) {
  const MeshFile file = ReadObjText("v 0 0 0\nv 1 0 0\nv 1 1 0\nv 0 1 0\nf 1 2 3\nf 1 3 4\nf 1 2 3\n");
  // Vertices 0 and 1 share a value and still get a line each; vertex 0 has a seam; -0 is 0.
  const std::vector<double> uv = {0, 0, 0, 0, 1, 1, 0.5, 0, 1, 1, 0, 1, -0.0, 0, 0, -0.0, 1, 1};
  EXPECT_EQ(WriteObjWithUv(file, uv, true),
            "v 0 0 0\nv 1 0 0\nv 1 1 0\nv 0 1 0\nvt 0 0\nvt 0 0\nvt 1 1\nvt 0.5 0\nvt 0 1\n"
            "f 1/1 2/2 3/3\nf 1/4 3/3 4/5\nf 1/1 2/2 3/3\n");
}

// Whoever reads the digits as doubles gets the floats, too.
TEST(ObjWriter, FewestDigitsOfTheDoublesThatFloatsAre) {
  const MeshFile file = ReadObjText("v 0 0 0\nv 1 0 0\nv 1 1 0\nf 1 2 3\n");
  const std::vector<double> uv = {0.1, 1.0 / 3, 0.1f, 1e-9, 1 - 0x1p-53, 1e-300};
  EXPECT_EQ(WriteObjWithUv(file, uv, true),
            "v 0 0 0\nv 1 0 0\nv 1 1 0\nvt 0.10000000149011612 0.3333333432674408\n"
            "vt 0.10000000149011612 9.999999717180685e-10\nvt 1 0\nf 1/1 2/2 3/3\n");
  EXPECT_EQ(WriteObjWithUv(file, uv, false),
            "v 0 0 0\nv 1 0 0\nv 1 1 0\nvt 0.1 0.3333333333333333\nvt 0.10000000149011612 1e-09\n"
            "vt 0.9999999999999999 1e-300\nf 1/1 2/2 3/3\n");
}

TEST(ObjWriter, FromOtherFormatsPlainLines) {
  MeshFile file;
  file.format = MeshFormat::kPly;
  file.mesh.positions = {{0.1f, 1e30f, -2}, {0.1, 0, 0}, {3, 0, 0}, {0, 1.0f / 3, 0}};
  file.mesh.corner_vertex = {0, 1, 2, 3, 2, 1, 0};
  file.mesh.polygon_begin = {0, 4, 7};
  // What was a float has the digits of a float; what only a double holds has those of a double.
  EXPECT_EQ(WriteObjWithUv(file, UvByVertex(file.mesh), true),
            "v 0.1 1e+30 -2\nv 0.1 0 0\nv 3 0 0\nv 0 0.33333334 0\nvt 0 0.5\nvt 0.125 0.5\nvt 0.25 0.5\nvt 0.375 0.5\n"
            "f 1/1 2/2 3/3 4/4\nf 3/3 2/2 1/1\n");
}

}  // namespace
}  // namespace planish
