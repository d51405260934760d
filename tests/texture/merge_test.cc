// Materials that become one, and vertex colours that become an image.
#include <signal.h>

#include <algorithm>
#include <cmath>
#include <cstdint>
#include <filesystem>
#include <set>
#include <string>
#include <utility>
#include <vector>

#include "client/files/gltf_attribute.h"
#include "client/files/gltf_document.h"
#include "client/files/gltf_material.h"
#include "client/files/gltf_mesh.h"
#include "client/files/mesh_output.h"
#include "client/texture/image.h"
#include "core/base/error.h"
#include "core/draco/points.h"
#include "gmock/gmock.h"
#include "gtest/gtest.h"
#include "tests/testing/files.h"
#include "tests/testing/process.h"
#include "tests/texture/sample_models.h"
#include "tests/texture/sample_textures.h"

namespace planish {
namespace {

using ::testing::Contains;
using ::testing::HasSubstr;
using ::testing::SizeIs;

constexpr double kQuads = 4;
const Vec2 kCorners[] = {Vec2(0, 0), Vec2(1, 0), Vec2(1, 1), Vec2(0, 1)};

// Four squares in a row, each with a material of its own: m0, m1, ...
MeshFile Row() {
  std::string obj;
  for (int q = 0; q < kQuads; ++q) {
    for (const Vec2& p : kCorners) {
      obj += "v " + std::to_string(2 * q + p.x()) + " " + std::to_string(p.y()) + " 0\n";
    }
    obj += "usemtl m" + std::to_string(q) + "\nf -4 -3 -2 -1\n";
  }
  const absl::StatusOr<MeshFile> file = ReadMeshBytes("row.obj", MeshFormat::kObj, obj);
  EXPECT_TRUE(file.ok()) << file.status();
  return file.value_or(MeshFile());
}

// In the map the squares stand in a row, with space between them. `p`: a place of square `q`, both from 0 to 1, v
// upwards.
Vec2 Place(int q, const Vec2& p) {
  return {(q + 0.15 + 0.7 * p.x()) / kQuads, 0.2 + 0.5 * p.y()};
}

std::vector<double> RowUv(const MeshFile& file) {
  std::vector<double> uv;
  for (const std::int32_t v : file.mesh.corner_vertex) {
    const Vec3& p = file.mesh.positions[static_cast<std::size_t>(v)];
    const int q = static_cast<int>(p.x() / 2);
    const Vec2 place = Place(q, Vec2(p.x() - 2 * q, p.y()));
    uv.insert(uv.end(), {place.x(), place.y()});
  }
  return uv;
}

MeshFile Reopened(const Json& json, const std::string& buffer) {
  const absl::StatusOr<std::string> glb = GlbBytes(json, buffer, "");
  EXPECT_TRUE(glb.ok()) << glb.status();
  return Opened(glb.value_or(""));
}

MeshFile RowGlb() {
  const MeshFile row = Row();
  OutputOptions options;
  options.path = "row.glb";
  options.format = MeshFormat::kGlb;
  const absl::StatusOr<WrittenMesh> written = WriteMeshWithUv(row, RowUv(row), options);
  EXPECT_TRUE(written.ok()) << written.status();
  return Opened(written->files.back().bytes);
}

struct Painted {
  MeshFile file;
  std::vector<std::string> reasons, messages;
  std::vector<OutputFile> files;
};

Painted Paint(const MeshFile& file, bool merges, bool bakes, const std::string& path = "out.glb") {
  OutputOptions options;
  options.path = path;
  options.format = *FormatOfPath(path);
  options.textures.mode = TextureMode::kTransfer;
  options.textures.merge_materials = merges;
  options.textures.bake_colors = bakes;
  const absl::Status check = CheckOutput(file, options);
  EXPECT_TRUE(check.ok()) << check;
  absl::StatusOr<WrittenMesh> written = WriteMeshWithUv(file, RowUv(file), options);
  EXPECT_TRUE(written.ok()) << written.status();
  Painted painted;
  if (!written.ok()) return painted;
  if (options.format == MeshFormat::kGlb) painted.file = Opened(written->files.back().bytes);
  for (const OutputWarning& warning : written->warnings) {
    painted.reasons.push_back(warning.reason);
    painted.messages.push_back(warning.message);
  }
  painted.files = std::move(written->files);
  return painted;
}

// What the image in a slot of material `m` shows at a place of square `q`, from 0 to 255; empty without an image.
std::vector<double> ShownIn(const MeshFile& file, std::size_t m, const std::string& slot, int q,
                            const Vec2& p = Vec2(0.5, 0.5)) {
  const Json& root = file.gltf->document.json;
  for (const GltfTextureUse& use : TextureUses(root, static_cast<std::int64_t>(m))) {
    if (use.slot != slot) continue;
    const absl::StatusOr<std::string> bytes =
        GltfImageBytes(file.gltf->document, TextureSources(root, use.texture)[0].image, false);
    EXPECT_TRUE(bytes.ok()) << bytes.status();
    const absl::StatusOr<TextureImage> image = DecodeImage(bytes.value_or(""), slot);
    EXPECT_TRUE(image.ok()) << image.status();
    if (!image.ok()) return {};
    const Vec2 uv = Place(q, p);
    return Shown(*image, Vec2(uv.x(), 1 - uv.y()));
  }
  return {};
}

double Srgb(double linear) {
  return 255 * SrgbOfLinear(linear);
}

// Each is within 1 of 255.
void ExpectColor(const std::vector<double>& shown, const std::vector<double>& expected) {
  ASSERT_GE(shown.size(), expected.size());
  for (std::size_t c = 0; c < expected.size(); ++c) EXPECT_NEAR(shown[c], expected[c], 1) << "channel " << c;
}

TEST(MergedMaterials, LookAsBeforeWithOneImageAndOneDrawCall) {
  int merged = 0;
  for (const SampleModel& model : SampleModels(8, 96)) {
    if (model.materials.size() < 2 || !model.is_smooth) continue;
    SCOPED_TRACE(model.name);
    const MeshFile before = Opened(model.Glb());
    TextureOptions options;
    options.merge_materials = true;
    const MeshFile after = WithNewMap(before, options);
    const Json& json = after.gltf->document.json;
    for (const char* list : {"materials", "images", "textures"}) EXPECT_THAT(json[list], SizeIs(1)) << list;
    EXPECT_THAT(json["meshes"][0]["primitives"], SizeIs(1));
    const ModelDifference difference = CompareModels(before, after, 4000);
    EXPECT_LE(difference.color.mean, 2);
    EXPECT_LE(difference.color.percentile99, 12);
    ++merged;
  }
  EXPECT_GE(merged, 2);
}

TEST(MergedMaterials, FactorsArePaintedInAndOthersAreLeftAlone) {
  const MeshFile plain = RowGlb();
  Json json = plain.gltf->document.json;
  Json materials = json["materials"];
  materials[0]["pbrMetallicRoughness"] = {
      {"baseColorFactor", {0.5, 0.25, 1, 1}}, {"metallicFactor", 0}, {"roughnessFactor", 0.5}};
  materials[0]["emissiveFactor"] = {1, 0, 0.2};
  materials[2]["alphaMode"] = "BLEND";
  json["materials"] = materials;
  json["animations"] = Json::array(
      {{{"channels", Json::array({{{"sampler", 0},
                                   {"target",
                                    {{"path", "pointer"},
                                     {"extensions",
                                      {{"KHR_animation_pointer", {{"pointer", "/materials/3/emissiveFactor"}}}}}}}}})},
        {"samplers", Json::array()}}});
  const MeshFile before = Reopened(json, plain.gltf->document.buffers[0]);
  const Painted painted = Paint(before, /*merges=*/true, /*bakes=*/false);
  const Json& after = painted.file.gltf->document.json;
  EXPECT_THAT(painted.messages, Contains(HasSubstr("m0+m1")));
  EXPECT_THAT(painted.messages, Contains(::testing::AllOf(HasSubstr("m3"), HasSubstr("animated"))));
  // Their numbers stay, as the animation knows them by these.
  EXPECT_EQ(after["materials"][2], materials[2]);
  EXPECT_EQ(after["materials"][3], materials[3]);
  const Json& primitives = after["meshes"][0]["primitives"];
  ASSERT_THAT(primitives, SizeIs(3)) << primitives;
  const auto m = primitives[0]["material"].get<std::size_t>();
  EXPECT_FALSE(after["materials"][m]["pbrMetallicRoughness"].contains("baseColorFactor"));
  ExpectColor(ShownIn(painted.file, m, "baseColorTexture", 0), {Srgb(0.5), Srgb(0.25), 255});
  ExpectColor(ShownIn(painted.file, m, "baseColorTexture", 1), {255, 255, 255});
  ExpectColor(ShownIn(painted.file, m, "metallicRoughnessTexture", 0), {255, 127.5, 0});
  ExpectColor(ShownIn(painted.file, m, "metallicRoughnessTexture", 1), {255, 255, 255});
  ExpectColor(ShownIn(painted.file, m, "emissiveTexture", 0), {255, 0, Srgb(0.2)});
  ExpectColor(ShownIn(painted.file, m, "emissiveTexture", 1), {0, 0, 0});
  // Colours reach the edges of the squares.
  ExpectColor(ShownIn(painted.file, m, "baseColorTexture", 0, Vec2(1, 0)), {Srgb(0.5), Srgb(0.25), 255});
  // Every corner has its place and its UV.
  ASSERT_EQ(painted.file.mesh.corner_vertex.size(), before.mesh.corner_vertex.size());
  for (std::size_t c = 0; c < before.mesh.corner_vertex.size(); ++c) {
    const auto at = [c](const MeshFile& file) {
      return file.mesh.positions[static_cast<std::size_t>(file.mesh.corner_vertex[c])];
    };
    EXPECT_EQ(at(before), at(painted.file));
  }
}

TEST(MergedMaterials, SayWhyNothingWasMerged) {
  const MeshFile plain = RowGlb();
  const auto messages = [&plain](const Json& json, std::vector<std::int32_t> atlases = {}) {
    OutputOptions options;
    options.path = "out.glb";
    options.format = MeshFormat::kGlb;
    options.textures.mode = TextureMode::kTransfer;
    options.textures.merge_materials = true;
    options.textures.polygon_atlas = std::move(atlases);
    const MeshFile file = Reopened(json, plain.gltf->document.buffers[0]);
    const absl::StatusOr<WrittenMesh> written = WriteMeshWithUv(file, RowUv(file), options);
    EXPECT_TRUE(written.ok()) << written.status();
    std::vector<std::string> all;
    for (const OutputWarning& warning : written->warnings) all.push_back(warning.reason + ": " + warning.message);
    return all;
  };
  const std::string prefix = "MATERIAL_NOT_MERGED: no materials were merged: ";
  Json json = plain.gltf->document.json;
  json["materials"][1]["alphaMode"] = "BLEND";
  json["materials"][2]["doubleSided"] = true;
  json["materials"][3]["extensions"]["KHR_materials_unlit"] = Json::object();
  EXPECT_THAT(messages(json),
              ::testing::ElementsAre(prefix + "the 4 materials differ in alpha mode, sides, extensions"));
  for (Json& primitive : json["meshes"][0]["primitives"]) primitive["material"] = 0;
  EXPECT_THAT(messages(json), ::testing::ElementsAre(prefix + "the triangles have one material"));
  json = plain.gltf->document.json;
  EXPECT_THAT(messages(json, {0, 0, 1, 1, 2, 2, 3, 3}),
              ::testing::ElementsAre(prefix + "the 4 materials differ in atlas"));
  // All in variants, and none of them merged.
  for (int p = 0; p < kQuads; ++p) {
    json["meshes"][0]["primitives"][p]["extensions"]["KHR_materials_variants"]["mappings"] = Json::array();
  }
  EXPECT_THAT(messages(json), SizeIs(kQuads));
  json["meshes"][0]["primitives"][0].erase("extensions");
  EXPECT_THAT(messages(json), Contains(prefix + "only one material is left that could be"));
}

TEST(MergedMaterials, StrengthsAndScalesArePaintedWhereTheyDiffer) {
  const MeshFile plain = RowGlb();
  Json json = plain.gltf->document.json;
  std::string buffer = plain.gltf->document.buffers[0];
  const auto add_image = [&](std::array<double, 3> rgb) {
    const absl::StatusOr<std::string> png = EncodeImage(
        MakeTexture(4, 4, 3, 8, [&rgb](double, double, int c) { return rgb[static_cast<std::size_t>(c)]; }));
    json["textures"].push_back({{"source", json["textures"].size()}});
    json["images"].push_back({{"bufferView", json["bufferViews"].size()}, {"mimeType", "image/png"}});
    json["bufferViews"].push_back({{"buffer", 0}, {"byteOffset", buffer.size()}, {"byteLength", png->size()}});
    buffer += *png;
    return json["textures"].size() - 1;
  };
  const std::size_t surface = add_image({0.4, 0.6, 0.2});
  for (int m : {0, 1}) {
    json["materials"][m]["occlusionTexture"] = {{"index", surface}, {"strength", m == 0 ? 0.5 : 1}};
    json["materials"][m]["pbrMetallicRoughness"]["metallicRoughnessTexture"] = {{"index", surface}};
  }
  json["materials"][1]["pbrMetallicRoughness"]["roughnessFactor"] = 0.5;
  json["materials"][2]["occlusionTexture"] = {{"index", surface}};
  json["buffers"][0]["byteLength"] = buffer.size();
  const Painted painted = Paint(Reopened(json, buffer), /*merges=*/true, /*bakes=*/false);
  const Json& after = painted.file.gltf->document.json;
  ASSERT_THAT(after["materials"], SizeIs(1)) << after["materials"];
  EXPECT_THAT(after["images"], SizeIs(1)) << "occlusion, roughness and metalness share one";
  const Json& material = after["materials"][0];
  EXPECT_FALSE(material["occlusionTexture"].contains("strength")) << material;
  for (const char* slot : {"occlusionTexture", "metallicRoughnessTexture"}) {
    ExpectColor(ShownIn(painted.file, 0, slot, 0), {255 * (1 + 0.5 * (0.4 - 1)), 153, 51});
    ExpectColor(ShownIn(painted.file, 0, slot, 1), {102, 76.5, 51});
    ExpectColor(ShownIn(painted.file, 0, slot, 2), {102, 255, 255});
    ExpectColor(ShownIn(painted.file, 0, slot, 3), {255, 255, 255});
  }
}

// The same model with its primitives compressed by Draco, and without UV.
MeshFile Compressed(const MeshFile& plain) {
  Json json = plain.gltf->document.json;
  std::string buffer = plain.gltf->document.buffers[0];
  for (const GltfPrimitive& primitive : plain.gltf->primitives) {
    const absl::StatusOr<std::vector<float>> positions = ReadVertexAttribute(*plain.gltf, primitive, "POSITION", 3);
    EXPECT_TRUE(positions.ok()) << positions.status();
    DracoPoints points;
    points.num_points = std::ssize(*positions) / 3;
    DracoAttribute position;
    position.kind = DracoKind::kPosition;
    position.unique_id = static_cast<std::uint32_t>(3 + primitive.primitive);
    position.component = kDracoFloat32;
    position.components = 3;
    position.value_size = 3 * sizeof(float);
    position.values.assign(reinterpret_cast<const char*>(positions->data()), positions->size() * sizeof(float));
    points.attributes = {position};
    for (std::int64_t f = primitive.first_polygon; f < primitive.first_polygon + primitive.num_polygons; ++f) {
      const std::int32_t* const corner = plain.gltf->corner_vertex.data() + 3 * f;
      points.faces.push_back({corner[0], corner[1], corner[2]});
    }
    const std::string bytes = EncodeDracoPoints(points).value();
    Json& written = PrimitiveJson(json, primitive);
    written["attributes"] = {{"POSITION", written["attributes"]["POSITION"]}};
    written["extensions"]["KHR_draco_mesh_compression"] = {{"bufferView", json["bufferViews"].size()},
                                                           {"attributes", {{"POSITION", position.unique_id}}}};
    for (const Json& index : {written["attributes"]["POSITION"], written["indices"]}) {
      json["accessors"][index.get<std::size_t>()].erase("bufferView");
    }
    json["bufferViews"].push_back({{"buffer", 0}, {"byteOffset", buffer.size()}, {"byteLength", bytes.size()}});
    buffer += bytes;
    buffer.resize((buffer.size() + 3) / 4 * 4);
  }
  json["extensionsUsed"] = json["extensionsRequired"] = {"KHR_draco_mesh_compression"};
  json["buffers"][0]["byteLength"] = buffer.size();
  return Reopened(json, buffer);
}

// Accessors and views that nothing refers to.
int Unused(const Json& json) {
  std::set<std::int64_t> accessors, views;
  const auto find = [&](const auto& self, const Json& value) -> void {
    for (auto member = value.begin(); member != value.end(); ++member) {
      const std::string key = value.is_object() ? member.key() : "";
      const Json& child = *member;
      if (key == "bufferView") views.insert(child.get<std::int64_t>());
      if (key == "indices" && child.is_number()) accessors.insert(child.get<std::int64_t>());
      if (key == "attributes" && !value.contains("bufferView")) {
        for (const Json& index : child) accessors.insert(index.get<std::int64_t>());
      }
      if (child.is_structured()) self(self, child);
    }
  };
  find(find, json);
  return static_cast<int>(json["accessors"].size() - accessors.size() + json["bufferViews"].size() - views.size());
}

TEST(MergedMaterials, JoinedPrimitivesStayCompressedAndLeaveNothingUnused) {
  const MeshFile plain = RowGlb();
  for (const bool is_draco : {false, true}) {
    const MeshFile before = is_draco ? Compressed(plain) : plain;
    ASSERT_EQ(before.gltf->pools[0].draco.has_value(), is_draco);
    const Painted painted = Paint(before, /*merges=*/true, /*bakes=*/false);
    const Json& json = painted.file.gltf->document.json;
    ASSERT_THAT(json["meshes"][0]["primitives"], SizeIs(1)) << is_draco;
    EXPECT_EQ(painted.file.gltf->pools[0].draco.has_value(), is_draco);
    EXPECT_EQ(Unused(json), Unused(before.gltf->document.json)) << json.dump();
    const PolygonMesh &old = before.mesh, &now = painted.file.mesh;
    ASSERT_EQ(now.corner_vertex.size(), old.corner_vertex.size());
    for (std::size_t c = 0; c < old.corner_vertex.size(); ++c) {
      EXPECT_EQ(now.positions[static_cast<std::size_t>(now.corner_vertex[c])],
                old.positions[static_cast<std::size_t>(old.corner_vertex[c])]);
    }
    EXPECT_EQ(json["accessors"][json["meshes"][0]["primitives"][0]["attributes"]["POSITION"].get<std::size_t>()]["max"],
              Json({7, 1, 0}));
  }
}

// Adds COLOR_0 to the first square: red at the left, green at the right, linear.
MeshFile WithColors(const MeshFile& plain) {
  Json json = plain.gltf->document.json;
  std::string buffer = plain.gltf->document.buffers[0];
  Json& primitive = json["meshes"][0]["primitives"][0];
  const auto count = json["accessors"][primitive["attributes"]["POSITION"].get<std::size_t>()]["count"].get<int>();
  buffer.resize((buffer.size() + 3) / 4 * 4);
  const std::size_t begin = buffer.size();
  std::vector<float> colors;
  for (int v = 0; v < count; ++v) {
    const Vec3& p = plain.mesh.positions[static_cast<std::size_t>(v)];
    colors.insert(colors.end(), {static_cast<float>(1 - p.x()), static_cast<float>(p.x()), 0});
  }
  buffer.append(reinterpret_cast<const char*>(colors.data()), colors.size() * sizeof(float));
  primitive["attributes"]["COLOR_0"] = json["accessors"].size();
  json["accessors"].push_back(
      {{"bufferView", json["bufferViews"].size()}, {"componentType", 5126}, {"count", count}, {"type", "VEC3"}});
  json["bufferViews"].push_back({{"buffer", 0}, {"byteOffset", begin}, {"byteLength", buffer.size() - begin}});
  json["buffers"][0]["byteLength"] = buffer.size();
  json["materials"][0]["pbrMetallicRoughness"]["baseColorFactor"] = {1, 0.5, 1, 1};
  return Reopened(json, buffer);
}

TEST(VertexColors, OfAGltfArePaintedAndGone) {
  const MeshFile before = WithColors(RowGlb());
  const Painted painted = Paint(before, /*merges=*/false, /*bakes=*/true);
  EXPECT_THAT(painted.reasons, ::testing::ElementsAre("COLORS_BAKED"));
  const Json& after = painted.file.gltf->document.json;
  EXPECT_EQ(after.dump().find("COLOR_0"), std::string::npos);
  EXPECT_THAT(after["images"], SizeIs(1)) << "the other materials have no colours";
  // The factor stays where it was.
  EXPECT_EQ(after["materials"][0]["pbrMetallicRoughness"]["baseColorFactor"], Json({1, 0.5, 1, 1}));
  for (const double x : {0.2, 0.5, 0.75}) {
    ExpectColor(ShownIn(painted.file, 0, "baseColorTexture", 0, Vec2(x, 0.3)), {Srgb(1 - x), Srgb(x), 0});
  }
  // With materials merged the factor is painted too.
  const Painted both = Paint(before, /*merges=*/true, /*bakes=*/true);
  ASSERT_THAT(both.file.gltf->document.json["materials"], SizeIs(1));
  EXPECT_THAT(both.file.gltf->document.json["meshes"][0]["primitives"], SizeIs(1));
  ExpectColor(ShownIn(both.file, 0, "baseColorTexture", 0, Vec2(0.5, 0.3)), {Srgb(0.5), Srgb(0.25), 0});
  ExpectColor(ShownIn(both.file, 0, "baseColorTexture", 3), {255, 255, 255});
}

TEST(VertexColors, OfPlyAndObjBecomeAnImageBeside) {
  // Blue at the left, and a grey of 128 at the right.
  std::string ply =
      "ply\nformat ascii 1.0\ncomment made by hand\nelement vertex 4\nproperty float x\nproperty float y\nproperty "
      "float "
      "z\nproperty uchar red\nproperty uchar green\nproperty uchar blue\nelement face 1\nproperty list uchar int "
      "vertex_indices\nend_header\n";
  std::string obj;
  for (const Vec2& p : kCorners) {
    const std::string place = std::to_string(p.x()) + " " + std::to_string(p.y()) + " 0 ";
    ply += place + (p.x() == 0 ? "0 0 255\n" : "128 128 128\n");
    obj += "v " + place + (p.x() == 0 ? "0 0 1\n" : "0.502 0.502 0.502\n");
  }
  ply += "4 0 1 2 3\n";
  obj += "f 1 2 3 4\n";
  const auto expect_image = [](const std::string& png) {
    const absl::StatusOr<TextureImage> image = DecodeImage(png, "colours");
    ASSERT_TRUE(image.ok()) << image.status();
    const auto shown = [&](const Vec2& p) {
      const Vec2 uv = Place(0, p);
      return Shown(*image, Vec2(uv.x(), 1 - uv.y()));
    };
    const double half = LinearOfSrgb(128.0 / 255);
    ExpectColor(shown(Vec2(0.5, 0.5)), {Srgb(half / 2), Srgb(half / 2), Srgb((1 + half) / 2)});
    ExpectColor(shown(Vec2(1, 0.5)), {128, 128, 128});
  };
  const absl::StatusOr<MeshFile> ply_file = ReadMeshBytes("in.ply", MeshFormat::kPly, ply);
  const absl::StatusOr<MeshFile> obj_file = ReadMeshBytes("in.obj", MeshFormat::kObj, obj);
  ASSERT_TRUE(ply_file.ok() && obj_file.ok()) << ply_file.status() << obj_file.status();
  for (const MeshFile& file : {*ply_file, *obj_file}) {
    SCOPED_TRACE(file.path);
    const Painted as_ply = Paint(file, false, true, "dir/out.ply");
    ASSERT_THAT(as_ply.files, SizeIs(2));
    EXPECT_EQ(as_ply.files[0].path, "dir/out_colors.png");
    expect_image(as_ply.files[0].bytes);
    EXPECT_THAT(as_ply.files[1].bytes, HasSubstr("\ncomment TextureFile out_colors.png\n"));
    const Painted as_obj = Paint(file, false, true, "dir/out.obj");
    ASSERT_THAT(as_obj.files, SizeIs(3));
    expect_image(as_obj.files[0].bytes);
    EXPECT_EQ(as_obj.files[1].bytes, "newmtl colors\nKd 1 1 1\nmap_Kd out_colors.png\n");
    EXPECT_THAT(as_obj.files[2].bytes, ::testing::StartsWith("mtllib out.mtl\nusemtl colors\n"));
    const absl::StatusOr<MeshFile> again = ReadMeshBytes("dir/out.ply", MeshFormat::kPly, as_ply.files.back().bytes);
    ASSERT_TRUE(again.ok()) << again.status();
    const Painted as_glb = Paint(file, false, true);
    ExpectColor(ShownIn(as_glb.file, 0, "baseColorTexture", 0, Vec2(1, 0.5)), {128, 128, 128});
  }
}

TEST(VertexColors, WhatCannotBePaintedIsRefusedOrSaid) {
  const auto reason = [](const MeshFile& file, const std::string& path, bool merges) {
    OutputOptions options;
    options.path = path;
    options.format = path == "-" ? file.format : *FormatOfPath(path);
    options.textures.mode = TextureMode::kTransfer;
    (merges ? options.textures.merge_materials : options.textures.bake_colors) = true;
    return ErrorInfoOf(CheckOutput(file, options)).reason;
  };
  const MeshFile row = Row();
  for (const char* path : {"out.off", "out.drc", "-", "out.obj"}) {
    EXPECT_EQ(reason(row, path, false), "OUTPUT_UNSUPPORTED") << path;
  }
  EXPECT_EQ(reason(row, "out.glb", true), "OUTPUT_UNSUPPORTED");
  EXPECT_EQ(reason(RowGlb(), "out.obj", true), "OUTPUT_UNSUPPORTED");
  EXPECT_THAT(Paint(row, false, true, "out.ply").reasons, ::testing::ElementsAre("COLORS_NOT_BAKED"));
  EXPECT_THAT(Paint(RowGlb(), false, true).reasons, ::testing::ElementsAre("COLORS_NOT_BAKED"));
}

TEST(VertexColors, ThatAreNoNumbersAndMaterialsThatAreNoneCostNoCrash) {
  const MeshFile plain = WithColors(RowGlb());
  Json json = plain.gltf->document.json;
  std::string buffer = plain.gltf->document.buffers[0];
  for (std::size_t i = buffer.size() - 48; i < buffer.size(); i += 4) buffer.replace(i, 4, "\xFF\xFF\xFF\xFF");
  json["materials"][0]["pbrMetallicRoughness"]["baseColorFactor"] = {1e300, -1e300, 0, 1};
  const Painted painted = Paint(Reopened(json, buffer), /*merges=*/true, /*bakes=*/true);
  EXPECT_THAT(painted.file.gltf->document.json["images"], SizeIs(1));
  json["materials"][0]["pbrMetallicRoughness"] = 3;
  OutputOptions options;
  options.path = "out.glb";
  options.format = MeshFormat::kGlb;
  options.textures.mode = TextureMode::kTransfer;
  options.textures.merge_materials = options.textures.bake_colors = true;
  const MeshFile bad = Reopened(json, buffer);
  EXPECT_EQ(ErrorInfoOf(EstimateTextureSide(bad, options, 1).status()).reason, "FILE_MALFORMED");
  EXPECT_EQ(ErrorInfoOf(WriteMeshWithUv(bad, RowUv(bad), options).status()).reason, "FILE_MALFORMED");
  // Lists of the root that are none.
  for (const char* key : {"samplers", "textures", "extensionsUsed"}) {
    Json damaged = plain.gltf->document.json;
    damaged[key] = "many";
    const absl::StatusOr<std::string> glb = GlbBytes(damaged, buffer, "");
    ASSERT_TRUE(glb.ok()) << glb.status();
    EXPECT_EQ(ErrorInfoOf(ReadMeshBytes("in.glb", MeshFormat::kGlb, *glb).status()).reason, "FILE_MALFORMED") << key;
  }
}

TEST(ImageProgress, CommandsSayWhichImageComesNextAndEndBetweenRows) {
  const std::filesystem::path folder = std::filesystem::path(::testing::TempDir()) / "planish_image_progress";
  std::filesystem::create_directories(folder);
  const std::string in = folder / "in.glb", out = folder / "out.glb";
  std::filesystem::remove(out);
  const std::vector<SampleModel> models = SampleModels(8, 32);
  const auto model =
      std::find_if(models.begin(), models.end(), [](const auto& each) { return each.materials.size() > 1; });
  ASSERT_NE(model, models.end());
  PutFile(in, model->Glb());
  const std::string count = std::to_string(model->materials.size());
  Process whole({PLANISH_COMMAND, "pack", in, "-o", out, "--texture-size=64", "--progress=json"});
  const Outcome done = whole.Wait();
  ASSERT_EQ(done.exit_code, 0) << done.err;
  EXPECT_THAT(done.err, HasSubstr("\"number\":1,\"count\":" + count));
  EXPECT_THAT(done.err, HasSubstr("\"number\":" + count + ",\"count\":" + count));
  std::filesystem::remove(out);
  Process stopped({PLANISH_COMMAND, "pack", in, "-o", out, "--texture-size=4096", "--progress=plain"});
  ASSERT_TRUE(stopped.WaitForErr("(1 of " + count + ")", 60)) << stopped.Err();
  stopped.Signal(SIGINT);
  const Outcome end = stopped.Wait();
  EXPECT_EQ(end.exit_code, 130) << end.err;
  EXPECT_THAT(end.err,
              ::testing::AllOf(HasSubstr("nothing was written"), ::testing::Not(HasSubstr("(" + count + " of"))));
  EXPECT_FALSE(std::filesystem::exists(out));
}

}  // namespace
}  // namespace planish
