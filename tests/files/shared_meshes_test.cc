// Every file of the shared collection, against the counts in its MANIFEST.tsv.
#include <algorithm>
#include <filesystem>
#include <map>
#include <set>
#include <sstream>

#include "client/files/gltf_mesh.h"
#include "client/files/mesh_output.h"
#include "core/draco/codec.h"
#include "gtest/gtest.h"
#include "tests/files/sample_meshes.h"
#include "tests/testing/files.h"

namespace planish {
namespace {

namespace fs = std::filesystem;

std::vector<TableRow> Manifest(const std::string& extension) {
  std::vector<TableRow> rows = ReadTable(fs::path(PLANISH_SHARED_MESHES) / "MANIFEST.tsv");
  std::erase_if(rows, [&](const TableRow& row) { return fs::path(row.at("file")).extension() != extension; });
  return rows;
}

class SharedMeshes : public ::testing::Test {
 protected:
  void SetUp() override {
    if (!fs::exists(fs::path(PLANISH_SHARED_MESHES) / "MANIFEST.tsv")) {
      GTEST_SKIP() << "no shared meshes at " << PLANISH_SHARED_MESHES;
    }
  }
  static std::string Path(const TableRow& row) { return (fs::path(PLANISH_SHARED_MESHES) / row.at("file")).string(); }
};

TEST_F(SharedMeshes, EveryObjIsReadOrRefused) {
  const std::map<std::string, std::string> refused = {{"malformed.obj", "28"}, {"box_utf16be.obj", "1"}};
  const std::vector<TableRow> rows = Manifest(".obj");
  ASSERT_GE(rows.size(), 60u);
  for (const TableRow& row : rows) {
    const std::string& name = row.at("file");
    SCOPED_TRACE(name);
    const auto file = ReadMeshFile(Path(row));
    if (const auto expected = refused.find(name); expected != refused.end()) {
      ASSERT_FALSE(file.ok());
      EXPECT_EQ(Reason(file.status()), "FILE_MALFORMED");
      EXPECT_NE(std::string(file.status().message()).find(name + ":" + expected->second + ": "), std::string::npos)
          << file.status();
      continue;
    }
    ASSERT_TRUE(file.ok()) << file.status();
    const Triangulation triangles = Triangulate(file->mesh);
    EXPECT_EQ(triangles.mesh.num_faces(), std::stoll(row.at("F")));
    EXPECT_EQ(static_cast<long long>(file->mesh.positions.size()), std::stoll(row.at("V")));
    EXPECT_EQ(triangles.mesh.num_vertices(), std::stoll(row.at("V")) - std::stoll(row.at("unref")));
    const auto polygons = std::count_if(file->mesh.polygon_begin.begin() + 1, file->mesh.polygon_begin.end(),
                                        [&](const std::int64_t& end) { return end - *(&end - 1) > 3; });
    EXPECT_EQ(polygons, std::stoll(row.at("polys")));

    const auto bytes = EncodeDraco(triangles.mesh);
    ASSERT_TRUE(bytes.ok()) << bytes.status();
    const auto decoded = DecodeDraco(*bytes);
    ASSERT_TRUE(decoded.ok()) << decoded.status();
    EXPECT_EQ(decoded->faces, triangles.mesh.faces);
  }
}

// The text without what may change: vt lines and everything behind the first '/' of a corner.
std::string WithoutUv(const std::string& text) {
  std::stringstream lines(text);
  std::string result;
  for (std::string line; std::getline(lines, line);) {
    if (line.starts_with("vt")) continue;
    if (line.starts_with("f ")) {
      for (std::size_t at = line.find('/'); at != std::string::npos; at = line.find('/', at)) {
        std::size_t end = at + 1;
        while (end < line.size() && std::isdigit(static_cast<unsigned char>(line[end])) != 0) ++end;
        line.erase(at, end - at);
        // What is left begins with the '/' of a normal, or with a blank.
        while (at < line.size() && line[at] == '/') ++at;
      }
    }
    result += line + "\n";
  }
  return result;
}

TEST_F(SharedMeshes, EveryObjGoesThroughByteFaithfully) {
  for (const TableRow& row : Manifest(".obj")) {
    SCOPED_TRACE(row.at("file"));
    auto file = ReadMeshFile(Path(row));
    if (!file.ok()) continue;
    std::vector<double> uv;
    for (std::size_t c = 0; c < file->mesh.corner_vertex.size(); ++c) {
      uv.push_back(static_cast<double>(c % 1024) / 1024);
      uv.push_back(static_cast<double>(file->mesh.corner_vertex[c] % 1024) / 1024);
    }
    const std::string written = WriteObjWithUv(*file, uv, true);
    EXPECT_EQ(WithoutUv(written) == WithoutUv(file->bytes), true);

    const MeshFile again = ReadObjText(written);
    EXPECT_EQ(again.mesh.corner_vertex, file->mesh.corner_vertex);
    EXPECT_EQ(again.mesh.polygon_begin, file->mesh.polygon_begin);
    EXPECT_EQ(WriteObjWithUv(again, uv, true) == written, true) << "writing is not idempotent";
  }
}

TEST_F(SharedMeshes, EveryDracoFileIsDecodedOrRefused) {
  const std::set<std::string> clouds = {"cube_pc.drc", "pc_kd_color.drc"};
  const std::vector<TableRow> rows = Manifest(".drc");
  ASSERT_GE(rows.size(), 14u);
  for (const TableRow& row : rows) {
    const std::string& name = row.at("file");
    SCOPED_TRACE(name);
    const auto mesh = DecodeDraco(ReadFile(Path(row)));
    if (clouds.count(name) != 0) {
      EXPECT_EQ(Reason(mesh.status()), "MESH_NOT_A_MESH");
      continue;
    }
    ASSERT_TRUE(mesh.ok()) << mesh.status();
    EXPECT_EQ(mesh->num_faces(), std::stoll(row.at("F")));
    std::int64_t vertices = std::stoll(row.at("V"));
    // Sequential with normals and UV: its 936 repeated positions are UV and normal seams, not cuts.
    if (name == "car_1744.drc") vertices -= std::stoll(row.at("dup_verts"));
    EXPECT_EQ(mesh->num_vertices(), vertices);
  }
}

std::vector<double> UvOfTriangles(const PolygonMesh& mesh) {
  std::vector<double> uv;
  for (std::int64_t c = 0; c < static_cast<std::int64_t>(mesh.corner_vertex.size()); ++c) {
    uv.push_back(static_cast<double>(c / 3 % 256) / 256 + (c % 3 == 1 ? 0x1p-10 : 0));
    uv.push_back(static_cast<double>(c / 768) / 256 + (c % 3 == 2 ? 0x1p-10 : 0));
  }
  return uv;
}

// Writes with UV of single triangles and reads again; positions and UV of all corners must be there, in order.
MeshFile ThereAndBack(const MeshFile& file, const std::string& name) {
  const std::vector<double> uv = UvOfTriangles(file.mesh);
  OutputOptions options;
  options.path = TemporaryPath(name);
  options.format = FormatOfPath(name).value();
  const auto written = WriteMeshWithUv(file, uv, options);
  EXPECT_TRUE(written.ok()) << written.status();
  if (!written.ok()) return MeshFile();
  for (const OutputFile& output : written->files) PutFile(output.path, output.bytes);
  auto again = ReadMeshFile(options.path);
  EXPECT_TRUE(again.ok()) << again.status();
  if (!again.ok()) return MeshFile();
  EXPECT_EQ(again->mesh.num_polygons(), file.mesh.num_polygons());
  bool same = again->mesh.corner_vertex.size() == file.mesh.corner_vertex.size();
  for (std::size_t c = 0; same && c < file.mesh.corner_vertex.size(); ++c) {
    same = again->mesh.positions[again->mesh.corner_vertex[c]] == file.mesh.positions[file.mesh.corner_vertex[c]] &&
           again->mesh.texcoords[again->mesh.corner_texcoord[c]] == Vec2(uv[2 * c], uv[2 * c + 1]);
  }
  EXPECT_TRUE(same) << name;
  return *std::move(again);
}

// The number that a compressed primitive's tangents have in the Draco data of a pool; -1: none.
std::int64_t DracoTangents(const GltfMesh& gltf, std::size_t pool) {
  for (const GltfPrimitive& primitive : gltf.primitives) {
    if (primitive.pool != pool) continue;
    const Json* const draco = DracoJson(PrimitiveJson(gltf.document.json, primitive));
    if (draco != nullptr && (*draco)["attributes"].contains("TANGENT")) {
      return (*draco)["attributes"]["TANGENT"].get<std::int64_t>();
    }
  }
  return -1;
}

// Every attribute but UV, and `tangents` that belonged to them, as the corners of the faces see it, to the bit.
void ExpectSameAttributes(const DracoPoints& before, const DracoPoints& after, std::int64_t tangents = -1) {
  ASSERT_EQ(after.faces.size(), before.faces.size());
  for (const DracoAttribute& old : before.attributes) {
    if (old.kind == DracoKind::kTexcoord || std::int64_t{old.unique_id} == tangents) continue;
    const auto found = std::find_if(after.attributes.begin(), after.attributes.end(),
                                    [&](const DracoAttribute& a) { return a.unique_id == old.unique_id; });
    ASSERT_NE(found, after.attributes.end());
    EXPECT_EQ(found->kind, old.kind);
    EXPECT_EQ(found->component, old.component);
    EXPECT_EQ(found->normalized, old.normalized);
    bool same = found->value_size == old.value_size;
    for (std::size_t f = 0; same && f < before.faces.size(); ++f) {
      for (std::size_t k = 0; k < 3; ++k) {
        same &= found->values.compare(static_cast<std::size_t>(found->value_size * after.faces[f][k]),
                                      static_cast<std::size_t>(old.value_size), old.values,
                                      static_cast<std::size_t>(old.value_size * before.faces[f][k]),
                                      static_cast<std::size_t>(old.value_size)) == 0;
      }
    }
    EXPECT_TRUE(same) << "attribute " << old.unique_id;
  }
}

TEST_F(SharedMeshes, EveryDracoFileIsWrittenAgain) {
  int written = 0;
  for (const TableRow& row : Manifest(".drc")) {
    SCOPED_TRACE(row.at("file"));
    const auto file = ReadMeshFile(Path(row));
    if (!file.ok()) {
      EXPECT_NE(std::string(file.status().message()).find("point cloud"), std::string::npos) << file.status();
      continue;
    }
    EXPECT_EQ(file->mesh.corner_texcoord.empty(), row.at("vt") == "0");
    const MeshFile again = ThereAndBack(*file, "out.drc");
    ExpectSameAttributes(DecodeDracoPoints(file->bytes, false).value(), DecodeDracoPoints(again.bytes, false).value());
    ThereAndBack(*file, "out.glb");
    ++written;
  }
  EXPECT_GE(written, 12);
}

TEST_F(SharedMeshes, EveryGltfIsWrittenAgain) {
  std::vector<TableRow> rows = Manifest(".glb");
  for (const TableRow& row : Manifest(".gltf")) rows.push_back(row);
  ASSERT_GE(rows.size(), 5u);
  for (const TableRow& row : rows) {
    SCOPED_TRACE(row.at("file"));
    const auto file = ReadMeshFile(Path(row));
    ASSERT_TRUE(file.ok()) << file.status();
    if (row.at("note").find("figures of the largest") != std::string::npos) {
      EXPECT_GE(file->mesh.num_polygons(), std::stoll(row.at("F")));
    } else {
      EXPECT_EQ(file->mesh.num_polygons(), std::stoll(row.at("F")));
    }
    const Json& before = file->gltf->document.json;
    for (const char* name : {"out.glb", "out.gltf"}) {
      const MeshFile again = ThereAndBack(*file, name);
      const Json& after = again.gltf->document.json;
      for (const auto& [key, value] : before.items()) {
        // References to images are told from where the new file is.
        const bool may_change = key == "meshes" || key == "accessors" || key == "bufferViews" || key == "buffers" ||
                                (key == "images" && value.dump().find("uri") != std::string::npos);
        EXPECT_TRUE(may_change || after[key] == value) << key;
      }
      ASSERT_EQ(again.gltf->pools.size(), file->gltf->pools.size());
      for (std::size_t pool = 0; pool < file->gltf->pools.size(); ++pool) {
        ASSERT_EQ(again.gltf->pools[pool].draco.has_value(), file->gltf->pools[pool].draco.has_value());
        if (!file->gltf->pools[pool].draco) continue;
        ExpectSameAttributes(*file->gltf->pools[pool].draco, *again.gltf->pools[pool].draco,
                             DracoTangents(*file->gltf, pool));
        EXPECT_EQ(DracoTangents(*again.gltf, pool), -1);
      }
    }
  }
}

}  // namespace
}  // namespace planish
