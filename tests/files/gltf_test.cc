// glTF in and out: what is read, what is kept, what is refused.
#include <meshoptimizer.h>

#include <cstring>
#include <filesystem>
#include <functional>

#include "Eigen/Geometry"
#include "client/files/gltf_mesh.h"
#include "client/files/mesh_output.h"
#include "client/texture/image.h"
#include "gmock/gmock.h"
#include "gtest/gtest.h"
#include "tests/files/gltf_fixture.h"
#include "tests/files/sample_meshes.h"

namespace planish {
namespace {

using ::testing::AllOf;
using ::testing::HasSubstr;

MeshFile ReadBytes(const std::string& name, const std::string& bytes, int texcoord = 0) {
  PutFile(TemporaryPath(name), bytes);
  absl::StatusOr<MeshFile> file = ReadMeshFile(TemporaryPath(name), {texcoord});
  EXPECT_TRUE(file.ok()) << file.status();
  return file.ok() ? *std::move(file) : MeshFile();
}

std::vector<double> TriangleUv(std::size_t corners) {
  std::vector<double> uv;
  for (std::size_t c = 0; c < corners; ++c) {
    uv.push_back(static_cast<double>(c / 3) / 64 + (c % 3 == 1 ? 0x1p-8 : 0));
    uv.push_back(c % 3 == 2 ? 0x1p-8 : 0);
  }
  return uv;
}

// One UV per vertex of the file: nothing has to be split.
std::vector<double> SmoothUv(const PolygonMesh& mesh) {
  std::vector<double> uv;
  for (const std::int32_t vertex : mesh.corner_vertex) {
    uv.push_back(mesh.positions[vertex].x() / 16);
    uv.push_back((mesh.positions[vertex].y() + 2) / 16);
  }
  return uv;
}

MeshFile Written(const MeshFile& file, const std::vector<double>& uv, const std::string& name, int texcoord = 0) {
  OutputOptions options;
  options.path = TemporaryPath(name);
  options.format = FormatOfPath(name).value();
  options.texcoord = texcoord;
  const auto written = WriteMeshWithUv(file, uv, options);
  EXPECT_TRUE(written.ok()) << written.status();
  if (!written.ok()) return MeshFile();
  for (const OutputFile& output : written->files) PutFile(output.path, output.bytes);
  absl::StatusOr<MeshFile> again = ReadMeshFile(options.path, {texcoord});
  EXPECT_TRUE(again.ok()) << again.status();
  return again.ok() ? *std::move(again) : MeshFile();
}

std::vector<double> UvOf(const PolygonMesh& mesh) {
  std::vector<double> uv;
  for (const std::int32_t id : mesh.corner_texcoord) {
    uv.push_back(mesh.texcoords[id].x());
    uv.push_back(mesh.texcoords[id].y());
  }
  return uv;
}

// The bytes of an attribute (or morph target) as each corner of a primitive sees them.
std::vector<std::string> CornerBytes(const MeshFile& file, std::size_t primitive, const std::string& name,
                                     bool of_target = false) {
  const GltfMesh& gltf = *file.gltf;
  const Json& json = PrimitiveJson(gltf.document.json, gltf.primitives[primitive]);
  const Json& attributes = of_target ? json["targets"][0] : json["attributes"];
  const GltfAccessor accessor = OpenAccessor(gltf.document, attributes[name].get<std::int64_t>()).value();
  const std::string bytes = accessor.DenseBytes();
  std::vector<std::string> result;
  const std::int64_t begin = 3 * gltf.primitives[primitive].first_polygon;
  for (std::int64_t c = begin; c < begin + 3 * gltf.primitives[primitive].num_polygons; ++c) {
    result.push_back(bytes.substr(static_cast<std::size_t>(gltf.corner_vertex[c] * accessor.element_size),
                                  static_cast<std::size_t>(accessor.element_size)));
  }
  return result;
}

TEST(GltfReader, ReadsEveryKindOfTriangles) {
  const MeshFile file = ReadBytes("a.glb", SampleGltf().Glb());
  const PolygonMesh& mesh = file.mesh;
  // 4 + 4 of the grid, 4 of the strip, 2 without indices; 9 grid points (12 with the seam), 6, and 4 of 6 welded.
  EXPECT_EQ(mesh.num_polygons(), 14);
  EXPECT_EQ(mesh.positions.size(), 9u + 6u + 4u);
  EXPECT_EQ(mesh.material_names, (std::vector<std::string>{"paint", "flat"}));
  EXPECT_EQ(mesh.group_names, (std::vector<std::string>{"grid", "quantized"}));
  EXPECT_EQ(mesh.polygon_material, (std::vector<std::int32_t>{0, 0, 0, 0, 1, 1, 1, 1, -1, -1, -1, -1, 1, 1}));
  EXPECT_EQ(mesh.polygon_group, (std::vector<std::int32_t>{0, 0, 0, 0, 0, 0, 0, 0, 0, 0, 0, 0, 1, 1}));
  EXPECT_EQ(mesh.positions.back(), Vec3(1, 1, 0));  // 32767 normalized
  // The UV of the seam's two sides differ, and v points upwards here.
  EXPECT_EQ(mesh.corner_vertex[1], mesh.corner_vertex[12]);
  EXPECT_NE(mesh.corner_texcoord[1], mesh.corner_texcoord[12]);
  EXPECT_EQ(mesh.texcoords[mesh.corner_texcoord[0]], Vec2(0, 1));
  EXPECT_EQ(mesh.corner_texcoord[24], -1);
  // All triangles of the strip look the same way.
  const Triangulation triangles = Triangulate(mesh);
  for (std::size_t f = 8; f < 12; ++f) {
    const Face& face = triangles.mesh.faces[f];
    const Vec3 a = triangles.mesh.positions[face[0]];
    const Vec3 normal = (triangles.mesh.positions[face[1]] - a).cross(triangles.mesh.positions[face[2]] - a);
    EXPECT_GT(normal.z(), 0) << f;
  }
}

TEST(GltfWriter, SplitsVerticesWithAllTheirAttributes) {
  const GltfFixture fixture = SampleGltf();
  for (const char* name : {"out.glb", "out.gltf"}) {
    const bool is_binary = FormatOfPath(name) == MeshFormat::kGlb;
    const MeshFile file = ReadBytes(std::string("in_") + name, is_binary ? fixture.Glb() : fixture.Gltf());
    const std::vector<double> uv = TriangleUv(file.mesh.corner_vertex.size());
    const MeshFile again = Written(file, uv, name);
    EXPECT_EQ(again.mesh.corner_vertex, file.mesh.corner_vertex);
    EXPECT_EQ(again.mesh.positions, file.mesh.positions);
    EXPECT_EQ(UvOf(again.mesh), uv);
    for (const std::size_t primitive : {0, 1}) {
      for (const char* attribute : {"POSITION", "NORMAL", "COLOR_0", "JOINTS_0", "WEIGHTS_0", "_TEMPERATURE"}) {
        EXPECT_EQ(CornerBytes(again, primitive, attribute), CornerBytes(file, primitive, attribute)) << attribute;
      }
      EXPECT_EQ(CornerBytes(again, primitive, "POSITION", true), CornerBytes(file, primitive, "POSITION", true));
    }
    EXPECT_EQ(CornerBytes(again, 3, "NORMAL"), CornerBytes(file, 3, "NORMAL"));
    // Both primitives go on sharing their vertices.
    const Json& primitives = again.gltf->document.json["meshes"][0]["primitives"];
    EXPECT_EQ(primitives[0]["attributes"], primitives[1]["attributes"]);
    EXPECT_FALSE(primitives[2].contains("mode")) << "a strip cannot hold the seams";
  }
}

// The JSON without what a rewritten mesh must change.
Json Rest(Json json) {
  for (const char* key : {"meshes", "accessors", "bufferViews", "buffers"}) json.erase(key);
  return json;
}

TEST(GltfWriter, KeepsWhatItDoesNotKnow) {
  const GltfFixture fixture = SampleGltf();
  const MeshFile file = ReadBytes("in.glb", fixture.Glb());
  const MeshFile again = Written(file, TriangleUv(file.mesh.corner_vertex.size()), "out.glb");
  const Json& before = file.gltf->document.json;
  const Json& after = again.gltf->document.json;
  EXPECT_EQ(Rest(after), Rest(before));
  EXPECT_EQ(Rest(after).dump(), Rest(before).dump()) << "the order of members";
  EXPECT_EQ(after["meshes"][0]["extras"], before["meshes"][0]["extras"]);
  EXPECT_EQ(after["meshes"][0]["primitives"][0]["extras"], before["meshes"][0]["primitives"][0]["extras"]);
  EXPECT_EQ(after["meshes"][0]["primitives"][3], before["meshes"][0]["primitives"][3]) << "the lines";
  // Old accessors keep their numbers, and those that no triangle uses their bytes: skin, animation, lines.
  const std::size_t lines = before["meshes"][0]["primitives"][3]["indices"];
  for (std::size_t i = lines; i < before["accessors"].size(); ++i) {
    if (i > lines && i <= lines + 2) continue;  // mesh 1
    EXPECT_EQ(after["accessors"][i], before["accessors"][i]);
    EXPECT_EQ(OpenAccessor(again.gltf->document, static_cast<std::int64_t>(i)).value().DenseBytes(),
              OpenAccessor(file.gltf->document, static_cast<std::int64_t>(i)).value().DenseBytes());
  }
  EXPECT_EQ(ViewBytes(again.gltf->document, after["images"][0]["bufferView"], "image").value(),
            ViewBytes(file.gltf->document, before["images"][0]["bufferView"], "image").value());
  EXPECT_EQ(after["accessors"][0]["name"], "where");
  EXPECT_EQ(after["accessors"][0]["max"], before["accessors"][0]["max"]);
}

TEST(GltfWriter, TouchesNothingElseWhereNothingIsSplit) {
  const MeshFile file = ReadBytes("in.glb", SampleGltf().Glb());
  const std::vector<double> uv = SmoothUv(file.mesh);
  const MeshFile again = Written(file, uv, "out.glb", 0);
  EXPECT_EQ(UvOf(again.mesh), uv);
  const Json& before = file.gltf->document.json;
  const Json& after = again.gltf->document.json;
  const std::size_t uv_accessor = before["meshes"][0]["primitives"][0]["attributes"]["TEXCOORD_0"];
  const std::size_t tangents = before["meshes"][0]["primitives"][0]["attributes"]["TANGENT"];
  for (std::size_t i = 0; i < before["accessors"].size(); ++i) {
    if (i == uv_accessor || i == tangents) continue;
    EXPECT_EQ(after["accessors"][i], before["accessors"][i]) << i;
  }
  EXPECT_EQ(after["accessors"][uv_accessor]["componentType"], 5126);
  EXPECT_EQ(after["meshes"][0]["primitives"][2]["mode"], 5) << "the strip stays one";
  // Two primitives had no UV before; one takes the place of the tangents.
  EXPECT_EQ(after["accessors"].size(), before["accessors"].size() + 1);
}

TEST(GltfWriter, WritesTheSetThatIsAskedFor) {
  GltfFixture fixture = SampleGltf();
  fixture.json["meshes"].erase(1);
  fixture.json["nodes"].erase(4);
  fixture.json["scenes"][0]["nodes"] = {0, 1, 2};
  fixture.json["meshes"][0]["primitives"].erase(2);
  const MeshFile file = ReadBytes("in.glb", fixture.Glb());
  const std::vector<double> uv = TriangleUv(file.mesh.corner_vertex.size());
  const MeshFile again = Written(file, uv, "out.glb", 1);
  EXPECT_EQ(UvOf(again.mesh), uv);
  EXPECT_EQ(CornerBytes(again, 0, "TEXCOORD_0"), CornerBytes(file, 0, "TEXCOORD_0"));

  OutputOptions options;
  options.format = MeshFormat::kGlb;
  options.texcoord = 2;
  const absl::Status gap = CheckOutput(file, options);
  EXPECT_EQ(Reason(gap), "OUTPUT_UNSUPPORTED");
  EXPECT_NE(gap.message().find("--output-texcoord=1, or give --textures=keep"), absl::string_view::npos) << gap;
}

// The second time the UV move to the end of the buffer, the third time nothing moves: no bytes are left behind.
TEST(GltfWriter, DoesNotGrowWhenWrittenAgain) {
  const MeshFile file = ReadBytes("in.glb", SampleGltf().Glb());
  const std::vector<double> uv = TriangleUv(file.mesh.corner_vertex.size());
  const MeshFile once = Written(file, uv, "once.glb");
  const MeshFile twice = Written(once, uv, "twice.glb");
  const MeshFile thrice = Written(twice, uv, "thrice.glb");
  EXPECT_LE(twice.bytes.size(), once.bytes.size() + 16);
  EXPECT_EQ(thrice.bytes == twice.bytes, true);
}

TEST(GltfWriter, KeepsBuffersAndImagesBesideTheFile) {
  GltfFixture fixture = SampleGltf();
  Json& json = fixture.json;
  json["buffers"] = Json::array({{{"byteLength", fixture.buffer.size()}, {"uri", "da%20ta.bin"}}});
  json["images"].push_back({{"uri", "tex/wood%20grain.png"}});
  PutFile(TemporaryPath("da ta.bin"), fixture.buffer);
  const MeshFile file = ReadBytes("beside.gltf", json.dump(1));
  std::filesystem::create_directories(std::filesystem::path(TemporaryPath("x")).parent_path() / "sub dir");
  const MeshFile again = Written(file, SmoothUv(file.mesh), "sub dir/out.gltf");
  const Json& after = again.gltf->document.json;
  EXPECT_EQ(after["buffers"][0]["uri"], "out.bin");
  EXPECT_EQ(after["images"][1]["uri"], "../tex/wood%20grain.png");
  EXPECT_EQ(again.bytes.substr(0, 5), "{\n \"a") << "indented as it was";
}

// What is said about a file that gets new UV.
std::vector<OutputWarning> WarningsOf(const MeshFile& file, int texcoord) {
  OutputOptions options;
  options.path = TemporaryPath("out.glb");
  options.format = MeshFormat::kGlb;
  options.texcoord = texcoord;
  const auto written = WriteMeshWithUv(file, TriangleUv(file.mesh.corner_vertex.size()), options);
  EXPECT_TRUE(written.ok()) << written.status();
  return written.ok() ? written->warnings : std::vector<OutputWarning>();
}

bool HasAttribute(const MeshFile& file, std::size_t primitive, const char* name) {
  return PrimitiveJson(file.gltf->document.json, file.gltf->primitives[primitive])["attributes"].contains(name);
}

TEST(GltfWriter, NamesTexturesThatReadTheReplacedUvAndDropsTheirTangents) {
  const MeshFile file = ReadBytes("in.glb", SampleGltf().Glb());
  ASSERT_TRUE(HasAttribute(file, 0, "TANGENT"));
  const std::vector<OutputWarning> warnings = WarningsOf(file, 0);
  ASSERT_EQ(warnings.size(), 2u);
  EXPECT_EQ(warnings[0].reason, "TEXTURE_UV_REPLACED");
  EXPECT_NE(warnings[0].message.find("material paint reads baseColorTexture (image 0) with TEXCOORD_0"),
            std::string::npos)
      << warnings[0].message;
  EXPECT_EQ(warnings[1].reason, "TANGENTS_DROPPED");
  const MeshFile again = Written(file, TriangleUv(file.mesh.corner_vertex.size()), "out.glb");
  EXPECT_FALSE(HasAttribute(again, 0, "TANGENT"));
  EXPECT_TRUE(HasAttribute(again, 0, "NORMAL"));
}

TEST(GltfWriter, KeepsTangentsOfANormalMapWithUvOfItsOwn) {
  GltfFixture fixture = SampleGltf();
  for (Json& material : fixture.json["materials"]) material["normalTexture"] = {{"index", 0}, {"texCoord", 1}};
  Json& color = fixture.json["materials"][0]["pbrMetallicRoughness"]["baseColorTexture"];
  color["extensions"]["KHR_texture_transform"]["texCoord"] = 1;
  const MeshFile file = ReadBytes("in.glb", fixture.Glb());
  EXPECT_TRUE(WarningsOf(file, 0).empty());
  const MeshFile again = Written(file, TriangleUv(file.mesh.corner_vertex.size()), "out.glb");
  EXPECT_EQ(CornerBytes(again, 0, "TANGENT"), CornerBytes(file, 0, "TANGENT"));
}

TEST(GltfWriter, ASecondSetLeavesTheFirstAsItWas) {
  GltfFixture fixture = SampleGltf();
  // What has no UV does not take part.
  for (Json& mesh : fixture.json["meshes"]) {
    for (Json& primitive : mesh["primitives"]) {
      if (!primitive["attributes"].contains("TEXCOORD_0")) primitive["mode"] = 0;
    }
  }
  const MeshFile file = ReadBytes("in.glb", fixture.Glb());
  EXPECT_TRUE(WarningsOf(file, 1).empty());
  const std::vector<double> uv = TriangleUv(file.mesh.corner_vertex.size());
  const MeshFile again = Written(file, uv, "out.glb", 1);
  EXPECT_EQ(UvOf(again.mesh), uv);
  for (const char* kept : {"TEXCOORD_0", "TANGENT"}) EXPECT_EQ(CornerBytes(again, 0, kept), CornerBytes(file, 0, kept));
}

TEST(GltfWriter, DropsTangentsBesideDraco) {
  GltfFixture fixture = SampleDracoGltf();
  const MeshFile file = ReadBytes("in.glb", fixture.Glb());
  const MeshFile again = Written(file, TriangleUv(file.mesh.corner_vertex.size()), "out.glb");
  EXPECT_FALSE(HasAttribute(again, 0, "TANGENT"));
}

// What the points of a Draco primitive have of an attribute, per corner.
std::vector<std::string> DracoCorners(const MeshFile& file, std::uint32_t unique_id) {
  std::vector<std::string> result;
  const DracoPoints& points = *file.gltf->pools[0].draco;
  for (const DracoAttribute& attribute : points.attributes) {
    if (attribute.unique_id != unique_id) continue;
    for (const Face& face : points.faces) {
      for (const std::int32_t point : face) {
        result.push_back(attribute.values.substr(static_cast<std::size_t>(point * attribute.value_size),
                                                 static_cast<std::size_t>(attribute.value_size)));
      }
    }
  }
  return result;
}

TEST(GltfWriter, CompressesWithDracoAgain) {
  const MeshFile file = ReadBytes("in.glb", SampleDracoGltf().Glb());
  EXPECT_EQ(file.mesh.num_polygons(), 10);
  EXPECT_EQ(file.mesh.positions.size(), 9u + 4u) << "the seam is welded";
  for (const bool seams : {false, true}) {
    const std::vector<double> uv = seams ? TriangleUv(file.mesh.corner_vertex.size()) : SmoothUv(file.mesh);
    const MeshFile again = Written(file, uv, "out.glb");
    EXPECT_EQ(again.mesh.corner_vertex, file.mesh.corner_vertex);
    EXPECT_EQ(again.mesh.positions, file.mesh.positions);
    const std::vector<double> found = UvOf(again.mesh);
    ASSERT_EQ(found.size(), uv.size());
    for (std::size_t i = 0; i < uv.size(); ++i) EXPECT_NEAR(found[i], uv[i], 1e-7);
    for (const std::uint32_t id : {7u, 9u}) EXPECT_EQ(DracoCorners(again, id), DracoCorners(file, id)) << id;
    for (const char* beside : {"COLOR_0", "JOINTS_0", "WEIGHTS_0", "_TEMPERATURE"}) {
      EXPECT_EQ(CornerBytes(again, 0, beside), CornerBytes(file, 0, beside)) << beside;
    }
    EXPECT_EQ(CornerBytes(again, 0, "POSITION", true), CornerBytes(file, 0, "POSITION", true));
    const Json& primitive = again.gltf->document.json["meshes"][0]["primitives"][0];
    const Json& extension = primitive["extensions"]["KHR_draco_mesh_compression"];
    EXPECT_EQ(extension["attributes"]["POSITION"], 7);
    EXPECT_EQ(extension["attributes"]["TEXCOORD_0"], 10);
    const std::string_view bytes = ViewBytes(again.gltf->document, extension["bufferView"], "draco").value();
    EXPECT_EQ(DecodeDracoPoints(std::string(bytes), true)->attributes[0].quantization_bits, 12)
        << "rounded on the same grid again";
    const std::size_t uv_accessor = primitive["attributes"]["TEXCOORD_0"];
    EXPECT_FALSE(again.gltf->document.json["accessors"][uv_accessor].contains("bufferView"));
    EXPECT_EQ(again.gltf->document.json["accessors"][uv_accessor]["count"], again.gltf->pools[0].num_vertices);
  }
}

struct Damage {
  const char* name;
  std::function<void(Json*)> act;
  const char* element;
};

TEST(GltfReader, NamesTheElementAtFault) {
  const Damage damages[] = {
      {"position index", [](Json* j) { (*j)["meshes"][1]["primitives"][0]["attributes"]["POSITION"] = 99; },
       "meshes[1].primitives[0].attributes.POSITION"},
      {"negative", [](Json* j) { (*j)["meshes"][0]["primitives"][0]["indices"] = -1; },
       "meshes[0].primitives[0].indices"},
      {"count", [](Json* j) { (*j)["accessors"][0]["count"] = 13; }, "accessors[0]"},
      {"huge count", [](Json* j) { (*j)["accessors"][0]["count"] = 9007199254740992; }, "accessors[0]"},
      {"overflow", [](Json* j) { (*j)["accessors"][0]["count"] = 18446744073709551615u; }, "accessors[0].count"},
      {"offset", [](Json* j) { (*j)["accessors"][0]["byteOffset"] = 4; }, "accessors[0]"},
      {"component", [](Json* j) { (*j)["accessors"][1]["componentType"] = 5127; }, "accessors[1].componentType"},
      {"type", [](Json* j) { (*j)["accessors"][1]["type"] = "VEC5"; }, "accessors[1].type"},
      {"view", [](Json* j) { (*j)["bufferViews"][0]["byteLength"] = 1e9; }, "bufferViews[0].byteLength"},
      {"stride", [](Json* j) { (*j)["bufferViews"][0]["byteStride"] = 8; }, "accessors[0]"},
      {"fewer normals", [](Json* j) { (*j)["accessors"][1]["count"] = 3; },
       "meshes[0].primitives[0].attributes.NORMAL"},
      {"sparse order", [](Json* j) { (*j)["accessors"][8]["sparse"]["indices"]["byteOffset"] = 1; },
       "accessors[8].sparse.indices"},
      {"zeros", [](Json* j) { (*j)["accessors"][8]["count"] = 1e12; }, "accessors[8].count"},
      {"mode", [](Json* j) { (*j)["meshes"][0]["primitives"][0]["mode"] = 7; }, "meshes[0].primitives[0].mode"},
      {"material", [](Json* j) { (*j)["meshes"][0]["primitives"][0]["material"] = 2; },
       "meshes[0].primitives[0].material"},
      {"no list", [](Json* j) { (*j)["accessors"] = 3; }, "accessors"},
      {"version", [](Json* j) { (*j)["asset"]["version"] = "1.0"; }, "asset.version"},
  };
  for (const Damage& damage : damages) {
    GltfFixture fixture = SampleGltf();
    damage.act(&fixture.json);
    PutFile(TemporaryPath("bad.glb"), fixture.Glb());
    const auto file = ReadMeshFile(TemporaryPath("bad.glb"));
    EXPECT_EQ(Reason(file.status()), "FILE_MALFORMED") << damage.name;
    EXPECT_NE(std::string(file.status().message()).find(std::string("bad.glb: ") + damage.element + ": "),
              std::string::npos)
        << damage.name << ": " << file.status();
  }
}

// The bytes of `fixture` as gltfpack would compress them, behind a buffer that stands in for the old ones.
GltfFixture Meshopted(const GltfFixture& fixture, const char* extension = "EXT_meshopt_compression") {
  GltfFixture result = fixture;
  result.buffer.clear();
  for (Json& view : result.json["bufferViews"]) {
    const auto offset = view.value("byteOffset", std::size_t{0}), length = view["byteLength"].get<std::size_t>();
    const std::string bytes = fixture.buffer.substr(offset, length);
    const bool is_index = view.value("target", 0) == 34963 && length % 2 == 0;
    const std::size_t stride = is_index ? 2 : 4, count = length / stride;
    std::vector<unsigned char> packed;
    if (is_index) {
      std::vector<unsigned int> indices(count);
      for (std::size_t i = 0; i < count; ++i) {
        std::uint16_t index = 0;
        std::memcpy(&index, bytes.data() + 2 * i, 2);
        indices[i] = index;
      }
      packed.resize(meshopt_encodeIndexSequenceBound(count, 65536));
      packed.resize(meshopt_encodeIndexSequence(packed.data(), packed.size(), indices.data(), count));
    } else if (length % 4 == 0) {
      packed.resize(meshopt_encodeVertexBufferBound(count, stride));
      packed.resize(meshopt_encodeVertexBuffer(packed.data(), packed.size(), bytes.data(), count, stride));
    }
    result.buffer.resize((result.buffer.size() + 3) / 4 * 4, '\0');
    if (packed.empty()) {
      view["byteOffset"] = result.buffer.size();
      result.buffer += bytes;
      continue;
    }
    view["buffer"] = 1;
    view["extensions"][extension] = {{"buffer", 0},
                                     {"byteOffset", result.buffer.size()},
                                     {"byteLength", packed.size()},
                                     {"byteStride", stride},
                                     {"count", count},
                                     {"mode", is_index ? "INDICES" : "ATTRIBUTES"}};
    result.buffer.append(packed.begin(), packed.end());
  }
  result.json["buffers"][0]["byteLength"] = result.buffer.size();
  result.json["buffers"][1] = {{"byteLength", fixture.buffer.size()},
                               {"extensions", {{extension, {{"fallback", true}}}}}};
  for (const char* list : {"extensionsUsed", "extensionsRequired"}) {
    result.json[list].push_back(extension);
  }
  return result;
}

TEST(GltfReader, ReadsMeshoptCompression) {
  const MeshFile file = ReadBytes("plain.glb", SampleGltf().Glb());
  for (const char* extension : {"EXT_meshopt_compression", "KHR_meshopt_compression"}) {
    const MeshFile packed = ReadBytes("packed.glb", Meshopted(SampleGltf(), extension).Glb());
    EXPECT_EQ(packed.mesh.corner_vertex, file.mesh.corner_vertex);
    EXPECT_EQ(packed.mesh.positions, file.mesh.positions);
    EXPECT_EQ(packed.mesh.corner_texcoord, file.mesh.corner_texcoord);
    EXPECT_EQ(packed.mesh.texcoords, file.mesh.texcoords);
    // It is written without that compression, and is whole all the same.
    const std::vector<double> uv = TriangleUv(file.mesh.corner_vertex.size());
    const MeshFile again = Written(packed, uv, "out.glb");
    EXPECT_EQ(again.gltf->document.json.dump().find("meshopt"), std::string::npos);
    EXPECT_EQ(UvOf(again.mesh), uv);
    for (const char* kept : {"POSITION", "COLOR_0", "WEIGHTS_0"}) {
      EXPECT_EQ(CornerBytes(again, 0, kept), CornerBytes(file, 0, kept)) << kept;
    }
  }
}

// Red grows along u, green along v.
std::string ColorsOfUv() {
  TextureImage image;
  image.header = {ImageKind::kPng, 64, 64, 3, 8};
  for (int i = 0; i < 64 * 64; ++i) {
    for (const int value : {4 * (i % 64) + 2, 4 * (i / 64) + 2, 0}) {
      image.texels.push_back(static_cast<std::uint8_t>(value));
    }
  }
  return EncodeImage(image).value();
}

TEST(GltfWriter, MovesTexturesOfCompressedMeshes) {
  for (GltfFixture fixture : {SampleGltf(), Meshopted(SampleGltf()), SampleDracoGltf()}) {
    fixture.json["images"][0] = {{"uri", DataUri(ColorsOfUv())}};
    const MeshFile file = ReadBytes("in.glb", fixture.Glb());
    OutputOptions options;
    options.path = TemporaryPath("out.glb");
    options.format = MeshFormat::kGlb;
    options.textures.mode = TextureMode::kTransfer;
    options.textures.size = 256;
    const auto written = WriteMeshWithUv(file, SmoothUv(file.mesh), options);
    ASSERT_TRUE(written.ok()) << written.status();
    const MeshFile again = ReadBytes("out.glb", written->files.back().bytes);
    EXPECT_EQ(again.mesh.positions, file.mesh.positions);
    const Json& image = again.gltf->document.json["images"][0];
    const auto after = DecodeImage(ViewBytes(again.gltf->document, image["bufferView"], "image").value(), "image");
    ASSERT_TRUE(after.ok()) << after.status();
    int compared = 0;
    for (std::size_t f = 0; f < static_cast<std::size_t>(again.gltf->primitives[0].num_polygons); ++f) {
      const auto middle = [f](const PolygonMesh& mesh) {
        Vec2 sum = Vec2::Zero();
        for (std::size_t k = 0; k < 3; ++k) sum += mesh.texcoords[mesh.corner_texcoord[3 * f + k]] / 3;
        return Vec2(sum.x(), 1 - sum.y());
      };
      const Vec2 old = middle(file.mesh), uv = middle(again.mesh);
      if (old.minCoeff() < 0.1 || old.maxCoeff() > 0.9) continue;
      const auto at = 3 * (static_cast<std::size_t>(uv.y() * 256) * 256 + static_cast<std::size_t>(uv.x() * 256));
      EXPECT_NEAR(after->texels[at], 256 * old.x(), 12) << f;
      EXPECT_NEAR(after->texels[at + 1], 256 * old.y(), 12) << f;
      ++compared;
    }
    EXPECT_GT(compared, 0);
  }
}

// Version 1 of the codec for vertices came with KHR_meshopt_compression, as the filter COLOR did.
TEST(GltfReader, NamesMeshoptStreamsThatAreTooNew) {
  constexpr char kName[] = "KHR_meshopt_compression";
  const auto first_view = [&](GltfFixture* fixture) -> Json& {
    for (Json& view : fixture->json["bufferViews"]) {
      if (view.contains("extensions")) return view;
    }
    return fixture->json;
  };
  const auto status = [&](const GltfFixture& fixture) {
    PutFile(TemporaryPath("new.glb"), fixture.Glb());
    return ReadMeshFile(TemporaryPath("new.glb")).status();
  };
  GltfFixture version = Meshopted(SampleGltf(), kName);
  const Json& stream = first_view(&version)["extensions"][kName];
  char& header = version.buffer[stream["byteOffset"].get<std::size_t>()];
  ASSERT_EQ(header & 0xff, 0xa0);
  header = '\xa1';
  EXPECT_EQ(Reason(status(version)), "FILE_UNSUPPORTED");
  EXPECT_THAT(std::string(status(version).message()), AllOf(HasSubstr(kName), HasSubstr("gltfpack")));
  GltfFixture color = Meshopted(SampleGltf(), kName);
  first_view(&color)["extensions"][kName]["filter"] = "COLOR";
  EXPECT_EQ(Reason(status(color)), "FILE_UNSUPPORTED");

  // Who does not require the extension has the bytes in plain, too.
  GltfFixture fallback = SampleGltf();
  Json& view = fallback.json["bufferViews"][0];
  view["extensions"][kName] = {{"buffer", 0}, {"byteLength", 4},   {"byteStride", 4},
                               {"count", 1},  {"filter", "COLOR"}, {"mode", "ATTRIBUTES"}};
  fallback.json["extensionsUsed"].push_back(kName);
  const MeshFile file = ReadBytes("fallback.glb", fallback.Glb());
  EXPECT_EQ(file.mesh.positions, ReadBytes("plain.glb", SampleGltf().Glb()).mesh.positions);
  const MeshFile again = Written(file, TriangleUv(file.mesh.corner_vertex.size()), "out.glb");
  EXPECT_EQ(again.gltf->document.json.dump().find("meshopt"), std::string::npos);
}

TEST(GltfReader, RefusesDamagedMeshoptCompression) {
  const auto reason = [](const std::function<void(Json*)>& act) {
    GltfFixture fixture = Meshopted(SampleGltf());
    for (Json& view : fixture.json["bufferViews"]) {
      if (!view.contains("extensions")) continue;
      act(&view["extensions"]["EXT_meshopt_compression"]);
      break;
    }
    PutFile(TemporaryPath("bad.glb"), fixture.Glb());
    return Reason(ReadMeshFile(TemporaryPath("bad.glb")).status());
  };
  EXPECT_EQ(reason([](Json*) {}), "");
  EXPECT_EQ(reason([](Json* j) { (*j)["mode"] = "OTHER"; }), "FILE_MALFORMED");
  EXPECT_EQ(reason([](Json* j) { (*j)["filter"] = "OTHER"; }), "FILE_MALFORMED");
  EXPECT_EQ(reason([](Json* j) { (*j)["filter"] = "QUATERNION"; }), "FILE_MALFORMED") << "stride 4";
  EXPECT_EQ(reason([](Json* j) { (*j)["byteStride"] = 3; }), "FILE_MALFORMED");
  EXPECT_EQ(reason([](Json* j) { (*j)["byteLength"] = 1; }), "FILE_MALFORMED");
  EXPECT_EQ(reason([](Json* j) { (*j)["byteOffset"] = std::int64_t{1} << 40; }), "FILE_MALFORMED");
  EXPECT_EQ(reason([](Json* j) { (*j)["count"] = std::int64_t{1} << 40; }), "FILE_MALFORMED") << "no bombs";
  EXPECT_EQ(reason([](Json* j) { (*j)["buffer"] = 1; }), "FILE_MALFORMED") << "a fallback has no bytes";
}

TEST(GltfReader, RefusesWhatItCannotFollow) {
  const auto reason = [](const std::function<void(Json*)>& act) {
    GltfFixture fixture = SampleGltf();
    fixture.json["buffers"] = Json::array({{{"byteLength", fixture.buffer.size()}, {"uri", "none.bin"}}});
    act(&fixture.json);
    PutFile(TemporaryPath("far.gltf"), fixture.json.dump());
    return Reason(ReadMeshFile(TemporaryPath("far.gltf")).status());
  };
  EXPECT_EQ(reason([](Json*) {}), "FILE_UNREADABLE");
  EXPECT_EQ(reason([](Json* j) { (*j)["buffers"][0]["uri"] = "https://example.com/a.bin"; }), "FILE_UNSUPPORTED");
  EXPECT_EQ(reason([](Json* j) { (*j)["buffers"][0]["uri"] = "/dev/zero"; }), "FILE_UNSUPPORTED");
  EXPECT_EQ(reason([](Json* j) { (*j)["buffers"][0]["uri"] = "../../../../../../../../dev/zero"; }), "FILE_UNREADABLE");
  PutFile(TemporaryPath("deep.gltf"), std::string(100000, '['));
  EXPECT_EQ(Reason(ReadMeshFile(TemporaryPath("deep.gltf")).status()), "FILE_MALFORMED");
}

}  // namespace
}  // namespace planish
