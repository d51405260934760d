// Images that move to a new map, in files.
#include <atomic>
#include <cmath>
#include <filesystem>
#include <iomanip>
#include <random>
#include <sstream>

#include "client/files/gltf_accessor.h"
#include "client/files/gltf_attribute.h"
#include "client/files/gltf_document.h"
#include "client/files/gltf_mesh.h"
#include "client/files/mesh_output.h"
#include "core/base/error.h"
#include "gmock/gmock.h"
#include "gtest/gtest.h"
#include "tests/testing/files.h"
#include "tests/testing/process.h"
#include "tests/texture/sample_textures.h"

namespace planish {
namespace {

using ::testing::HasSubstr;
using ::testing::SizeIs;

// A folder of the test's own.
std::string TemporaryPath(const std::string& name) {
  const std::string test = ::testing::UnitTest::GetInstance()->current_test_info()->name();
  const std::filesystem::path folder = std::filesystem::path(::testing::TempDir()) / "planish_textures" / test;
  std::filesystem::create_directories(folder);
  return (folder / name).string();
}

std::string Png(const TextureImage& image) {
  const absl::StatusOr<std::string> bytes = EncodeImage(image);
  EXPECT_TRUE(bytes.ok()) << bytes.status();
  return bytes.value_or("");
}

// A sheet of n x n squares with normals, one material with `material`, images in the buffer.
struct Sheet {
  explicit Sheet(int n, const std::vector<TextureImage>& textures, Json material) {
    const auto add = [&](const std::string& view) {
      buffer.resize((buffer.size() + 7) / 8 * 8);
      json["bufferViews"].push_back({{"buffer", 0}, {"byteOffset", buffer.size()}, {"byteLength", view.size()}});
      buffer += view;
      return json["bufferViews"].size() - 1;
    };
    std::string positions, normals, uv, indices;
    const auto put = [](std::string* list, auto value) {
      list->append(reinterpret_cast<const char*>(&value), sizeof value);
    };
    for (int j = 0; j <= n; ++j) {
      for (int i = 0; i <= n; ++i) {
        for (const float x : {1.0F * i / n, 1.0F * j / n, 0.0F}) put(&positions, x);
        for (const float x : {0.0F, 0.0F, 1.0F}) put(&normals, x);
        for (const float x : {1.0F * i / n, 1 - 1.0F * j / n}) put(&uv, x);
      }
    }
    for (int j = 0; j < n; ++j) {
      for (int i = 0; i < n; ++i) {
        const int a = j * (n + 1) + i;
        for (const int v : {a, a + 1, a + n + 2, a, a + n + 2, a + n + 1}) put(&indices, static_cast<std::uint16_t>(v));
      }
    }
    const int vertices = (n + 1) * (n + 1);
    json["asset"]["version"] = "2.0";
    json["accessors"] = Json::array(
        {{{"bufferView", add(positions)},
          {"componentType", 5126},
          {"count", vertices},
          {"type", "VEC3"},
          {"min", {0, 0, 0}},
          {"max", {1, 1, 0}}},
         {{"bufferView", add(normals)}, {"componentType", 5126}, {"count", vertices}, {"type", "VEC3"}},
         {{"bufferView", add(uv)}, {"componentType", 5126}, {"count", vertices}, {"type", "VEC2"}},
         {{"bufferView", add(indices)}, {"componentType", 5123}, {"count", 6 * n * n}, {"type", "SCALAR"}}});
    json["meshes"] = Json::array({{{"primitives", Json::array({Primitive()})}}});
    json["materials"] = Json::array({std::move(material)});
    for (const TextureImage& texture : textures) {
      json["textures"].push_back({{"source", json["images"].size()}});
      json["images"].push_back({{"bufferView", add(Png(texture))}, {"mimeType", "image/png"}});
    }
    json["buffers"] = Json::array({{{"byteLength", buffer.size()}}});
  }

  static Json Primitive() {
    return {{"attributes", {{"POSITION", 0}, {"NORMAL", 1}, {"TEXCOORD_0", 2}}}, {"indices", 3}, {"material", 0}};
  }

  std::string Bytes() const {
    const absl::StatusOr<std::string> glb = GlbBytes(json, buffer, "");
    EXPECT_TRUE(glb.ok()) << glb.status();
    return glb.value_or("");
  }

  MeshFile File() const {
    const absl::StatusOr<MeshFile> file = ReadMeshBytes(TemporaryPath("in.glb"), MeshFormat::kGlb, Bytes());
    EXPECT_TRUE(file.ok()) << file.status();
    return file.value_or(MeshFile());
  }

  Json json;
  std::string buffer;
};

// The map turned by an angle round the middle of the tile and made smaller; charts are the columns of squares.
std::vector<double> Turned(const PolygonMesh& mesh, int columns, double angle, double scale) {
  std::vector<double> uv;
  for (std::int64_t p = 0; p < mesh.num_polygons(); ++p) {
    Vec2 middle = Vec2::Zero();
    for (int k = 0; k < 3; ++k) middle += mesh.positions[mesh.corner_vertex[3 * p + k]].head<2>() / 3;
    const int column = std::min(columns - 1, static_cast<int>(middle.x() * columns));
    for (int k = 0; k < 3; ++k) {
      const Vec2 x = mesh.positions[mesh.corner_vertex[3 * p + k]].head<2>();
      const Vec2 local = scale * Vec2(x.x() - 0.5 + 0.05 * (column - 0.5 * (columns - 1)), x.y() - 0.5);
      uv.push_back(0.5 + std::cos(angle) * local.x() - std::sin(angle) * local.y());
      uv.push_back(0.5 + std::sin(angle) * local.x() + std::cos(angle) * local.y());
    }
  }
  return uv;
}

struct Moved {
  MeshFile file;
  std::vector<OutputWarning> warnings;
  std::vector<OutputFile> files;
};

Moved Move(const MeshFile& file, const std::vector<double>& uv, TextureOptions textures,
           const std::string& name = "out.glb") {
  OutputOptions options;
  options.path = TemporaryPath(name);
  options.format = *FormatOfPath(name);
  options.textures = std::move(textures);
  if (options.textures.mode == TextureMode::kLeave) options.textures.mode = TextureMode::kTransfer;
  absl::StatusOr<WrittenMesh> written = WriteMeshWithUv(file, uv, options);
  EXPECT_TRUE(written.ok()) << written.status();
  Moved moved;
  if (!written.ok()) return moved;
  for (const OutputFile& each : written->files) PutFile(each.path, each.bytes);
  absl::StatusOr<MeshFile> again = ReadMeshFile(options.path);
  EXPECT_TRUE(again.ok()) << again.status();
  if (again.ok()) moved.file = *std::move(again);
  moved.warnings = std::move(written->warnings);
  moved.files = std::move(written->files);
  return moved;
}

TextureImage ImageOf(const MeshFile& file, std::size_t image) {
  const Json& json = file.gltf->document.json;
  const absl::StatusOr<std::string_view> bytes =
      ViewBytes(file.gltf->document, json["images"][image]["bufferView"], "image");
  EXPECT_TRUE(bytes.ok()) << bytes.status();
  const absl::StatusOr<TextureImage> decoded = DecodeImage(*bytes, "image");
  EXPECT_TRUE(decoded.ok()) << decoded.status();
  return decoded.value_or(TextureImage());
}

// Triangles from the first file's UV to the second's; v downwards.
std::vector<TextureTriangle> Pairs(const MeshFile& before, const MeshFile& after,
                                   const std::array<double, 6>& m = {1, 0, 0, 0, 1, 0}) {
  std::vector<TextureTriangle> triangles(static_cast<std::size_t>(before.mesh.num_polygons()));
  for (std::size_t c = 0; c < before.mesh.corner_vertex.size(); ++c) {
    const auto at = [c](const PolygonMesh& mesh) {
      const Vec2 uv = mesh.texcoords[static_cast<std::size_t>(mesh.corner_texcoord[c])];
      return Vec2(uv.x(), 1 - uv.y());
    };
    const Vec2 from = at(before.mesh);
    triangles[c / 3].from[c % 3] =
        Vec2(m[0] * from.x() + m[1] * from.y() + m[2], m[3] * from.x() + m[4] * from.y() + m[5]);
    triangles[c / 3].to[c % 3] = at(after.mesh);
  }
  return triangles;
}

const Json kColored = {{"name", "paint"}, {"pbrMetallicRoughness", {{"baseColorTexture", {{"index", 0}}}}}};

TEST(GltfTextures, TheSurfaceLooksTheSame) {
  const TextureImage image = SmoothTexture(256, 256, 0.125, 1);
  const Sheet sheet(4, {image}, kColored);
  const MeshFile file = sheet.File();
  const Moved moved = Move(file, Turned(file.mesh, 4, 0.6, 0.6), {});
  EXPECT_THAT(moved.warnings, SizeIs(0));
  const TextureImage after = ImageOf(moved.file, 0);
  // 256 texels a length, in a map that is 0.6 of it.
  EXPECT_NEAR(after.header.width, 256 / 0.6, 4);
  const Difference difference = Compare(image, after, Pairs(file, moved.file), 20000);
  EXPECT_LE(difference.mean, 2);
  EXPECT_LE(difference.percentile99, 12);
  EXPECT_THAT(moved.file.gltf->document.json["images"], SizeIs(1));
  EXPECT_LT(moved.files.back().bytes.size(), sheet.Bytes().size() * 4);
}

TEST(GltfTextures, TransformationsAreAppliedAndGone) {
  Json material = kColored;
  material["pbrMetallicRoughness"]["baseColorTexture"]["extensions"]["KHR_texture_transform"] = {
      {"offset", {0.1, 0.3}}, {"rotation", 0.5}, {"scale", {2, 1.5}}};
  const TextureImage image = SmoothTexture(128, 128, 0.1, 1);
  Sheet sheet(4, {image}, material);
  sheet.json["extensionsUsed"] = {"KHR_texture_transform"};
  const MeshFile file = sheet.File();
  const Moved moved = Move(file, Turned(file.mesh, 4, 0.2, 0.6), {});
  const Json& json = moved.file.gltf->document.json;
  EXPECT_FALSE(json.contains("extensionsUsed")) << json;
  EXPECT_EQ(json.dump().find("KHR_texture_transform"), std::string::npos);
  const double c = std::cos(0.5), s = std::sin(0.5);
  const std::array<double, 6> m = {2 * c, 1.5 * s, 0.1, -2 * s, 1.5 * c, 0.3};
  EXPECT_LE(Compare(image, ImageOf(moved.file, 0), Pairs(file, moved.file, m), 20000).mean, 2);
}

TEST(GltfTextures, SlotsThatShareAnImageGoOnSharingItAndOthersGetTheirOwn) {
  Json material = kColored;
  material["pbrMetallicRoughness"]["metallicRoughnessTexture"] = {{"index", 1}};
  material["occlusionTexture"] = {{"index", 1}};
  material["emissiveTexture"] = {{"index", 1}};  // the same image as colours
  const MeshFile file = Sheet(2, {SmoothTexture(32, 32, 0.1, 1), SmoothTexture(64, 64, 0.1, 2)}, material).File();
  const Moved moved = Move(file, Turned(file.mesh, 2, 0.2, 0.6), {});
  const Json& after = moved.file.gltf->document.json;
  EXPECT_THAT(after["images"], SizeIs(3)) << after;
  EXPECT_THAT(after["textures"], SizeIs(3));
  const Json& m = after["materials"][0];
  EXPECT_EQ(m["pbrMetallicRoughness"]["metallicRoughnessTexture"]["index"], m["occlusionTexture"]["index"]);
  EXPECT_NE(m["emissiveTexture"]["index"], m["occlusionTexture"]["index"]);
  EXPECT_NEAR(ImageOf(moved.file, 0).header.width, 32 / 0.6, 4);
  EXPECT_NEAR(ImageOf(moved.file, 1).header.width, 64 / 0.6, 4);
}

TEST(GltfTextures, LinesKeepTheOldMaterialAndAtlasesGetTheirOwn) {
  Sheet sheet(2, {SmoothTexture(32, 32, 0.1, 1)}, kColored);
  Json line = Sheet::Primitive();
  line["mode"] = 1;
  sheet.json["meshes"].push_back({{"primitives", Json::array({Sheet::Primitive(), line})}});
  const MeshFile file = sheet.File();
  const std::vector<double> one = Turned(file.mesh, 2, 0.2, 0.6);
  TextureOptions options;
  options.polygon_atlas.resize(static_cast<std::size_t>(file.mesh.num_polygons()), 0);
  for (std::size_t p = options.polygon_atlas.size() / 2; p < options.polygon_atlas.size(); ++p)
    options.polygon_atlas[p] = 1;
  const Moved moved = Move(file, one, options);
  const Json& after = moved.file.gltf->document.json;
  ASSERT_THAT(after["materials"], SizeIs(3)) << after;
  EXPECT_EQ(after["materials"][0], file.gltf->document.json["materials"][0]);
  EXPECT_EQ(after["meshes"][1]["primitives"][1]["material"], 0);
  EXPECT_NE(after["meshes"][0]["primitives"][0]["material"], after["meshes"][1]["primitives"][0]["material"]);
  EXPECT_THAT(after["images"], SizeIs(3));
  ASSERT_THAT(moved.warnings, SizeIs(1));
  EXPECT_EQ(moved.warnings[0].reason, "MATERIAL_CLONED");
}

// Directions that a normal map shows at random points of the surface, in its tangent frames.
std::vector<Vec3> ShownNormals(const MeshFile& file, const TextureImage& image, int points) {
  const GltfPrimitive& primitive = file.gltf->primitives[0];
  const std::vector<float> tangents = *ReadVertexAttribute(*file.gltf, primitive, "TANGENT", 4);
  std::mt19937 random(5);
  std::vector<Vec3> result;
  for (int i = 0; i < points; ++i) {
    const std::size_t f = random() % static_cast<std::size_t>(file.mesh.num_polygons());
    double a = (random() % 1000) / 1000.0, b = (random() % 1000) / 1000.0;
    if (a + b > 1) a = 1 - a, b = 1 - b;
    Vec2 uv = Vec2::Zero();
    Vec3 tangent = Vec3::Zero();
    double sign = 1;
    for (std::size_t k = 0; k < 3; ++k) {
      const double w = k == 0 ? 1 - a - b : k == 1 ? a : b;
      const Vec2& corner = file.mesh.texcoords[static_cast<std::size_t>(file.mesh.corner_texcoord[3 * f + k])];
      uv += w * Vec2(corner.x(), 1 - corner.y());
      const auto v = 4 * static_cast<std::size_t>(file.gltf->corner_vertex[3 * f + k]);
      tangent += w * Vec3(tangents[v], tangents[v + 1], tangents[v + 2]);
      sign = tangents[v + 3];
    }
    const std::vector<double> rgb = Shown(image, uv);
    const Vec3 n(0, 0, 1), bitangent = sign * Vec3(-tangent.y(), tangent.x(), 0);
    result.push_back(
        ((2 * rgb[0] / 255 - 1) * tangent + (2 * rgb[1] / 255 - 1) * bitangent + (2 * rgb[2] / 255 - 1) * n)
            .normalized());
  }
  return result;
}

TEST(GltfTextures, NormalMapsShowTheSameDirections) {
  const TextureImage image = MakeTexture(256, 256, 3, 8, [](double x, double y, int c) {
    const Vec3 n = Vec3(0.5 * std::sin(x / 8), 0.4 * std::cos(y / 11), 1).normalized();
    return 0.5 + 0.5 * n[c];
  });
  Json material = kColored;
  material["normalTexture"] = {{"index", 1}};
  const MeshFile file = Sheet(4, {SmoothTexture(32, 32, 0.1, 1), image}, material).File();
  // Once with UV as they are, for tangents of the first map; then turned.
  std::vector<double> same;
  for (const std::int32_t v : file.mesh.corner_vertex) {
    same.insert(same.end(), {file.mesh.positions[static_cast<std::size_t>(v)].x(),
                             file.mesh.positions[static_cast<std::size_t>(v)].y()});
  }
  TextureOptions as_large;
  as_large.size = 256;
  const Moved first = Move(file, same, as_large);
  for (const double angle : {0.6, 2.5}) {
    const Moved second = Move(first.file, Turned(file.mesh, 4, angle, 0.6), {});
    const std::vector<Vec3> before = ShownNormals(first.file, ImageOf(first.file, 1), 2000);
    const std::vector<Vec3> after = ShownNormals(second.file, ImageOf(second.file, 1), 2000);
    const std::vector<Vec3> original = ShownNormals(first.file, image, 2000);
    double mean = 0, own = 0;
    for (std::size_t i = 0; i < before.size(); ++i) {
      mean += std::acos(std::min(1.0, before[i].dot(after[i]))) * 180 / 3.14159265 / 2000;
      own += std::acos(std::min(1.0, before[i].dot(original[i]))) * 180 / 3.14159265 / 2000;
    }
    EXPECT_LE(mean, 2);
    EXPECT_LE(own, 0.5);
  }
}

TEST(GltfTextures, WhatIsReadWithOtherUvStays) {
  Json material = kColored;
  material["occlusionTexture"] = {{"index", 1}, {"texCoord", 1}};
  Sheet sheet(2, {SmoothTexture(32, 32, 0.1, 1), SmoothTexture(16, 16, 0.1, 2)}, material);
  sheet.json["meshes"][0]["primitives"][0]["attributes"]["TEXCOORD_1"] = 2;
  const MeshFile file = sheet.File();
  const Moved moved = Move(file, Turned(file.mesh, 2, 0.2, 0.6), {});
  EXPECT_EQ(moved.file.gltf->document.json["materials"], file.gltf->document.json["materials"]);
  EXPECT_EQ(ImageOf(moved.file, 1).texels, ImageOf(file, 1).texels);
  EXPECT_NE(ImageOf(moved.file, 0).texels, ImageOf(file, 0).texels);
}

TEST(GltfTextures, DropRemovesTheReferencesAndTheBytes) {
  const Sheet sheet(2, {SmoothTexture(32, 32, 0.1, 1)}, kColored);
  const MeshFile file = sheet.File();
  TextureOptions options;
  options.mode = TextureMode::kDrop;
  const Moved moved = Move(file, Turned(file.mesh, 2, 0.2, 0.6), options);
  EXPECT_EQ(moved.file.gltf->document.json["materials"].dump().find("Texture"), std::string::npos);
  ASSERT_THAT(moved.warnings, SizeIs(1));
  EXPECT_EQ(moved.warnings[0].reason, "TEXTURE_DROPPED");
  for (const char* gone : {"textures", "images"}) EXPECT_FALSE(moved.file.gltf->document.json.contains(gone)) << gone;
  EXPECT_LT(moved.files[0].bytes.size() + Png(SmoothTexture(32, 32, 0.1, 1)).size(), sheet.Bytes().size() + 500);
}

TEST(GltfTextures, DropKeepsImagesThatOthersRead) {
  Json material = kColored;
  material["emissiveTexture"] = {{"index", 1}, {"texCoord", 1}};
  Sheet sheet(2, {SmoothTexture(32, 32, 0.1, 1), SmoothTexture(16, 16, 0.1, 2)}, material);
  sheet.json["meshes"][0]["primitives"][0]["attributes"]["TEXCOORD_1"] = 2;
  const MeshFile file = sheet.File();
  TextureOptions options;
  options.mode = TextureMode::kDrop;
  const Moved moved = Move(file, Turned(file.mesh, 2, 0.2, 0.6), options);
  const Json& json = moved.file.gltf->document.json;
  ASSERT_THAT(json["images"], SizeIs(1));
  ASSERT_THAT(json["textures"], SizeIs(1));
  EXPECT_EQ(json["textures"][0]["source"], 0);
  EXPECT_EQ(json["materials"][0]["emissiveTexture"]["index"], 0);
  EXPECT_EQ(ImageOf(moved.file, 0).texels, ImageOf(file, 1).texels);
  // What an extension may refer to stays.
  sheet.json["extensions"]["EXT_unheard_of"]["image"] = 0;
  sheet.json["extensionsUsed"] = {"EXT_unheard_of"};
  const MeshFile known = sheet.File();
  EXPECT_THAT(Move(known, Turned(file.mesh, 2, 0.2, 0.6), options).file.gltf->document.json["images"], SizeIs(2));
}

absl::Status CheckOf(const MeshFile& file, const TextureOptions& textures) {
  OutputOptions options;
  options.path = TemporaryPath("out.glb");
  options.format = MeshFormat::kGlb;
  options.textures = textures;
  options.textures.mode = TextureMode::kTransfer;
  return CheckOutput(file, options);
}

TEST(GltfTextures, WhatStandsInTheWayIsNamedBeforeThereIsAMap) {
  Sheet sheet(2, {SmoothTexture(32, 32, 0.1, 1)}, kColored);
  sheet.json["images"][0] = {{"uri", "data:image/ktx2;base64,q0tUWCAyMLsNChoK"}, {"name", "wood"}};
  EXPECT_THAT(std::string(CheckOf(sheet.File(), {}).message()),
              ::testing::AllOf(HasSubstr("wood"), HasSubstr("KTX2"), HasSubstr("--textures=keep")));
  sheet.json["images"][0] = {{"uri", "../secret.png"}};
  const absl::Status outside = CheckOf(sheet.File(), {});
  EXPECT_EQ(ErrorInfoOf(outside).reason, "IMAGE_OUTSIDE") << outside;
  sheet.json["images"][0] = {{"uri", "https://example.com/wood.png"}};
  EXPECT_EQ(ErrorInfoOf(CheckOf(sheet.File(), {})).reason, "FILE_UNSUPPORTED");
  sheet.json["images"][0] = {{"uri", "no_such.png"}};
  EXPECT_EQ(ErrorInfoOf(CheckOf(sheet.File(), {})).reason, "FILE_UNREADABLE");
  sheet.json["textures"][0]["source"] = 7;
  EXPECT_EQ(ErrorInfoOf(CheckOf(sheet.File(), {})).reason, "FILE_MALFORMED");
}

TEST(GltfTextures, AConversionNamesTheImagesThatItLeavesOut) {
  const MeshFile file = Sheet(2, {SmoothTexture(32, 32, 0.1, 1)}, kColored).File();
  for (const char* name : {"out.obj", "out.ply", "out.off", "out.drc"}) {
    const Moved moved = Move(file, Turned(file.mesh, 2, 0.2, 0.6), {}, name);
    ASSERT_THAT(moved.warnings, SizeIs(1)) << name;
    EXPECT_EQ(moved.warnings[0].reason, "TEXTURE_DROPPED");
    EXPECT_THAT(moved.warnings[0].message, ::testing::AllOf(HasSubstr("(image 0)"), HasSubstr("write .glb or .gltf")));
  }
}

TEST(GltfTextures, AnErrorOfAnImageNamesItsFileToo) {
  Sheet sheet(2, {SmoothTexture(32, 32, 0.1, 1)}, kColored);
  PutFile(TemporaryPath("my wood.png"), "no image");
  sheet.json["images"][0] = {{"uri", "my%20wood.png"}, {"name", "Oak"}};
  EXPECT_THAT(std::string(CheckOf(sheet.File(), {}).message()), HasSubstr("in.glb: Oak (my wood.png): "));
  sheet.json["images"][0].erase("name");
  EXPECT_THAT(std::string(CheckOf(sheet.File(), {}).message()), HasSubstr("in.glb: my wood.png: "));
}

TEST(GltfTextures, ImagesWithAWrongEndingAreNamedAfterTheirBytes) {
  TextureImage image = SmoothTexture(32, 32, 0.1, 1);
  image.header.kind = ImageKind::kJpeg;
  Sheet sheet(2, {image}, kColored);
  PutFile(TemporaryPath("wood.png"), Png(image));
  sheet.json["images"][0] = {{"uri", "wood.png"}, {"mimeType", "image/png"}};
  const MeshFile file = sheet.File();
  const Moved moved = Move(file, Turned(file.mesh, 2, 0.2, 0.6), {}, "out.gltf");
  const Json& after = moved.file.gltf->document.json["images"][0];
  EXPECT_EQ(after["uri"], "out_wood.jpg");
  EXPECT_EQ(after["mimeType"], "image/jpeg");
}

TEST(GltfTextures, AMaterialThatLiesInTwoTilesIsRefused) {
  const MeshFile file = Sheet(2, {SmoothTexture(64, 64, 0.1, 1)}, kColored).File();
  OutputOptions options;
  options.path = TemporaryPath("out.glb");
  options.format = MeshFormat::kGlb;
  options.textures.mode = TextureMode::kTransfer;
  // More of it lies in the first tile, in the second, and all in the second.
  for (const auto& [shift, reason] : {std::pair(0.3, "OPTIONS_INVALID"), {0.7, "OPTIONS_INVALID"}, {1.0, ""}}) {
    std::vector<double> uv = Turned(file.mesh, 2, 0, 0.6);
    for (std::size_t c = 0; c < uv.size(); c += 2) uv[c] += shift;
    EXPECT_EQ(ErrorInfoOf(WriteMeshWithUv(file, uv, options).status()).reason, reason) << shift;
  }
}

TEST(GltfTextures, MemoryBeyondTheLimitIsRefused) {
  const MeshFile file = Sheet(2, {SmoothTexture(64, 64, 0.1, 1)}, kColored).File();
  OutputOptions options;
  options.path = TemporaryPath("out.glb");
  options.format = MeshFormat::kGlb;
  options.textures.mode = TextureMode::kTransfer;
  options.textures.memory = 10000;
  const auto written = WriteMeshWithUv(file, Turned(file.mesh, 2, 0.2, 0.6), options);
  EXPECT_EQ(ErrorInfoOf(written.status()).reason, "TEXTURE_MEMORY");
  const std::atomic<bool> stop = true;
  options.textures.memory = 0;
  options.textures.stop = &stop;
  EXPECT_EQ(WriteMeshWithUv(file, Turned(file.mesh, 2, 0.2, 0.6), options).status().code(),
            absl::StatusCode::kCancelled);
}

TEST(ObjTextures, MaterialFilesAndTheirImagesFollow) {
  const TextureImage image = SmoothTexture(128, 128, 0.1, 1);
  PutFile(TemporaryPath("my wood.png"), Png(image));
  const std::string old_mtl =
      "# made by hand\nnewmtl wood\nKd 1 1 1\nmap_Kd -s 2 3 1 -bm 0.5 -o 0.25 0.1 0 my wood.png\nmap_Ks my wood.png\n"
      "newmtl plain\nKd 1 0 0\n";
  PutFile(TemporaryPath("in.mtl"), old_mtl);
  const std::string obj =
      "mtllib in.mtl\nv 0 0 0\nv 1 0 0\nv 1 1 0\nv 0 1 0\nvt 0 0\nvt 1 0\nvt 1 1\nvt 0 1\nusemtl wood\nf 1/1 2/2 3/3 "
      "4/4\n";
  const absl::StatusOr<MeshFile> file = ReadMeshBytes(TemporaryPath("in.obj"), MeshFormat::kObj, obj);
  ASSERT_TRUE(file.ok()) << file.status();
  EXPECT_THAT(FilesOfObj(TemporaryPath("in.obj"), obj), ::testing::ElementsAre("in.mtl", "my wood.png"));
  std::vector<double> uv;
  for (const Vec2& p : {Vec2(0.2, 0.1), Vec2(0.8, 0.3), Vec2(0.6, 0.9), Vec2(0, 0.7)})
    uv.insert(uv.end(), {p.x(), p.y()});
  const Moved moved = Move(*file, uv, {}, "out.obj");
  ASSERT_THAT(moved.files, SizeIs(4));
  EXPECT_THAT(moved.file.bytes, HasSubstr("mtllib out.mtl\n"));
  const std::string mtl = ReadFile(TemporaryPath("out.mtl"));
  EXPECT_EQ(mtl,
            "# made by hand\nnewmtl wood\nKd 1 1 1\nmap_Kd -bm 0.5 out_my_wood.png\nmap_Ks out_my_wood_2.png\nnewmtl "
            "plain\nKd 1 0 0\n");
  const absl::StatusOr<TextureImage> after = DecodeImage(ReadFile(TemporaryPath("out_my_wood.png")), "image");
  ASSERT_TRUE(after.ok()) << after.status();
  // v upwards: v' = 3 v + 0.1.
  std::vector<TextureTriangle> triangles(2);
  const auto from = [](double u, double v) { return Vec2(2 * u + 0.25, 1 - (3 * v + 0.1)); };
  const auto to = [&uv](std::size_t c) { return Vec2(uv[2 * c], 1 - uv[2 * c + 1]); };
  triangles[0] = {{from(0, 0), from(1, 0), from(1, 1)}, {to(0), to(1), to(2)}};
  triangles[1] = {{from(0, 0), from(1, 1), from(0, 1)}, {to(0), to(2), to(3)}};
  const Difference difference = Compare(image, *after, triangles, 5000);
  EXPECT_LE(difference.mean, 2.5);
  EXPECT_EQ(ReadFile(TemporaryPath("in.mtl")), old_mtl) << "the original stays";

  const Moved converted = Move(*file, uv, {}, "out.glb");
  ASSERT_THAT(converted.warnings, SizeIs(1));
  EXPECT_EQ(converted.warnings[0].reason, "TEXTURE_DROPPED");
  EXPECT_THAT(converted.warnings[0].message,
              ::testing::AllOf(HasSubstr("from OBJ"), HasSubstr("(my wood.png)"), HasSubstr("write .obj")));
  TextureOptions drop;
  drop.mode = TextureMode::kDrop;
  EXPECT_THAT(Move(*file, uv, drop, "out.glb").warnings, SizeIs(0)) << "asked for";
}

// glTF numbers sets of UV without gaps, and these primitives have two sets and one.
TEST(PackCommand, KeepsTexturesOfPrimitivesWithDifferentNumbersOfSets) {
  Sheet sheet(2, {SmoothTexture(32, 32, 0.1, 1)}, kColored);
  Json more = Sheet::Primitive();
  more["attributes"]["TEXCOORD_1"] = 2;
  sheet.json["meshes"].push_back({{"primitives", Json::array({more})}});
  const std::string in = TemporaryPath("in.glb"), out = TemporaryPath("out.glb");
  PutFile(in, sheet.Bytes());
  const Outcome done = RunShell(PLANISH_COMMAND " pack '" + in + "' -o '" + out + "' --textures=keep");
  ASSERT_EQ(done.exit_code, 0) << done.err;
  EXPECT_THAT(done.err, HasSubstr("TEXCOORDS_FILLED"));
  const auto uv_of = [&out](int texcoord) {
    const absl::StatusOr<MeshFile> file = ReadMeshFile(out, {texcoord});
    EXPECT_TRUE(file.ok()) << file.status();
    std::vector<Vec2> uv;
    for (const std::int32_t id : file->mesh.corner_texcoord) uv.push_back(file->mesh.texcoords.at(id));
    return uv;
  };
  const std::vector<Vec2> old = uv_of(0), second = uv_of(1), packed = uv_of(2);
  const std::size_t half = old.size() / 2;
  EXPECT_NE(packed, old);
  EXPECT_TRUE(std::equal(packed.begin(), packed.begin() + half, second.begin())) << "filled";
  EXPECT_TRUE(std::equal(old.begin() + half, old.end(), second.begin() + half)) << "was there";
}

// The images are read with the sets 0 and 7, so both must stay.
TEST(PackCommand, KeepsTexturesOfAFileWithEightSets) {
  Sheet sheet(2, {SmoothTexture(32, 32, 0.1, 1)}, kColored);
  Json& material = sheet.json["materials"][0];
  material["emissiveTexture"] = {{"index", 0}, {"texCoord", 7}};
  Json& attributes = sheet.json["meshes"][0]["primitives"][0]["attributes"];
  const auto add_sets = [&attributes](int end) {
    for (int n = 1; n < end; ++n) attributes["TEXCOORD_" + std::to_string(n)] = 2;
  };
  add_sets(8);
  const std::string in = TemporaryPath("in.glb"), out = TemporaryPath("out.glb");
  const std::string command = PLANISH_COMMAND " pack '" + in + "' -o '" + out + "' --textures=keep";
  PutFile(in, sheet.Bytes());
  const Outcome done = RunShell(command);
  ASSERT_EQ(done.exit_code, 0) << done.err;
  const absl::StatusOr<MeshFile> before = ReadMeshFile(in);
  EXPECT_THAT(UvSets(*ReadMeshFile(out)), ::testing::ElementsAre(0, 1, 2, 3, 4, 5, 6, 7, 8));
  for (const int set : {0, 7, 8}) {
    const absl::StatusOr<MeshFile> after = ReadMeshFile(out, {set});
    ASSERT_TRUE(after.ok()) << after.status();
    EXPECT_EQ(after->mesh.texcoords == before->mesh.texcoords, set != 8) << set;
  }
  add_sets(64);
  PutFile(in, sheet.Bytes());
  const Outcome full = RunShell(command);
  EXPECT_NE(full.exit_code, 0);
  EXPECT_THAT(full.err, ::testing::AllOf(HasSubstr("in.glb: the new UV cannot become TEXCOORD_64"),
                                         HasSubstr("--textures=transfer")));
}

TEST(PackCommand, RefusesToKeepTheImageOfAPly) {
  const std::string in = TemporaryPath("in.ply"), out = TemporaryPath("out.ply");
  PutFile(in,
          "ply\nformat ascii 1.0\ncomment TextureFile skin.png\nelement vertex 3\nproperty float x\nproperty float y\n"
          "property float z\nproperty float s\nproperty float t\nelement face 1\n"
          "property list uchar int vertex_indices\nend_header\n0 0 0 0 0\n1 0 0 0.1 0\n0 1 0 0 0.1\n3 0 1 2\n");
  const std::string command = PLANISH_COMMAND " pack '" + in + "' -o '" + out + "'";
  EXPECT_THAT(RunShell(command + " --textures=keep").err, HasSubstr("in.ply: --textures=keep cannot leave the UV"));
  const Outcome dropped = RunShell(command);
  EXPECT_EQ(dropped.exit_code, 0) << dropped.err;
  EXPECT_THAT(dropped.err, ::testing::AllOf(HasSubstr("TEXTURE_DROPPED"), HasSubstr("(skin.png)")));
  EXPECT_THAT(ReadFile(out), ::testing::Not(HasSubstr("TextureFile")));
}

TEST(TransferCommand, TakesTheMapOfAFileWhoseTrianglesAreInAnotherOrder) {
  const TextureImage image = SmoothTexture(128, 128, 0.1, 1);
  const Sheet sheet(4, {image}, kColored);
  const MeshFile from = sheet.File();
  const std::string in = TemporaryPath("from.glb"), to = TemporaryPath("to.obj"), out = TemporaryPath("out.glb");
  PutFile(in, sheet.Bytes());
  const std::vector<double> uv = Turned(from.mesh, 4, 0.5, 0.6);
  std::string obj;
  const std::int64_t faces = from.mesh.num_polygons();
  for (std::int64_t f = faces; f-- > 0;) {
    for (const std::int64_t c : {3 * f + 1, 3 * f + 2, 3 * f}) {
      const Vec3& p =
          from.mesh.positions[static_cast<std::size_t>(from.mesh.corner_vertex[static_cast<std::size_t>(c)])];
      std::ostringstream text;
      text << std::setprecision(17) << "v " << p.x() << " " << p.y() << " " << p.z() << "\nvt "
           << uv[static_cast<std::size_t>(2 * c)] << " " << uv[static_cast<std::size_t>(2 * c + 1)] << "\n";
      obj += text.str();
    }
    obj += "f -3/-3 -2/-2 -1/-1\n";
  }
  PutFile(to, obj);
  const std::string command = std::string(PLANISH_COMMAND) + " transfer '" + in + "' '" + to + "' -o '" + out + "'";
  const Outcome done = RunShell(command);
  ASSERT_EQ(done.exit_code, 0) << done.err;
  const absl::StatusOr<MeshFile> after = ReadMeshFile(out);
  ASSERT_TRUE(after.ok()) << after.status();
  EXPECT_LE(Compare(image, ImageOf(*after, 0), Pairs(from, *after), 20000).mean, 2);
  PutFile(to, obj + "v 5 5 5\nf -1 -2 -3\n");
  EXPECT_EQ(RunShell(command).exit_code, 0) << "more triangles than are asked for";
  PutFile(to, obj.substr(0, obj.size() - 20));
  const Outcome differs = RunShell(command);
  EXPECT_EQ(differs.exit_code, 1);
  EXPECT_THAT(differs.err, HasSubstr("SURFACES_DIFFER"));
}

}  // namespace
}  // namespace planish
