#include <chrono>
#include <cmath>
#include <limits>

#include "client/files/readers.h"
#include "core/base/error.h"
#include "gmock/gmock.h"
#include "gtest/gtest.h"
#include "tests/files/sample_meshes.h"

namespace planish {
namespace {

using ::testing::ElementsAre;
using ::testing::HasSubstr;
using ::testing::StartsWith;

const char kTriangle[] = "v 0 0 0\nv 1 0 0\nv 0 1 0\n";

TEST(ObjReader, ReadsEveryWayToWriteACorner) {
  const MeshFile file = ReadObjText(std::string(kTriangle) +
                                    "vt 0 0\nvn 0 0 1\nf 1 2 3\nf 1/1 2/1 3/1\nf 1//1 2//1 3//1\nf 1/1/1 2/1/1 3/1/1\n"
                                    "f -3 -2 -1\nf -3/-1/-1 -2/-1/-1 -1/-1/-1\nf 1/ 2/ 3/\nf +1 +2 +3\n");
  ASSERT_EQ(file.mesh.num_polygons(), 8);
  for (std::int64_t p = 0; p < 8; ++p) {
    for (int k = 0; k < 3; ++k) EXPECT_EQ(file.mesh.corner_vertex[3 * p + k], k) << p;
  }
}

TEST(ObjReader, NegativeIndicesCountFromTheVerticesSoFar) {
  const MeshFile file = ReadObjText("v 0 0 0\nv 1 0 0\nv 0 1 0\nf -3 -2 -1\nv 5 5 5\nf -3 -2 -1\n");
  EXPECT_THAT(file.mesh.corner_vertex, ElementsAre(0, 1, 2, 1, 2, 3));
}

TEST(ObjReader, FacesMayComeBeforeVertices) {
  const MeshFile file = ReadObjText("f 1 2 3\nv 0 0 0\nv 1 0 0\nv 0 1 0\n");
  EXPECT_THAT(file.mesh.corner_vertex, ElementsAre(0, 1, 2));
  EXPECT_THAT(file.mesh.polygon_line, ElementsAre(1));
  EXPECT_THAT(file.mesh.vertex_line, ElementsAre(2, 3, 4));
}

TEST(ObjReader, FoIsTheOldNameOfAFace) {
  const MeshFile file = ReadObjText("v 0 0 0\nv 1 0 0\nv 1 1 0\nv 0 1 0\nf 1 2 3\nfo 1 3 \\\n 4\n");
  EXPECT_THAT(file.mesh.corner_vertex, ElementsAre(0, 1, 2, 0, 2, 3));
}

TEST(ObjReader, PolygonsOfAnySize) {
  const MeshFile file = ReadObjText("v 0 0 0\nv 1 0 0\nv 1 1 0\nv 0 1 0\nv -1 1 0\nf 1 2 3 4 5\nf 1 2 3\nf 4 3 2 1\n");
  EXPECT_THAT(file.mesh.polygon_begin, ElementsAre(0, 5, 8, 12));
  EXPECT_THAT(file.mesh.corner_vertex, ElementsAre(0, 1, 2, 3, 4, 0, 1, 2, 3, 2, 1, 0));
}

TEST(ObjReader, LinesOfEveryKind) {
  const MeshFile file = ReadObjText(
      "\xEF\xBB\xBF# made by \\\r\n"  // a '\' in a comment joins nothing
      "v\t0  0 0 # origin\r\n"
      "\r\n"
      "  v 1 0 0 1.0 0.5 0.25\r\n"
      "v 0 \\\r\n"
      "1 0\r\n"
      "o part#f 1 2 3\r\n"
      "f 1 \\\r\n"
      " 2\\\r\n"
      " 3#end\r\n"
      "f 3 2 1");
  ASSERT_EQ(file.mesh.positions.size(), 3u);
  EXPECT_EQ(file.mesh.positions[1], Vec3(1, 0, 0));
  EXPECT_EQ(file.mesh.positions[2], Vec3(0, 1, 0));
  EXPECT_THAT(file.mesh.corner_vertex, ElementsAre(0, 1, 2, 2, 1, 0));
  EXPECT_THAT(file.mesh.vertex_line, ElementsAre(2, 4, 5));
  EXPECT_THAT(file.mesh.polygon_line, ElementsAre(8, 11));
}

TEST(ObjReader, OldMacLineEnds) {
  const MeshFile file = ReadObjText("v 0 0 0\rv 1 0 0\rv 0 1 0\rf 1 2 \\\r3\rf 1 2 3");
  EXPECT_THAT(file.mesh.corner_vertex, ElementsAre(0, 1, 2, 0, 1, 2));
  EXPECT_THAT(file.mesh.polygon_line, ElementsAre(4, 6));
}

TEST(ObjReader, NumbersToTheLastBit) {
  const MeshFile file =
      ReadObjText("v 0.1 -1e-3 +2.5E2\nv .5 5. 1e400\nv -1e400 1e-400 -0\nv NaN -inf +Inf\nf 1 2 3\n");
  const auto& p = file.mesh.positions;
  EXPECT_EQ(p[0], Vec3(0.1, -0.001, 250));
  EXPECT_EQ(p[1], Vec3(0.5, 5, std::numeric_limits<double>::infinity()));
  EXPECT_EQ(p[2], Vec3(-std::numeric_limits<double>::infinity(), 0, 0));
  EXPECT_TRUE(std::signbit(p[2].z()));
  EXPECT_TRUE(std::isnan(p[3].x()));
  EXPECT_EQ(p[3].y(), -std::numeric_limits<double>::infinity());
  EXPECT_EQ(p[3].z(), std::numeric_limits<double>::infinity());
}

struct ObjFault {
  std::string text;
  std::string message;
  std::string line;
};

void PrintTo(const ObjFault& fault, std::ostream* out) {
  *out << fault.line << ": " << fault.message;
}

class ObjReaderFault : public ::testing::TestWithParam<ObjFault> {};

TEST_P(ObjReaderFault, NamesTheLine) {
  const auto mesh = ReadObj("dir/in.obj", GetParam().text);
  ASSERT_FALSE(mesh.ok());
  EXPECT_EQ(mesh.status().code(), absl::StatusCode::kInvalidArgument);
  const ErrorInfo info = ErrorInfoOf(mesh.status());
  EXPECT_EQ(info.reason, "FILE_MALFORMED");
  const std::string message(mesh.status().message());
  EXPECT_THAT(message, HasSubstr(GetParam().message));
  if (GetParam().line.empty()) {
    EXPECT_EQ(info.metadata.count("line"), 0u);
    EXPECT_THAT(message, StartsWith("dir/in.obj: "));
  } else {
    EXPECT_EQ(info.metadata.at("line"), GetParam().line);
    EXPECT_THAT(message, StartsWith("dir/in.obj:" + GetParam().line + ": "));
  }
}

const std::string kStart = kTriangle;

INSTANTIATE_TEST_SUITE_P(
    All, ObjReaderFault,
    ::testing::Values(ObjFault{"", "the file is empty", ""}, ObjFault{"\n# nothing\n", "no faces", ""},
                      ObjFault{kStart, "no faces", ""},
                      ObjFault{kStart + "f 1 2 0\n", "\"0\": vertices are numbered from 1", "4"},
                      ObjFault{kStart + "\nf 1 2 4\n", "vertex 4, but the file has 3", "5"},
                      ObjFault{kStart + "f 1 2 -4\n", "vertex -4, but only 3 come before it", "4"},
                      ObjFault{kStart + "f 1 2 99999999999\n", "99999999999", "4"},
                      ObjFault{kStart + "f 1 2 99999999999999999999\n", "whole numbers", "4"},
                      ObjFault{kStart + "f 1 2\n", "at least three corners, this one has 2", "4"},
                      ObjFault{kStart + "f\n", "this one has 0", "4"}, ObjFault{kStart + "f 1 2 x\n", "\"x\"", "4"},
                      ObjFault{kStart + "f 1 2 3.0\n", "\"3.0\"", "4"}, ObjFault{kStart + "f 1 2 /3\n", "\"/3\"", "4"},
                      ObjFault{kStart + "f 1/a 2 3\n", "\"1/a\"", "4"},
                      ObjFault{kStart + "f 1/1/b 2 3\n", "\"1/1/b\"", "4"},
                      ObjFault{kStart + "f 1/1/1/1 2 3\n", "\"1/1/1/1\"", "4"},
                      ObjFault{"v 0 0\nf 1 1 1\n", "three coordinates, this one has 2", "1"},
                      ObjFault{"v 0 0 0\nv 1,5 0 0\n", "\"1,5\" is not a number", "2"},
                      ObjFault{"v 0 0 0\nv 1 0x1 0\n", "\"0x1\" is not a number", "2"},
                      ObjFault{"v 0 0 \\\n zero\n", "\"zero\" is not a number", "1"},
                      ObjFault{"v 0 0 0 \\\n\nv 1 0 bad\n", "\"bad\"", "3"}, ObjFault{"v 0 0 +-1\n", "\"+-1\"", "1"},
                      ObjFault{std::string("\xFF\xFEv\0 \0", 6), "UTF-16", "1"},
                      ObjFault{std::string("\xFE\xFF\0v\0 ", 6), "UTF-16", "1"},
                      ObjFault{std::string("v 0 0 0\nv 1 \0 0\n", 16), "NUL byte at offset 12", "2"},
                      ObjFault{"\x1b[31m\xff garbage\n", "no faces", ""}));

TEST(ObjReader, UnprintableBytesStayOutOfMessages) {
  const auto mesh = ReadObj("in.obj", "v \x1b[31m\xff 0 0\n");
  EXPECT_EQ(std::string(mesh.status().message()), "in.obj:1: coordinate \"?[31m?\" is not a number");
  const auto longer = ReadObj("in.obj", "v " + std::string(100000, 'x') + " 0 0\n");
  EXPECT_LT(longer.status().message().size(), 100u);
}

TEST(ObjReader, TimeIsLinear) {
  // A scanner that looks ahead to the end of the text for each line would need minutes here.
  std::string text(kTriangle);
  for (int i = 0; i < 200000; ++i) text += "f 1 2 \\\n 3\n";
  const auto start = std::chrono::steady_clock::now();
  EXPECT_EQ(ReadObjText(text).mesh.num_polygons(), 200000);
  EXPECT_LT(std::chrono::steady_clock::now() - start, std::chrono::seconds(5));
}

TEST(Triangulate, FansWithTheWayBack) {
  PolygonMesh polygons;
  polygons.positions = {{9, 9, 9}, {0, 0, 0}, {1, 0, 0}, {8, 8, 8}, {1, 1, 0}, {0, 1, 0}, {-1, 1, 0}};
  polygons.corner_vertex = {1, 2, 4, 5, 6, 5, 4, 1};
  polygons.polygon_begin = {0, 5, 8};
  const Triangulation result = Triangulate(polygons);
  EXPECT_THAT(result.mesh.faces, ElementsAre(Face{0, 1, 2}, Face{0, 2, 3}, Face{0, 3, 4}, Face{3, 2, 0}));
  EXPECT_THAT(result.source_vertex, ElementsAre(1, 2, 4, 5, 6));
  EXPECT_THAT(result.source_polygon, ElementsAre(0, 0, 0, 1));
  EXPECT_THAT(result.corner_of_triangle, ElementsAre(0, 1, 2, 0, 2, 3, 0, 3, 4, 5, 6, 7));
  ASSERT_EQ(result.mesh.num_vertices(), 5);
  EXPECT_EQ(result.mesh.positions[4], Vec3(-1, 1, 0));
}

}  // namespace
}  // namespace planish
