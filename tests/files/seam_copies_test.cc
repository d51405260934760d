// PLY and OFF have one UV per vertex, so that seams split vertices: readers find the surface again that was written.
#include "client/files/mesh_output.h"
#include "gmock/gmock.h"
#include "gtest/gtest.h"
#include "tests/files/sample_meshes.h"

namespace planish {
namespace {

using ::testing::HasSubstr;
using ::testing::Not;

// Two quads with an edge in common, and a third one at the place of the first with vertices of its own.
constexpr char kPly[] =
    "ply\nformat ascii 1.0\ncomment by hand\nelement vertex 10\nproperty float x\nproperty float y\nproperty float z\n"
    "property uchar red\nelement face 3\nproperty list uchar int vertex_indices\nend_header\n"
    "0 0 0 1\n1 0 0 2\n1 1 0 3\n0 1 0 4\n2 0 0 5\n2 1 0 6\n0 0 0 7\n1 0 0 8\n1 1 0 9\n0 1 0 10\n"
    "4 0 1 2 3\n4 1 4 5 2\n4 9 8 7 6\n";
constexpr char kOff[] =
    "COFF 10 3 0 # by hand\n0 0 0 1 0 0\n1 0 0 2 0 0\n1 1 0 3 0 0\n0 1 0 4 0 0\n2 0 0 5 0 0\n2 1 0 6 0 0\n0 0 0 7 0 0\n"
    "1 0 0 8 0 0\n1 1 0 9 0 0\n0 1 0 10 0 0\n4 0 1 2 3\n4 1 4 5 2\n4 9 8 7 6\n";

// UV of one column a polygon, so that each edge between polygons is a seam; or of the positions, without any seam
// between the first two.
std::vector<double> UvFor(const PolygonMesh& mesh, bool has_seams) {
  std::vector<double> uv;
  for (std::int64_t p = 0; p < mesh.num_polygons(); ++p) {
    for (std::int64_t c = mesh.polygon_begin[p]; c < mesh.polygon_begin[p + 1]; ++c) {
      const Vec3& position = mesh.positions[mesh.corner_vertex[c]];
      const double column = has_seams ? 4.0 * static_cast<double>(p) : p == 2 ? 4.0 : 0.0;
      uv.insert(uv.end(), {(column + position.x()) / 16, position.y() / 16});
    }
  }
  return uv;
}

MeshFile Read(const std::string& name, const std::string& bytes) {
  PutFile(TemporaryPath(name), bytes);
  absl::StatusOr<MeshFile> file = ReadMeshFile(TemporaryPath(name));
  EXPECT_TRUE(file.ok()) << file.status();
  return file.ok() ? *std::move(file) : MeshFile();
}

std::string Written(const MeshFile& file, const std::vector<double>& uv, MeshFormat format) {
  OutputOptions options;
  options.format = format;
  const auto written = WriteMeshWithUv(file, uv, options);
  EXPECT_TRUE(written.ok()) << written.status();
  return written.ok() ? written->files[0].bytes : "";
}

class SeamCopies : public ::testing::TestWithParam<MeshFormat> {
 protected:
  MeshFormat format() const { return GetParam(); }
  std::string name() const { return format() == MeshFormat::kPly ? "a.ply" : "a.off"; }
  MeshFile Source() const { return Read(name(), format() == MeshFormat::kPly ? kPly : kOff); }
};

TEST_P(SeamCopies, SurfaceComesBackAsItWas) {
  const MeshFile source = Source();
  const std::vector<double> uv = UvFor(source.mesh, true);
  const std::string written = Written(source, uv, format());
  const MeshFile again = Read(name(), written);
  EXPECT_EQ(again.mesh.corner_vertex, source.mesh.corner_vertex);
  EXPECT_EQ(again.mesh.positions, source.mesh.positions);
  EXPECT_EQ(again.mesh.corner_file_vertex, source.mesh.corner_file_vertex);
  EXPECT_EQ(again.mesh.polygon_line.size(), source.mesh.polygon_line.size());
  EXPECT_EQ(Written(again, uv, format()), written) << "nothing grows, nothing is lost";
  // With fewer seams copies go again.
  const std::vector<double> other = UvFor(source.mesh, false);
  EXPECT_EQ(Written(again, other, format()), Written(source, other, format()));
  // Other formats get the surface, too.
  for (const char* to : {"to.obj", "to.ply", "to.off"}) {
    OutputOptions options;
    options.format = *FormatOfPath(to);
    const auto plain = WriteMeshWithUv(again, uv, options);
    ASSERT_TRUE(plain.ok());
    EXPECT_EQ(Read(to, plain->files[0].bytes).mesh.corner_vertex, source.mesh.corner_vertex) << to;
  }
}

// As Blender and others write it: nothing tells which vertices were one.
TEST_P(SeamCopies, VerticesAtOnePlaceAreOneWhereAFileOfOthersHasUv) {
  const MeshFile source = Source();
  std::string bytes = Written(source, UvFor(source.mesh, true), format());
  for (std::size_t at; (at = bytes.find("planish_")) != std::string::npos;) bytes.replace(at, 8, "by-hand-");
  const MeshFile file = Read(name(), bytes);
  EXPECT_EQ(file.mesh.corner_vertex, (std::vector<std::int32_t>{0, 1, 2, 3, 1, 4, 5, 2, 3, 2, 1, 0}));
  EXPECT_EQ(file.mesh.positions.size(), 12u);
  ASSERT_EQ(file.mesh.corner_file_vertex.size(), 12u);
  EXPECT_EQ(file.mesh.corner_file_vertex[8], 9) << "what else the vertex has stays";
  // Written and read again it is the same surface.
  const std::vector<double> uv = UvFor(file.mesh, true);
  const std::string written = Written(file, uv, format());
  const MeshFile again = Read(name(), written);
  EXPECT_EQ(again.mesh.corner_vertex, file.mesh.corner_vertex);
  EXPECT_EQ(again.mesh.corner_file_vertex, file.mesh.corner_file_vertex);
  EXPECT_EQ(Written(again, uv, format()), written);
}

TEST_P(SeamCopies, MarksThatDoNotFitAreNotBelieved) {
  const MeshFile source = Source();
  const std::string bytes = Written(source, UvFor(source.mesh, true), format());
  ASSERT_THAT(bytes, HasSubstr("planish_seam_copies 2\n"));
  ASSERT_THAT(bytes, HasSubstr("planish_copy_of 1 2\n"));
  const std::vector<std::int32_t> joined = {0, 1, 2, 3, 1, 4, 5, 2, 3, 2, 1, 0};
  for (const auto& [from, to] :
       std::vector<std::pair<std::string, std::string>>{{"planish_seam_copies 2", "planish_seam_copies 12"},
                                                        {"planish_seam_copies 2", "planish_seam_copies -1"},
                                                        {"planish_seam_copies 2", "planish_seam_copies x"},
                                                        {"planish_seam_copies 2", "planish_seam_copies"},
                                                        {"planish_copy_of 1 2", "planish_copy_of 1"},
                                                        {"planish_copy_of 1 2", "planish_copy_of 1 2 2"},
                                                        {"planish_copy_of 1 2", "planish_copy_of 1 3"},
                                                        {"planish_copy_of 1 2", "planish_copy_of 1 99999999999"}}) {
    std::string damaged = bytes;
    damaged.replace(damaged.find(from), from.size(), to);
    EXPECT_EQ(Read(name(), damaged).mesh.corner_vertex, joined) << to;
  }
}

TEST_P(SeamCopies, NothingIsToldWhereNothingIsSplit) {
  std::string text = "OFF\n4 1 0\n0 0 0\n1 0 0\n1 1 0\n0 1 0\n4 0 1 2 3\n";
  const MeshFile file = Read("b.off", text);
  EXPECT_THAT(Written(file, UvFor(file.mesh, true), format()), Not(HasSubstr("planish_")));
}

INSTANTIATE_TEST_SUITE_P(Formats, SeamCopies, ::testing::Values(MeshFormat::kPly, MeshFormat::kOff),
                         [](const auto& format) { return format.param == MeshFormat::kPly ? "Ply" : "Off"; });

}  // namespace
}  // namespace planish
