// Every format into every format that holds UV, read back.
#include "client/files/mesh_output.h"

#include <filesystem>
#include <set>

#include "client/files/gltf_mesh.h"
#include "gmock/gmock.h"
#include "gtest/gtest.h"
#include "tests/files/gltf_fixture.h"
#include "tests/files/sample_meshes.h"

namespace planish {
namespace {

namespace fs = std::filesystem;

using ::testing::ElementsAre;
using ::testing::Field;

// Each polygon on its own, so that every edge is a seam; exact in float, and 1 - v as well.
std::vector<double> PolygonUv(const PolygonMesh& mesh) {
  std::vector<double> uv;
  for (std::int64_t p = 0; p < mesh.num_polygons(); ++p) {
    const std::int64_t n = mesh.polygon_begin[p + 1] - mesh.polygon_begin[p];
    for (std::int64_t k = 0; k < n; ++k) {
      uv.push_back(static_cast<double>(p % 1024) / 1024 + (k > 0 && k < 2 ? 0x1p-11 : 0.0));
      uv.push_back(static_cast<double>(p / 1024) / 1024 + (k > 1 ? 0x1p-11 : 0.0) + 0x1p-20 * static_cast<double>(k));
    }
  }
  return uv;
}

std::vector<Vec3> CornerPositions(const PolygonMesh& mesh) {
  std::vector<Vec3> positions;
  for (const std::int32_t vertex : mesh.corner_vertex) positions.push_back(mesh.positions[vertex]);
  return positions;
}

std::vector<double> CornerUv(const PolygonMesh& mesh) {
  std::vector<double> uv;
  for (const std::int32_t id : mesh.corner_texcoord) {
    uv.push_back(id < 0 ? -1 : mesh.texcoords[id].x());
    uv.push_back(id < 0 ? -1 : mesh.texcoords[id].y());
  }
  return uv;
}

// Text holds the fewest digits that give back a float, which read as a double are another number.
std::vector<float> AsFloat(const std::vector<double>& values) {
  return std::vector<float>(values.begin(), values.end());
}

// Writes `file` with `uv` in the format of `name` and reads that.
absl::StatusOr<MeshFile> RoundTrip(const MeshFile& file, const std::vector<double>& uv, const std::string& name,
                                   int texcoord = 0) {
  OutputOptions options;
  options.path = TemporaryPath(name);
  options.format = FormatOfPath(name).value();
  options.texcoord = texcoord;
  const auto written = WriteMeshWithUv(file, uv, options);
  if (!written.ok()) return written.status();
  EXPECT_TRUE(written->warnings.empty()) << written->warnings.front().message;
  for (const OutputFile& output : written->files) PutFile(output.path, output.bytes);
  EXPECT_EQ(written->files.back().path, options.path);
  return ReadMeshFile(options.path, {texcoord});
}

// A quad, a triangle and a concave pentagon, in two groups and two materials, with UV on some corners only.
constexpr char kObj[] =
    "v 0 0 0\nv 1 0 0\nv 1 1 0\nv 0 1 0\nv 2 0 0.5\nv 2 1 0.5\nv 1.25 0.5 0.125\nvt 0.5 0.25\nvt 0.25 0.5\nvt 0.5 "
    "0.25\n"
    "o first\nusemtl red paint\nf 1/1 2/2 3/3 4\no second\nf 2 5 3\nusemtl blue\nf 5 6 3 7 2\n";

MeshFile Sample(const std::string& name) {
  PutFile(TemporaryPath("sample.obj"), kObj);
  const MeshFile obj = ReadMeshFile(TemporaryPath("sample.obj")).value();
  if (FormatOfPath(name) == MeshFormat::kObj) return obj;
  if (FormatOfPath(name) == MeshFormat::kStl) {
    PutFile(TemporaryPath("sample.stl"), SampleStlBinary());
    return ReadMeshFile(TemporaryPath("sample.stl")).value();
  }
  return RoundTrip(obj, PolygonUv(obj.mesh), "sample_" + name).value();
}

TEST(ObjUv, IsReadWithMaterialsAndGroups) {
  const PolygonMesh mesh = Sample("a.obj").mesh;
  EXPECT_EQ(mesh.corner_texcoord, (std::vector<std::int32_t>{0, 1, 0, -1, -1, -1, -1, -1, -1, -1, -1, -1}));
  EXPECT_EQ(mesh.texcoords, (std::vector<Vec2>{{0.5, 0.25}, {0.25, 0.5}}));
  EXPECT_EQ(mesh.polygon_material, (std::vector<std::int32_t>{0, 0, 1}));
  EXPECT_EQ(mesh.material_names, (std::vector<std::string>{"red paint", "blue"}));
  EXPECT_EQ(mesh.polygon_group, (std::vector<std::int32_t>{0, 1, 1}));
  EXPECT_EQ(mesh.group_names, (std::vector<std::string>{"first", "second"}));
}

class EveryPair : public ::testing::TestWithParam<std::tuple<const char*, const char*>> {};

TEST_P(EveryPair, KeepsPositionsAndUv) {
  const auto [from, to] = GetParam();
  const MeshFile file = Sample(std::string("pair.") + from);
  const std::vector<double> uv = PolygonUv(file.mesh);
  const auto again = RoundTrip(file, uv, std::string("out_") + from + "." + to);
  ASSERT_TRUE(again.ok()) << again.status();
  const bool to_triangles = IsFloatByNature(again->format);
  if (!to_triangles) {
    EXPECT_EQ(again->mesh.polygon_begin, file.mesh.polygon_begin);
    EXPECT_EQ(CornerPositions(again->mesh), CornerPositions(file.mesh));
    EXPECT_EQ(AsFloat(CornerUv(again->mesh)), AsFloat(uv));
    return;
  }
  // Primitives may have other orders than the file: compare as sets.
  const auto corners = [](const PolygonMesh& mesh, const std::vector<double>& corner_uv) {
    std::multiset<std::vector<float>> found;
    const Triangulation triangles = Triangulate(mesh);
    for (std::size_t f = 0; f < triangles.mesh.faces.size(); ++f) {
      std::vector<float> face;
      for (std::size_t k = 0; k < 3; ++k) {
        const std::int64_t c = triangles.corner_of_triangle[3 * f + k];
        const Vec3& p = mesh.positions[mesh.corner_vertex[c]];
        for (const double value : {p.x(), p.y(), p.z(), corner_uv[2 * c], corner_uv[2 * c + 1]}) {
          face.push_back(static_cast<float>(value));
        }
      }
      found.insert(face);
    }
    return found;
  };
  EXPECT_EQ(corners(again->mesh, CornerUv(again->mesh)), corners(file.mesh, uv));
}

INSTANTIATE_TEST_SUITE_P(All, EveryPair,
                         ::testing::Combine(::testing::Values("obj", "ply", "off", "stl", "gltf", "glb", "drc"),
                                            ::testing::Values("obj", "ply", "off", "gltf", "glb", "drc")),
                         [](const auto& pair) {
                           return std::string(std::get<0>(pair.param)) + "_to_" + std::get<1>(pair.param);
                         });

TEST(Output, MaterialsAndGroupsGoFromObjToGltfAndBack) {
  const MeshFile obj = Sample("a.obj");
  const MeshFile glb = RoundTrip(obj, PolygonUv(obj.mesh), "groups.glb").value();
  EXPECT_EQ(glb.mesh.material_names, obj.mesh.material_names);
  EXPECT_EQ(glb.mesh.group_names, obj.mesh.group_names);
  const MeshFile back = RoundTrip(glb, CornerUv(glb.mesh), "groups.obj").value();
  EXPECT_EQ(back.mesh.material_names, obj.mesh.material_names);
  EXPECT_EQ(back.mesh.group_names, obj.mesh.group_names);
  EXPECT_EQ(back.mesh.polygon_material, glb.mesh.polygon_material);
}

// Primitives of a model have different numbers of sets: in the samples none, or one; the second sample has Draco.
TEST(Output, SetsOfUvThatPrimitivesLackAreFilledOnRequest) {
  for (const GltfFixture& fixture : {SampleGltf(), SampleDracoGltf()}) {
    const auto read = [](const std::string& glb, int texcoord) {
      return ReadMeshBytes("in.glb", MeshFormat::kGlb, glb, {texcoord}).value();
    };
    const MeshFile file = read(fixture.Glb(), 0);
    const std::vector<double> uv = PolygonUv(file.mesh);
    OutputOptions options;
    options.path = TemporaryPath("filled.glb");
    options.format = MeshFormat::kGlb;
    options.texcoord = 2;
    EXPECT_EQ(Reason(CheckOutput(file, options)), "OUTPUT_UNSUPPORTED");
    options.fills_texcoords = true;
    EXPECT_EQ(Reason(CheckOutput(file, options)), "");
    const auto written = WriteMeshWithUv(file, uv, options);
    ASSERT_TRUE(written.ok()) << written.status();
    EXPECT_THAT(written->warnings, ElementsAre(Field(&OutputWarning::reason, "TEXCOORDS_FILLED")));
    for (int n = 0; n <= 2; ++n) {
      const MeshFile again = read(written->files.back().bytes, n);
      std::vector<double> expected = uv;
      const std::vector<double> old = n == 0 ? CornerUv(file.mesh) : std::vector<double>();
      for (std::size_t i = 0; i < old.size(); ++i) {
        if (old[i - i % 2] >= 0) expected[i] = old[i];
      }
      EXPECT_EQ(CornerUv(again.mesh), expected) << n;
    }
  }
}

// glTF has floats: nodes take the mesh to where it belongs. Draco has nothing of the kind.
TEST(Output, PositionsFarFromTheOriginSurviveOrAreWarnedOf) {
  const MeshFile file = ReadObjText("v 20000.0001 0 0\nv 20000.0012 0 0\nv 20000.0012 0.0011 0\nf 1 2 3\n");
  const std::vector<double> uv = {0, 0, 1, 0, 1, 1};
  OutputOptions options;
  options.path = TemporaryPath("far.gltf");
  options.format = MeshFormat::kGltf;
  const auto gltf = WriteMeshWithUv(file, uv, options);
  ASSERT_TRUE(gltf.ok()) << gltf.status();
  EXPECT_TRUE(gltf->warnings.empty());
  for (const OutputFile& output : gltf->files) PutFile(output.path, output.bytes);
  const MeshFile again = ReadMeshFile(options.path).value();
  const Json& translation = again.gltf->document.json["nodes"][0]["translation"];
  for (std::size_t v = 0; v < 3; ++v) {
    for (int axis = 0; axis < 3; ++axis) {
      const double place = again.mesh.positions[v][axis] + translation[static_cast<std::size_t>(axis)].get<double>();
      EXPECT_NEAR(place, file.mesh.positions[v][axis], 1e-9) << v << " " << axis;
    }
  }
  options.path = TemporaryPath("far.drc");
  options.format = MeshFormat::kDraco;
  const auto draco = WriteMeshWithUv(file, uv, options);
  ASSERT_TRUE(draco.ok()) << draco.status();
  ASSERT_EQ(draco->warnings.size(), 1u);
  EXPECT_EQ(draco->warnings[0].reason, "POSITION_PRECISION");
}

TEST(Output, StlIsRefusedWithAWayOut) {
  OutputOptions options;
  options.path = "a.stl";
  options.format = MeshFormat::kStl;
  const absl::Status status = CheckOutput(Sample("a.obj"), options);
  EXPECT_EQ(Reason(status), "OUTPUT_UNSUPPORTED");
  EXPECT_NE(status.message().find(".glb"), absl::string_view::npos);
}

TEST(Output, DoubleUvAreRefusedWhereTheyDoNotFit) {
  const MeshFile file = Sample("a.obj");
  OutputOptions options;
  options.uv_is_float = false;
  for (const char* name : {"a.glb", "a.gltf", "a.drc"}) {
    options.path = name;
    options.format = FormatOfPath(name).value();
    EXPECT_EQ(Reason(WriteMeshWithUv(file, PolygonUv(file.mesh), options).status()), "UV_PRECISION") << name;
  }
  for (const char* name : {"a.ply", "a.off"}) {
    options.path = TemporaryPath(name);
    options.format = FormatOfPath(name).value();
    std::vector<double> uv = PolygonUv(file.mesh);
    for (double& value : uv) value += 0x1p-40;
    const auto written = WriteMeshWithUv(file, uv, options);
    ASSERT_TRUE(written.ok()) << written.status();
    PutFile(options.path, written->files[0].bytes);
    EXPECT_EQ(CornerUv(ReadMeshFile(options.path).value().mesh), uv) << name;
  }
}

TEST(Output, VThatDoesNotSurviveTheFlipIsWarnedOf) {
  const MeshFile file = Sample("pair.stl");
  std::vector<double> uv = PolygonUv(file.mesh);
  // Thin beyond what floats near 1 can tell.
  for (std::size_t i = 0; i < 6; ++i) uv[i] = std::vector<double>{0, 0, 0.5, 0, 0, 0x1p-40}[i];
  OutputOptions options;
  options.path = "a.glb";
  options.format = MeshFormat::kGlb;
  const auto written = WriteMeshWithUv(file, uv, options);
  ASSERT_TRUE(written.ok());
  ASSERT_EQ(written->warnings.size(), 1u);
  EXPECT_EQ(written->warnings[0].message.substr(0, 11), "1 triangles");
}

}  // namespace
}  // namespace planish
