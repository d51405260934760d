// What we write, as Blender reads it: one start of Blender for all files. Skipped where there is none.
#include <array>
#include <cstdio>
#include <cstdlib>

#include "client/files/mesh_output.h"
#include "gtest/gtest.h"
#include "nlohmann/json.hpp"
#include "tests/files/gltf_fixture.h"
#include "tests/files/sample_meshes.h"
#include "tests/testing/process.h"

namespace planish {
namespace {

using Json = nlohmann::ordered_json;

// Every edge a seam; positive area; different for every corner.
std::vector<double> SomeUv(const PolygonMesh& mesh) {
  std::vector<double> uv;
  for (std::int64_t p = 0; p < mesh.num_polygons(); ++p) {
    for (std::int64_t k = 0; k < mesh.polygon_begin[p + 1] - mesh.polygon_begin[p]; ++k) {
      uv.push_back(static_cast<double>(p) / 32 + (k == 1 || k == 2 ? 0x1p-6 : 0.0));
      uv.push_back(k >= 2 ? 0x1p-6 : 0.0);
    }
  }
  return uv;
}

class Checklist {
 public:
  // Writes `file` as `name`, to be compared with its polygons; `like`: with another file as well.
  void Add(const MeshFile& file, const std::string& name, bool as_triangles, const std::string& like) {
    const std::vector<double> uv = SomeUv(file.mesh);
    OutputOptions options;
    options.path = TemporaryPath(name);
    options.format = FormatOfPath(name).value();
    const auto written = WriteMeshWithUv(file, uv, options);
    ASSERT_TRUE(written.ok()) << written.status();
    for (const OutputFile& output : written->files) PutFile(output.path, output.bytes);
    Json faces = Json::array();
    const auto corner = [&](std::int64_t c) {
      const Vec3& p = file.mesh.positions[file.mesh.corner_vertex[c]];
      return Json::array({p.x(), p.y(), p.z(), uv[2 * c], uv[2 * c + 1]});
    };
    if (as_triangles) {
      const Triangulation triangles = Triangulate(file.mesh);
      for (std::size_t i = 0; i < triangles.corner_of_triangle.size(); i += 3) {
        const auto& c = triangles.corner_of_triangle;
        faces.push_back({corner(c[i]), corner(c[i + 1]), corner(c[i + 2])});
      }
    } else {
      for (std::int64_t p = 0; p < file.mesh.num_polygons(); ++p) {
        Json face = Json::array();
        for (std::int64_t c = file.mesh.polygon_begin[p]; c < file.mesh.polygon_begin[p + 1]; ++c) {
          face.push_back(corner(c));
        }
        faces.push_back(face);
      }
    }
    entries_.push_back({{"file", options.path}, {"faces", faces}, {"like", like}});
  }

  std::string Check() const {
    const std::string list = TemporaryPath("expected.json");
    PutFile(list, entries_.dump());
    return RunShell(std::string("blender --background --factory-startup --python-exit-code 1 --python '") +
                    PLANISH_SOURCE_TREE "/tests/files/blender_check.py" + "' -- '" + list + "' 2>&1")
        .out;
  }

 private:
  Json entries_ = Json::array();
};

TEST(Blender, ReadsWhatWeWrite) {
  if (RunShell("command -v blender").out.empty()) GTEST_SKIP() << "no blender in PATH";
  Checklist list;
  GltfFixture fixture = SampleGltf();
  // Blender knows neither quantized positions nor extensions that nobody has heard of, takes the weights of what has
  // none for NaN, and makes two meshes of one that is shown with a skin and without: the strip and the line get their
  // own.
  Json strip = fixture.json["meshes"][0];
  strip["name"] = "strip";
  strip["primitives"] = {strip["primitives"][2], strip["primitives"][3]};
  fixture.json["meshes"][0]["primitives"].erase(3);
  fixture.json["meshes"][0]["primitives"].erase(2);
  fixture.json["meshes"][1] = strip;
  fixture.json["nodes"][1]["mesh"] = 1;
  fixture.json["nodes"].erase(4);
  fixture.json["scenes"][0]["nodes"] = {0, 1, 2};
  fixture.json.erase("extensionsRequired");
  const std::string original = TemporaryPath("original.glb");
  PutFile(original, fixture.Glb());
  const MeshFile glb = ReadMeshFile(original).value();
  list.Add(glb, "kept.glb", true, original);
  list.Add(glb, "kept.gltf", true, original);
  list.Add(glb, "from_glb.ply", true, "");
  list.Add(glb, "from_glb.obj", true, "");

  const std::string obj = TemporaryPath("original.obj");
  PutFile(obj,
          "v 0 0 0\nv 1 0 0\nv 1 1 0\nv 0 1 0\nv 2 0 0.5\nv 2 1 0.5\no first\nusemtl red\nf 1 2 3 4\n"
          "o second\nusemtl blue\nf 2 5 3\nf 5 6 3\n");
  const MeshFile polygons = ReadMeshFile(obj).value();
  list.Add(polygons, "kept.obj", false, "");
  list.Add(polygons, "from_obj.ply", false, "");
  list.Add(polygons, "from_obj.glb", true, "");
  PutFile(TemporaryPath("original.ply"), SamplePlyAscii());
  list.Add(ReadMeshFile(TemporaryPath("original.ply")).value(), "kept.ply", false, "");

  const std::string said = list.Check();
  if (said.find("BLENDER_CHECK no numpy") != std::string::npos) {
    GTEST_SKIP() << "Blender's glTF importer needs numpy (python3-numpy)";
  }
  EXPECT_NE(said.find("BLENDER_CHECK ok"), std::string::npos)
      << said.substr(said.size() - std::min<std::size_t>(said.size(), 3000));
}

}  // namespace
}  // namespace planish
