// PLY, OFF and STL.
#include <cmath>
#include <functional>

#include "client/files/mesh_file.h"
#include "client/files/mesh_output.h"
#include "client/files/readers.h"
#include "core/base/error.h"
#include "gmock/gmock.h"
#include "gtest/gtest.h"
#include "tests/files/sample_meshes.h"

namespace planish {
namespace {

using ::testing::ElementsAre;
using ::testing::HasSubstr;

using Reader = std::function<absl::StatusOr<PolygonMesh>(const std::string&, std::string_view)>;

std::string Replaced(std::string text, const std::string& from, const std::string& to) {
  const std::size_t at = text.find(from);
  EXPECT_NE(at, std::string::npos) << from;
  return at == std::string::npos ? text : text.replace(at, from.size(), to);
}

std::string CrLf(const std::string& text) {
  std::string result;
  for (const char c : text) result += c == '\n' ? "\r\n" : std::string(1, c);
  return result;
}

struct Format {
  std::string name;
  std::string bytes;
  bool has_lines;
};

Reader ReaderOf(const std::string& name) {
  const char letter = name[name.find_last_of('.') + 1];
  return letter == 'p' || letter == 'P' ? ReadPly : letter == 's' ? ReadStl : ReadOff;
}

std::vector<Format> Formats() {
  return {{"a.obj", SampleObj(), true},
          {"a.ply", SamplePlyAscii(), true},
          {"crlf.ply", CrLf(SamplePlyAscii()), true},
          {"little.PLY", SamplePlyBinary(false), false},
          {"big.ply", SamplePlyBinary(true), false},
          {"a.off", SampleOff(), true},
          {"crlf.Off", CrLf(SampleOff()), true},
          {"a.stl", SampleStlAscii(), true},
          {"crlf.stl", CrLf(SampleStlAscii()), true},
          {"b.stl", SampleStlBinary(), false}};
}

TEST(ReadMeshFile, AllFormatsAgree) {
  const PolygonMesh expected = SamplePolygons();
  for (const Format& format : Formats()) {
    SCOPED_TRACE(format.name);
    const std::string path = TemporaryPath(format.name);
    PutFile(path, format.bytes);
    const auto file = ReadMeshFile(path);
    ASSERT_TRUE(file.ok()) << file.status();
    EXPECT_EQ(file->path, path);
    EXPECT_EQ(file->bytes, format.bytes);
    EXPECT_EQ(file->mesh.positions, expected.positions);
    EXPECT_EQ(file->mesh.corner_vertex, expected.corner_vertex);
    EXPECT_EQ(file->mesh.polygon_begin, expected.polygon_begin);
    EXPECT_EQ(file->mesh.vertex_line.size(), format.has_lines ? 5u : 0u);
    EXPECT_EQ(file->mesh.polygon_line.size(), format.has_lines ? 3u : 0u);
  }
}

// A file that lost its end is never taken for a whole one (white space at the end is no loss).
TEST(ReadMeshFile, EveryTruncationIsRefused) {
  for (const Format& format : Formats()) {
    SCOPED_TRACE(format.name);
    // An OBJ has no end mark.
    if (format.name == "a.obj") continue;
    const Reader reader = ReaderOf(format.name);
    const std::size_t content = format.has_lines ? format.bytes.find_last_not_of(" \r\n") + 1 : format.bytes.size();
    // Text may lose a digit of its last number, or a letter of the name behind "endsolid".
    const std::size_t longest = format.name.find("stl") != std::string::npos && format.has_lines
                                    ? format.bytes.rfind("endsolid") + 7
                                    : content - 1;
    for (std::size_t size = 0; size <= longest; ++size) {
      const auto file = reader(format.name, format.bytes.substr(0, size));
      ASSERT_FALSE(file.ok()) << size;
      EXPECT_EQ(Reason(file.status()), "FILE_MALFORMED") << size;
      EXPECT_EQ(file.status().code(), absl::StatusCode::kInvalidArgument) << size;
    }
  }
}

TEST(ReadMeshFile, LinesOfTextFormats) {
  const auto ply = ReadPly("a.ply", SamplePlyAscii());
  ASSERT_TRUE(ply.ok());
  EXPECT_THAT(ply->vertex_line, ElementsAre(12, 13, 14, 15, 16));
  EXPECT_THAT(ply->polygon_line, ElementsAre(17, 18, 19));
  const auto off = ReadOff("a.off", CrLf(SampleOff()));
  ASSERT_TRUE(off.ok());
  EXPECT_THAT(off->vertex_line, ElementsAre(4, 5, 6, 7, 8));
  EXPECT_THAT(off->polygon_line, ElementsAre(9, 10, 11));
  const auto stl = ReadStl("a.stl", SampleStlAscii());
  ASSERT_TRUE(stl.ok());
  EXPECT_THAT(stl->vertex_line, ElementsAre(4, 5, 6, 13, 19));
  EXPECT_THAT(stl->polygon_line, ElementsAre(2, 9, 16));
}

TEST(ReadMeshFile, FilesThatCannotBeRead) {
  EXPECT_EQ(ReadMeshFile(TemporaryPath("missing.obj")).status().code(), absl::StatusCode::kNotFound);
  EXPECT_EQ(Reason(ReadMeshFile(TemporaryPath("missing.obj")).status()), "FILE_UNREADABLE");
  const auto folder = ReadMeshFile(::testing::TempDir());
  EXPECT_EQ(Reason(folder.status()), "FILE_UNREADABLE");
  EXPECT_THAT(std::string(folder.status().message()), HasSubstr("directory"));
  PutFile(TemporaryPath("a.fbx"), "{}");
  const auto unknown = ReadMeshFile(TemporaryPath("a.fbx"));
  EXPECT_EQ(unknown.status().code(), absl::StatusCode::kInvalidArgument);
  EXPECT_EQ(Reason(unknown.status()), "FILE_FORMAT_UNKNOWN");
  EXPECT_THAT(std::string(unknown.status().message()), HasSubstr(".obj, .ply, .off, .stl, .gltf, .glb or .drc"));
}

TEST(FormatOfBytes, OfEveryFormat) {
  EXPECT_EQ(FormatOfBytes(SampleObj()), MeshFormat::kObj);
  EXPECT_EQ(FormatOfBytes("\xEF\xBB\xBF# a comment\r\n\r\n  mtllib a b.mtl\r\n"), MeshFormat::kObj);
  EXPECT_EQ(FormatOfBytes(SamplePlyAscii()), MeshFormat::kPly);
  EXPECT_EQ(FormatOfBytes(SamplePlyBinary(true)), MeshFormat::kPly);
  EXPECT_EQ(FormatOfBytes(SampleOff()), MeshFormat::kOff);
  EXPECT_EQ(FormatOfBytes("# v 1 2 3\nSTOFF\n3 1 0\n"), MeshFormat::kOff);
  EXPECT_EQ(FormatOfBytes(SampleStlAscii()), MeshFormat::kStl);
  std::string binary = SampleStlBinary();
  EXPECT_EQ(FormatOfBytes(binary), MeshFormat::kStl);
  binary.replace(0, 5, "v 1 2");  // its head may say anything
  EXPECT_EQ(FormatOfBytes(binary), MeshFormat::kStl);
  EXPECT_EQ(FormatOfBytes(" \n{\"asset\": {}}"), MeshFormat::kGltf);
  EXPECT_EQ(FormatOfBytes("glTF\2"), MeshFormat::kGlb);
  EXPECT_EQ(FormatOfBytes("DRACO\2\2"), MeshFormat::kDraco);
  for (const char* text : {"", "\n# nothing\n", "vertex 1 2 3\n", "; FBX 7.3.0 project file\n"}) {
    EXPECT_EQ(FormatOfBytes(text), std::nullopt) << text;
  }
}

TEST(PlyReader, SkipsWhatItDoesNotNeed) {
  const std::string text =
      "ply\rformat ascii 1.0\robj_info x\relement camera 2\rproperty list int float ray\rproperty int id\r"
      "element face 2\rproperty uchar flags\rproperty list uint8 uint32 vertex_index\r"
      "property list uchar float texcoord\relement vertex 4\rproperty double z\rproperty double y\r"
      "property list uchar uchar tags\rproperty double x\relement nothing 99999999999\rend_header\r"
      "2 0.5 0.5 1\r0 7\r9 3 0 1 2 0\r9 4 0 1 2 3 2 0.5 0.5\r1 2 1 7 3\r4 5 0 6\r7 8 0 9\r0.1 0 0 0";
  const auto mesh = ReadPly("a.ply", text);
  ASSERT_TRUE(mesh.ok()) << mesh.status();
  EXPECT_THAT(mesh->positions, ElementsAre(Vec3(3, 2, 1), Vec3(6, 5, 4), Vec3(9, 8, 7), Vec3(0, 0, 0.1)));
  EXPECT_THAT(mesh->corner_vertex, ElementsAre(0, 1, 2, 0, 1, 2, 3));
  EXPECT_THAT(mesh->polygon_begin, ElementsAre(0, 3, 7));
}

TEST(PlyReader, BinaryTypes) {
  std::string bytes =
      "ply\nformat binary_big_endian 1.0\nelement vertex 3\nproperty double x\nproperty short y\nproperty uchar z\n"
      "element face 1\nproperty list ushort int8 vertex_indices\nend_header\n";
  const std::string tenth = "\x3f\xb9\x99\x99\x99\x99\x99\x9a";  // 0.1
  for (int i = 0; i < 3; ++i) bytes += tenth + "\xff\xfe" + "\xc8";
  bytes += std::string("\0\x03\0\x01\x02", 5);
  const auto mesh = ReadPly("a.ply", bytes);
  ASSERT_TRUE(mesh.ok()) << mesh.status();
  EXPECT_EQ(mesh->positions[2], Vec3(0.1, -2, 200));
  EXPECT_THAT(mesh->corner_vertex, ElementsAre(0, 1, 2));
}

// The standard wants it in the second line; files are about that have it elsewhere, or not at all.
TEST(PlyReader, TheLineFormatMayComeLateOrBeMissing) {
  const std::vector<std::int32_t> corners = SamplePolygons().corner_vertex;
  for (const auto& [bytes, line] :
       std::vector<std::pair<std::string, std::string>>{{SamplePlyAscii(), "format ascii 1.0\n"},
                                                        {SamplePlyBinary(false), "format binary_little_endian 1.0\n"},
                                                        {SamplePlyBinary(true), "format binary_big_endian 1.0\n"}}) {
    const std::string without = Replaced(bytes, line, "");
    for (const std::string& text : {without, Replaced(without, "end_header", line + "end_header"),
                                    Replaced(without, "element face", line + "element face")}) {
      const auto mesh = ReadPly("a.ply", text);
      ASSERT_TRUE(mesh.ok()) << mesh.status();
      EXPECT_EQ(mesh->corner_vertex, corners) << line;
      EXPECT_EQ(mesh->positions, SamplePolygons().positions) << line;
    }
    // What is written has it, for the readers of others.
    PutFile(TemporaryPath("without.ply"), without);
    OutputOptions options;
    options.format = MeshFormat::kPly;
    const auto written = WriteMeshWithUv(ReadMeshFile(TemporaryPath("without.ply")).value(),
                                         std::vector<double>(2 * corners.size(), 0.5), options);
    ASSERT_TRUE(written.ok()) << written.status();
    EXPECT_THAT(written->files[0].bytes, HasSubstr("\n" + line));
    const auto again = ReadPly("again.ply", written->files[0].bytes);
    ASSERT_TRUE(again.ok()) << again.status();
    EXPECT_EQ(again->positions, SamplePolygons().positions);
  }
}

TEST(OffReader, Variants) {
  for (const std::string text : {"OFF 3 1 3\n0 0 0\n1 0 0\n0 1 0\n3 0 1 2\n", "3 1 0 0 0 0\n1 0 0 0 1 0\n",
                                 "\n# c\nCOFF\n3 1\n0 0 0 255 0 0 255\n"
                                 "1 0 0 1 1 1 1#x\n0 1 0 0 0 0 0\n3 0 1 2 0.5 0.5 0.5\n",
                                 "STCNOFF 3 1 0\n0 0 0 0 0 1\n1 0 0 0 0 1\n0 1 0 0 0 1\n3 0 1 2 17"}) {
    const auto mesh = ReadOff("a.off", text);
    // Several vertices on one line are no OFF.
    if (text[0] == '3') {
      EXPECT_FALSE(mesh.ok());
      continue;
    }
    ASSERT_TRUE(mesh.ok()) << text << mesh.status();
    EXPECT_THAT(mesh->positions, ElementsAre(Vec3(0, 0, 0), Vec3(1, 0, 0), Vec3(0, 1, 0)));
    EXPECT_THAT(mesh->corner_vertex, ElementsAre(0, 1, 2));
  }
}

TEST(StlReader, JoinsCornersAtExactlyTheSamePosition) {
  const std::string text =
      "SOLID\nfacet normal nan nan nan\nouter loop\nvertex 0 0 0\nvertex 1 0 0\nvertex 0 1 0\nendloop\nendfacet\n"
      "facet normal 0 0 0\nouter loop\nvertex -0 0 -0\nvertex 0 1 0\nvertex 1.0000000001 0 0\nendloop\nendfacet\n"
      "endsolid\nsolid second\nFacet normal 0 0 0\nOuter Loop\nvertex nan 0 0\nvertex nan 0 0\nvertex 0 0 inf\n"
      "endloop\nendfacet\nendsolid second part\n";
  const auto mesh = ReadStl("a.stl", text);
  ASSERT_TRUE(mesh.ok()) << mesh.status();
  EXPECT_THAT(mesh->corner_vertex, ElementsAre(0, 1, 2, 0, 2, 3, 4, 4, 5));
  EXPECT_TRUE(std::isnan(mesh->positions[4].x()));
}

TEST(StlReader, BinaryMayHaveBytesBehindItsTriangles) {
  const auto mesh = ReadStl("a.stl", SampleStlBinary().replace(0, 5, "xxxxx") + "trailer");
  ASSERT_TRUE(mesh.ok()) << mesh.status();
  EXPECT_EQ(mesh->num_polygons(), 3);
}

struct SoupFault {
  std::string name;
  std::string bytes;
  std::string message;
};

void PrintTo(const SoupFault& fault, std::ostream* out) {
  *out << fault.name << fault.message;
}

class SoupReaderFault : public ::testing::TestWithParam<SoupFault> {};

TEST_P(SoupReaderFault, IsNamed) {
  const std::string& name = GetParam().name;
  const auto mesh = ReaderOf("in." + name)("in." + name, GetParam().bytes);
  ASSERT_FALSE(mesh.ok());
  EXPECT_EQ(Reason(mesh.status()), "FILE_MALFORMED");
  EXPECT_THAT(std::string(mesh.status().message()), HasSubstr("in." + name + GetParam().message));
}

std::string Ply(const std::string& from, const std::string& to) {
  return Replaced(SamplePlyAscii(), from, to);
}
std::string Binary(const std::string& from, const std::string& to) {
  return Replaced(SamplePlyBinary(false), from, to);
}

INSTANTIATE_TEST_SUITE_P(
    Ply, SoupReaderFault,
    ::testing::Values(
        SoupFault{"ply", "", ": the file is empty"}, SoupFault{"ply", "v 0 0 0\n", ":1: a PLY file starts with"},
        SoupFault{"ply", Ply("ascii", "utf8"), ":2: unknown format \"utf8\""},
        SoupFault{"ply", Ply("end_header", "end"), ":11: unknown line"},
        SoupFault{"ply", Ply("element vertex 5", "element vertex -5"), ":4: an element line"},
        SoupFault{"ply", Ply("property float x", "property half x"), ":5: unknown type"},
        SoupFault{"ply", Ply("list uchar", "list float"), ":10: the length of a list"},
        SoupFault{"ply", Ply("uchar int", "uchar float"), ": vertex_indices must have an integer type"},
        SoupFault{"ply", Ply("vertex_indices", "indices"), ": the faces have no list property"},
        SoupFault{"ply", Ply("float z", "float w"), ": the vertices have no property \"z\""},
        SoupFault{"ply", Ply("element face", "element tristrips"), ": triangle strips are not supported"},
        SoupFault{"ply", Ply("element face 3", "element face 0"), ": no faces"},
        SoupFault{"ply", Ply("vertex 5", "vertex 4000000000"),
                  ": the header announces 4000000000 of element \"vertex\""},
        SoupFault{"ply", Ply("vertex 5", "vertex 6"), ":20: the file ends before face 2"},
        SoupFault{"ply", Ply("1.5 0", "1,5 0"), ":13: vertex 1: \"1,5\""},
        SoupFault{"ply", Ply("3 0 2 3", "3 0 2 5"),
                  ":18: face 1 refers to vertex 5, but the file has 5, numbered from 0"},
        SoupFault{"ply", Ply("3 0 2 3", "3 0 -2 3"), ":18: face 1 refers to vertex -2"},
        SoupFault{"ply", Ply("3 0 2 3", "2 0 2"), ":18: face 1 has 2 corners"},
        SoupFault{"ply", Ply("3 0 2 3", "3 0 2.5 3"), ":18: face 1: \"2.5\" is not a whole number"},
        SoupFault{"ply", Ply("3 1 4 2", "4000000000 1 4 2"), ":20: the file ends before face 2"},
        SoupFault{"ply", Binary("vertex 5", "vertex 5000000"), ": the header announces 5000000"},
        SoupFault{"ply", Binary("face 3", "face 4"), ": the file ends before face 3"},
        SoupFault{"ply", Binary(Bytes(std::int32_t{4}), Bytes(std::int32_t{5})), ": face 2 refers to vertex 5"},
        SoupFault{"ply", Binary(Bytes(std::int32_t{4}), Bytes(std::int32_t{-1})), ": face 2 refers to vertex -1"},
        SoupFault{"ply", Binary("\x03" + Bytes(std::int32_t{1}), "\xff" + Bytes(std::int32_t{1})),
                  ": the file ends before face 2"}));

std::string Off(const std::string& from, const std::string& to) {
  return Replaced(SampleOff(), from, to);
}

INSTANTIATE_TEST_SUITE_P(
    Off, SoupReaderFault,
    ::testing::Values(SoupFault{"off", "", ": the file is empty"},
                      SoupFault{"off", Off("OFF", "OBJ"), ":1: an OFF file starts"},
                      SoupFault{"off", Off("OFF", "4OFF"), ":1: \"4OFF\" holds vertices that are not in 3D"},
                      SoupFault{"off", Off("OFF", "nOFF"), ":1: \"nOFF\" holds vertices that are not in 3D"},
                      SoupFault{"off", Off("OFF", "OFF BINARY"), ":1: binary OFF is not supported"},
                      SoupFault{"off", Off("5 3 0", "5 x 0"), ":3: number of faces: \"x\""},
                      SoupFault{"off", Off("5 3 0", "-5 3 0"), ":3: number of vertices: -5 is out of range"},
                      SoupFault{"off", Off("5 3 0", "2000000000 3 0"), ":3: the header announces 2000000000 vertices"},
                      SoupFault{"off", Off("5 3 0", "5 0 0"), ": no faces"},
                      SoupFault{"off", Off("5 3 0", "5 4 0"), ":12: the file ends before face 3"},
                      SoupFault{"off", Off("1.5 0", "1.5.0 0"), ":5: vertex 1: \"1.5.0\" is not a number"},
                      SoupFault{"off", Off("3 0 2 3", "3 0 2 5"), ":10: face 1 refers to vertex 5"},
                      SoupFault{"off", Off("3 0 2 3", "3 0 2 -1"), ":10: face 1 refers to vertex -1"},
                      SoupFault{"off", Off("3 0 2 3", "2 0 2"), ":10: face 1 has 2 corners"},
                      SoupFault{"off", Off("3 1 4 2", "4000000000000 1 4 2"), ":12: the file ends before face 2"}));

std::string Stl(const std::string& from, const std::string& to) {
  return Replaced(SampleStlAscii(), from, to);
}

INSTANTIATE_TEST_SUITE_P(
    Stl, SoupReaderFault,
    ::testing::Values(SoupFault{"stl", "", ": the file is empty"}, SoupFault{"stl", "solid\nendsolid\n", ": no faces"},
                      SoupFault{"stl", "hello", ": neither an ascii STL"},
                      SoupFault{"stl", std::string(80, 'x') + Bytes(std::int32_t{-1}),
                                ": the header announces 4294967295 triangles, which take 214748364834 bytes"},
                      SoupFault{"stl", std::string(84, '\0'), ": no faces"},
                      SoupFault{"stl", Stl("outer", "inner"), ":3: expected \"outer\", found \"inner\""},
                      SoupFault{"stl", Stl("vertex 1.5 0 0", "vertex 1.5 0"),
                                ":6: triangle 0: \"vertex\" is not a number"},
                      SoupFault{"stl", Stl("    endloop", "vertex 0 0 0\nendloop"), ":7: expected \"endloop\", found"},
                      SoupFault{"stl", Stl("endsolid a sample", ""), ":24: the file ends without \"endsolid\""},
                      SoupFault{"stl", SampleStlAscii() + "rubbish", ":24: expected \"solid\", found \"rubbish\""}));

}  // namespace
}  // namespace planish
