// PLY and OFF: what stays as it was around the UV.
#include "client/files/mesh_output.h"
#include "gtest/gtest.h"
#include "tests/files/sample_meshes.h"

namespace planish {
namespace {

// A file of two triangles with a seam along their edge where `seam`, else with one UV per vertex.
std::string WithUv(const std::string& name, const std::string& bytes, bool seam) {
  PutFile(TemporaryPath(name), bytes);
  const auto file = ReadMeshFile(TemporaryPath(name));
  EXPECT_TRUE(file.ok()) << file.status();
  OutputOptions options;
  options.path = TemporaryPath("out" + name);
  options.format = file->format;
  const float v = seam ? 0.5f : 0.0f;
  const auto written = WriteMeshWithUv(*file, {0, 0, 1, 0, 1, 1, 0, v, 1, 1, 0, 1}, options);
  EXPECT_TRUE(written.ok()) << written.status();
  return written->files[0].bytes;
}

TEST(PlyWriter, KeepsElementsPropertiesAndComments) {
  const std::string before =
      "ply\r\nformat ascii 1.0\r\ncomment by hand\r\nelement camera 1\r\nproperty list uchar float ray\r\n"
      "element vertex 4\r\nproperty uchar red\r\nproperty float x\r\nproperty float y\r\nproperty float z\r\n"
      "element face 2\r\nproperty uchar flag\r\nproperty list uchar uchar vertex_index\r\nobj_info x\r\nend_header\r\n"
      "2 0.10 7e0\r\n7 0.50 0 0\r\n8 1 0 0\r\n9 1 1 0\r\n10 0 1 0\r\n1 3 0 1 2\r\n2 3 0 2 3\r\n";
  EXPECT_EQ(WithUv("a.ply", before, true),
            "ply\r\nformat ascii 1.0\r\ncomment by hand\r\ncomment planish_seam_copies 1\r\n"
            "element camera 1\r\nproperty list uchar float ray\r\n"
            "element vertex 5\r\nproperty uchar red\r\nproperty float x\r\nproperty float y\r\nproperty float z\r\n"
            "property float s\r\nproperty float t\r\n"
            "element face 2\r\nproperty uchar flag\r\nproperty list uchar uchar vertex_index\r\nobj_info x\r\n"
            "end_header\r\n"
            "2 0.10 7e0\n7 0.50 0 0 0 0\n8 1 0 0 1 0\n9 1 1 0 1 1\n10 0 1 0 0 1\n7 0.50 0 0 0 0.5\n"
            "1 3 0 1 2\n2 3 4 2 3\n");
}

TEST(PlyWriter, ReplacesOldUv) {
  const std::string header = "ply\nformat ascii 1.0\nelement vertex 4\nproperty float x\nproperty float y\n";
  const std::string faces = "element face 2\nproperty list uchar int vertex_indices\n";
  const std::string written =
      WithUv("a.ply",
             header + "property double texture_u\nproperty double texture_v\nproperty float z\n" + faces +
                 "end_header\n0 0 .5 .5 0\n1 0 .5 .5 0\n1 1 .5 .5 0\n0 1 .5 .5 0\n3 0 1 2\n3 0 2 3\n",
             false);
  EXPECT_EQ(written, header + "property float z\nproperty float s\nproperty float t\n" + faces +
                         "end_header\n0 0 0 0 0\n1 0 0 1 0\n1 1 0 1 1\n0 1 0 0 1\n3 0 1 2\n3 0 2 3\n");
}

TEST(PlyWriter, RewritesTexcoordsOfFacesWhereTheFileHasThem) {
  const std::string header =
      "ply\nformat ascii 1.0\nelement vertex 4\nproperty float x\nproperty float y\nproperty float z\n"
      "element face 2\nproperty list uchar int vertex_indices\nproperty list uchar float texcoord\n"
      "property int texnumber\nend_header\n0 0 0\n1 0 0\n1 1 0\n0 1 0\n";
  EXPECT_EQ(WithUv("a.ply", header + "3 0 1 2 6 .1 .1 .2 .2 .3 .3 0\n3 0 2 3 0 -1\n", true),
            header + "3 0 1 2 6 0 0 1 0 1 1 0\n3 0 2 3 6 0 0.5 1 1 0 1 -1\n");
}

// A PLY that names images as MeshLab does, written to `name` with (u, v) of its six corners.
WrittenMesh WithImagesAndUv(const std::vector<double>& uv, TextureMode mode, const std::string& name) {
  const std::string ply =
      "ply\r\nformat ascii 1.0\r\ncomment TextureFile my skin.png\r\ncomment by hand\r\ncomment  TextureFile b.png \r\n"
      "comment TextureFiles are odd\r\nelement vertex 4\r\nproperty float x\r\nproperty float y\r\nproperty float z\r\n"
      "element face 2\r\nproperty list uchar int vertex_indices\r\nproperty list uchar float texcoord\r\nend_header\r\n"
      "0 0 0\r\n1 0 0\r\n1 1 0\r\n0 1 0\r\n3 0 1 2 6 0 0 0.1 0 0.1 1\r\n3 0 2 3 6 0 0 0.1 1 0 1\r\n";
  const absl::StatusOr<MeshFile> file = ReadMeshBytes("in.ply", MeshFormat::kPly, ply);
  EXPECT_TRUE(file.ok()) << file.status();
  OutputOptions options;
  options.path = name;
  options.format = *FormatOfPath(name);
  options.textures.mode = mode;
  const absl::StatusOr<WrittenMesh> written = WriteMeshWithUv(*file, uv, options);
  EXPECT_TRUE(written.ok()) << written.status();
  return *written;
}

TEST(PlyWriter, NamesImagesOnlyIfTheUvStay) {
  const std::vector<double> same = {0, 0, 0.1, 0, 0.1, 1, 0, 0, 0.1, 1, 0, 1};
  std::vector<double> moved = same;
  moved[7] = 0.25;
  const auto names = [](const WrittenMesh& written) {
    const std::string& ply = written.files[0].bytes;
    EXPECT_NE(ply.find("comment by hand\r\n"), std::string::npos);
    EXPECT_NE(ply.find("comment TextureFiles are odd\r\n"), std::string::npos);
    const bool first = ply.find("comment TextureFile my skin.png\r\n") != std::string::npos;
    EXPECT_EQ(ply.find("b.png") != std::string::npos, first);
    return first;
  };
  for (const TextureMode mode : {TextureMode::kLeave, TextureMode::kTransfer}) {
    const WrittenMesh kept = WithImagesAndUv(same, mode, "out.ply");
    EXPECT_TRUE(names(kept));
    EXPECT_EQ(kept.warnings.size(), 0u);
  }
  const WrittenMesh dropped = WithImagesAndUv(moved, TextureMode::kTransfer, "out.ply");
  EXPECT_FALSE(names(dropped));
  ASSERT_EQ(dropped.warnings.size(), 1u);
  EXPECT_EQ(dropped.warnings[0].reason, "TEXTURE_DROPPED");
  EXPECT_NE(dropped.warnings[0].message.find("(my skin.png, b.png)"), std::string::npos) << dropped.warnings[0].message;
  const WrittenMesh left = WithImagesAndUv(moved, TextureMode::kLeave, "out.ply");
  EXPECT_TRUE(names(left));
  ASSERT_EQ(left.warnings.size(), 1u);
  EXPECT_EQ(left.warnings[0].reason, "TEXTURE_UV_REPLACED");
  const WrittenMesh asked = WithImagesAndUv(moved, TextureMode::kDrop, "out.ply");
  EXPECT_FALSE(names(asked));
  EXPECT_EQ(asked.warnings.size(), 0u);
  for (const std::string name : {"out.obj", "out.off", "out.glb", "out.drc"}) {
    const WrittenMesh converted = WithImagesAndUv(moved, TextureMode::kTransfer, name);
    ASSERT_EQ(converted.warnings.size(), 1u) << name;
    EXPECT_EQ(converted.warnings[0].reason, "TEXTURE_DROPPED");
    EXPECT_NE(converted.warnings[0].message.find("from PLY"), std::string::npos) << converted.warnings[0].message;
    EXPECT_NE(converted.warnings[0].message.find("my skin.png"), std::string::npos);
    EXPECT_EQ(WithImagesAndUv(moved, TextureMode::kDrop, name).warnings.size(), 0u) << name;
  }
}

TEST(PlyWriter, WidensIndicesThatNoLongerFit) {
  std::string text =
      "ply\nformat ascii 1.0\nelement vertex 127\nproperty float x\nproperty float y\nproperty float z\n"
      "element face 2\nproperty list uchar char vertex_indices\nend_header\n";
  for (int i = 0; i < 127; ++i) text += std::to_string(i) + " " + std::to_string(i * i) + " 0\n";
  text += "3 0 1 2\n3 0 2 126\n";
  EXPECT_NE(WithUv("a.ply", text, false).find("list uchar char"), std::string::npos);
  PutFile(TemporaryPath("b.ply"), text + "");
  // 127 vertices and one copy need the number 127, which a char holds; with two more it does not.
  const auto file = ReadMeshFile(TemporaryPath("b.ply")).value();
  OutputOptions options;
  options.format = MeshFormat::kPly;
  const auto written = WriteMeshWithUv(file, {0, 0, 1, 0, 1, 1, 0, 0.5, 1, 0.5, 0, 1}, options);
  ASSERT_TRUE(written.ok());
  EXPECT_NE(written->files[0].bytes.find("list uchar int"), std::string::npos);
  EXPECT_NE(written->files[0].bytes.find("3 127 128 126"), std::string::npos);
}

TEST(OffWriter, KeepsColoursAndComments) {
  EXPECT_EQ(WithUv("a.off",
                   "# top\nCOFF\n4 2 0 # counts\n0 0 0  255 0 0\n1 0 0 255 0 0 # corner\n1 1 0 0 0 0\n0 1 0 0 0 0\n"
                   "3 0 1 2 0.5\n3 0 2 3 # last\n",
                   true),
            "# top\nSTCOFF\n# planish_seam_copies 1\n5 2 0 # counts\n0 0 0  255 0 0 0 0\n1 0 0 255 0 0 1 0 # corner\n1 "
            "1 0 0 0 0 1 1\n"
            "0 1 0 0 0 0 0 1\n0 0 0 255 0 0 0 0.5\n3 0 1 2 0.5\n3 4 2 3 # last\n");
}

TEST(OffWriter, ReplacesOldUvAndTakesFilesWithoutKeyword) {
  const std::string faces = "3 0 1 2\n3 0 2 3\n";
  EXPECT_EQ(WithUv("a.off", "STOFF 4 2 0\n0 0 0 .5 .5\n1 0 0 .5 .5\n1 1 0 .5 .5\n0 1 0 .5 .5\n" + faces, false),
            "STOFF 4 2 0\n0 0 0 0 0\n1 0 0 1 0\n1 1 0 1 1\n0 1 0 0 1\n" + faces);
  EXPECT_EQ(WithUv("a.off", "4 2 0\n0 0 0\n1 0 0\n1 1 0\n0 1 0\n" + faces, false),
            "STOFF\n4 2 0\n0 0 0 0 0\n1 0 0 1 0\n1 1 0 1 1\n0 1 0 0 1\n" + faces);
}

}  // namespace
}  // namespace planish
