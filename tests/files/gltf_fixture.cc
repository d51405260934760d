#include "tests/files/gltf_fixture.h"

#include <cstdint>
#include <cstring>
#include <vector>

#include "absl/strings/escaping.h"
#include "client/files/gltf_document.h"
#include "core/draco/points.h"

namespace planish {
namespace {

template <typename T>
std::string Packed(const std::vector<T>& values) {
  std::string bytes(values.size() * sizeof(T), '\0');
  if (!values.empty()) std::memcpy(bytes.data(), values.data(), bytes.size());
  return bytes;
}

class Builder {
 public:
  Builder() {
    fixture.json["asset"] = {{"version", "2.0"}, {"generator", "a test"}, {"extras", {{"big", 12345678901234}}}};
    fixture.json["accessors"] = Json::array();
    fixture.json["bufferViews"] = Json::array();
  }

  int View(const std::string& bytes, int stride = 0, int target = 0) {
    fixture.buffer.resize((fixture.buffer.size() + 3) / 4 * 4, '\0');
    Json view = {{"buffer", 0}, {"byteOffset", fixture.buffer.size()}, {"byteLength", bytes.size()}};
    if (stride > 0) view["byteStride"] = stride;
    if (target > 0) view["target"] = target;
    fixture.json["bufferViews"].push_back(view);
    fixture.buffer += bytes;
    return static_cast<int>(fixture.json["bufferViews"].size()) - 1;
  }

  int Accessor(int view, int component, std::size_t count, const char* type, const Json& more = Json::object()) {
    Json accessor = {{"componentType", component}, {"count", count}, {"type", type}};
    if (view >= 0) accessor["bufferView"] = view;
    accessor.update(more);
    fixture.json["accessors"].push_back(accessor);
    return static_cast<int>(fixture.json["accessors"].size()) - 1;
  }

  GltfFixture fixture;
};

constexpr int kVertices = 12;

// Columns 0, 1, 1 again, 2 of a grid, from below.
Json GridAttributes(Builder* b) {
  std::vector<float> positions, normals, tangents, weights, inverse;
  std::vector<std::uint8_t> colors, joints;
  std::vector<std::uint16_t> texcoords, temperatures;
  const float xs[] = {0, 1, 1, 2};
  for (int column = 0; column < 4; ++column) {
    for (int row = 0; row < 3; ++row) {
      const float x = xs[column];
      const float y = static_cast<float>(row);
      const float slope = column < 2 ? -0.6f : 0.6f;
      positions.insert(positions.end(), {x, y, x == 1 ? 0.5f : 0.0f});
      normals.insert(normals.end(), {slope, 0, 0.8f});
      tangents.insert(tangents.end(), {0.8f, 0, -slope, column < 2 ? 1.0f : -1.0f});
      const auto shade = static_cast<std::uint8_t>(20 * (3 * column + row));
      colors.insert(colors.end(), {shade, 128, 255, 255});
      joints.insert(joints.end(), {0, 1, 0, 0});
      weights.insert(weights.end(), {1 - x / 2, x / 2, 0, 0});
      texcoords.push_back(static_cast<std::uint16_t>(column < 2 ? 16384 * column : 16384 * (column + 1)));
      texcoords.push_back(static_cast<std::uint16_t>(32767 * row));
      // The second half of each element is padding.
      temperatures.insert(temperatures.end(), {static_cast<std::uint16_t>(100 * column + row), 0xFFFF});
    }
  }
  const int n = kVertices;
  Json attributes;
  attributes["POSITION"] = b->Accessor(b->View(Packed(positions), 0, 34962), 5126, n, "VEC3",
                                       {{"min", {0, 0, 0}}, {"max", {2, 2, 0.5}}, {"name", "where"}});
  attributes["NORMAL"] = b->Accessor(b->View(Packed(normals), 0, 34962), 5126, n, "VEC3");
  attributes["TANGENT"] = b->Accessor(b->View(Packed(tangents), 0, 34962), 5126, n, "VEC4");
  attributes["COLOR_0"] = b->Accessor(b->View(Packed(colors), 0, 34962), 5121, n, "VEC4", {{"normalized", true}});
  attributes["TEXCOORD_0"] = b->Accessor(b->View(Packed(texcoords), 0, 34962), 5123, n, "VEC2", {{"normalized", true}});
  attributes["JOINTS_0"] = b->Accessor(b->View(Packed(joints), 0, 34962), 5121, n, "VEC4");
  attributes["WEIGHTS_0"] = b->Accessor(b->View(Packed(weights), 0, 34962), 5126, n, "VEC4");
  attributes["_TEMPERATURE"] = b->Accessor(b->View(Packed(temperatures), 4, 34962), 5123, n, "SCALAR");
  return attributes;
}

int SparseTarget(Builder* b) {
  const Json sparse = {{"count", 2},
                       {"indices", {{"bufferView", b->View(Packed<std::uint8_t>({3, 6}))}, {"componentType", 5121}}},
                       {"values", {{"bufferView", b->View(Packed<float>({0, 0, 0.25f, 0, 0, 0.25f}))}}}};
  return b->Accessor(-1, 5126, kVertices, "VEC3", {{"sparse", sparse}, {"min", {0, 0, 0}}, {"max", {0, 0, 0.25}}});
}

Json FirstMesh(Builder* b) {
  const Json grid = GridAttributes(b);
  const Json targets = Json::array({{{"POSITION", SparseTarget(b)}}});
  const auto indices = [&](const std::vector<std::uint16_t>& list) {
    return b->Accessor(b->View(Packed(list), 0, 34963), 5123, list.size(), "SCALAR");
  };
  Json primitives = Json::array();
  primitives.push_back({{"attributes", grid},
                        {"targets", targets},
                        {"indices", indices({0, 3, 1, 3, 4, 1, 1, 4, 2, 4, 5, 2})},
                        {"material", 0},
                        {"extras", {{"side", "left"}}}});
  primitives.push_back({{"attributes", grid},
                        {"targets", targets},
                        {"indices", indices({6, 9, 7, 9, 10, 7, 7, 10, 8, 10, 11, 8})},
                        {"material", 1}});
  // A strip of four triangles, its vertices in a row of their own.
  Json strip_attributes;
  std::vector<float> row;
  for (int i = 0; i < 6; ++i) row.insert(row.end(), {static_cast<float>(i / 2), i % 2 == 0 ? -2.0f : -1.0f, 0});
  strip_attributes["POSITION"] =
      b->Accessor(b->View(Packed(row), 0, 34962), 5126, 6, "VEC3", {{"min", {0, -2, 0}}, {"max", {2, -1, 0}}});
  Json strip_target;
  strip_target["POSITION"] = b->Accessor(-1, 5126, 6, "VEC3", {{"min", {0, 0, 0}}, {"max", {0, 0, 0}}});
  primitives.push_back(
      {{"attributes", strip_attributes},
       {"targets", Json::array({strip_target})},
       {"indices", b->Accessor(b->View(Packed<std::uint8_t>({1, 0, 3, 2, 5, 4}), 0, 34963), 5121, 6, "SCALAR")},
       {"mode", 5}});
  // Lines share the positions of the strip.
  primitives.push_back(
      {{"attributes", strip_attributes},
       {"targets", Json::array({strip_target})},
       {"indices", b->Accessor(b->View(Packed<std::uint8_t>({0, 2, 2, 4}), 0, 34963), 5121, 4, "SCALAR")},
       {"mode", 1}});
  return {{"name", "grid"}, {"primitives", primitives}, {"weights", {0.5}}, {"extras", {{"targetNames", {"bulge"}}}}};
}

// Two triangles as shorts, 8 bytes a position, interleaved with a normal of bytes.
Json SecondMesh(Builder* b) {
  const std::int16_t corners[6][3] = {{0, 0, 0},     {32767, 0, 0}, {0, 32767, 0},
                                      {0, 32767, 0}, {32767, 0, 0}, {32767, 32767, 0}};
  std::string bytes;
  for (const auto& corner : corners) {
    bytes += Packed<std::int16_t>({corner[0], corner[1], corner[2], 0});
    bytes += Packed<std::int8_t>({0, 0, 127, 0});
  }
  const int view = b->View(bytes, 12, 34962);
  Json attributes;
  attributes["POSITION"] =
      b->Accessor(view, 5122, 6, "VEC3", {{"normalized", true}, {"min", {0, 0, 0}}, {"max", {32767, 32767, 0}}});
  attributes["NORMAL"] = b->Accessor(view, 5120, 6, "VEC3", {{"normalized", true}, {"byteOffset", 8}});
  return {{"name", "quantized"}, {"primitives", Json::array({{{"attributes", attributes}, {"material", 1}}})}};
}

}  // namespace

std::string GltfFixture::Glb() const {
  Json whole = json;
  whole["buffers"] = Json::array({{{"byteLength", buffer.size()}}});
  return GlbBytes(whole, buffer, "").value();
}

std::string GltfFixture::Gltf() const {
  Json whole = json;
  whole["buffers"] = Json::array(
      {{{"byteLength", buffer.size()}, {"uri", "data:application/octet-stream;base64," + absl::Base64Escape(buffer)}}});
  return whole.dump(2);
}

GltfFixture SampleGltf() {
  Builder b;
  Json& json = b.fixture.json;
  json["extensionsUsed"] = {"KHR_materials_unlit", "KHR_mesh_quantization", "EXT_unheard_of"};
  json["extensionsRequired"] = {"KHR_mesh_quantization"};
  json["extensions"] = {
      {"EXT_unheard_of", {{"list", {1.5, nullptr, Json::array()}}, {"deep", {{"k", 9007199254740993}}}}}};
  json["meshes"] = Json::array({FirstMesh(&b), SecondMesh(&b)});
  std::vector<float> inverse;
  for (int joint = 0; joint < 2; ++joint) {
    inverse.insert(inverse.end(), {1, 0, 0, 0, 0, 1, 0, 0, 0, 0, 1, 0, joint == 0 ? 0.0f : -2.0f, 0, 0, 1});
  }
  json["skins"] = Json::array(
      {{{"inverseBindMatrices", b.Accessor(b.View(Packed(inverse)), 5126, 2, "MAT4")}, {"joints", {2, 3}}}});
  json["nodes"] = Json::array({{{"mesh", 0}, {"skin", 0}, {"name", "skinned"}},
                               {{"mesh", 0}, {"name", "again"}, {"translation", {10, 0, 0}}},
                               {{"name", "root"}, {"children", {3}}},
                               {{"name", "tip"}, {"translation", {2, 0, 0}}},
                               {{"mesh", 1}, {"name", "small"}, {"scale", {4, 4, 4}}}});
  json["scenes"] = Json::array({{{"nodes", {0, 1, 2, 4}}}});
  json["scene"] = 0;
  const int times = b.Accessor(b.View(Packed<float>({0, 1})), 5126, 2, "SCALAR", {{"min", {0}}, {"max", {1}}});
  const int angles = b.Accessor(b.View(Packed<float>({0, 0, 0, 1, 0, 0, 0.6f, 0.8f})), 5126, 2, "VEC4");
  json["animations"] =
      Json::array({{{"name", "wave"},
                    {"samplers", Json::array({{{"input", times}, {"output", angles}}})},
                    {"channels", Json::array({{{"sampler", 0}, {"target", {{"node", 3}, {"path", "rotation"}}}}})}}});
  std::string png;
  absl::Base64Unescape(
      "iVBORw0KGgoAAAANSUhEUgAAAAEAAAABCAYAAAAfFcSJAAAADUlEQVR42mP8z8BQDwAEhQGAhKmMIQAAAABJRU5ErkJggg==", &png);
  json["images"] = Json::array({{{"bufferView", b.View(png)}, {"mimeType", "image/png"}}});
  json["textures"] = Json::array({{{"source", 0}}});
  json["materials"] = Json::array(
      {{{"name", "paint"}, {"pbrMetallicRoughness", {{"baseColorTexture", {{"index", 0}}}, {"metallicFactor", 0.1}}}},
       {{"name", "flat"}, {"extensions", {{"KHR_materials_unlit", Json::object()}}}, {"doubleSided", true}}});
  json["NOT_STANDARD"] = {{"kept", true}};
  return b.fixture;
}

GltfFixture SampleDracoGltf() {
  GltfFixture fixture = SampleGltf();
  Json& json = fixture.json;
  Json& primitives = json["meshes"][0]["primitives"];
  while (primitives.size() > 1) primitives.erase(1);
  DracoPoints points;
  points.num_points = kVertices;
  points.faces = {{0, 3, 1}, {3, 4, 1}, {1, 4, 2}, {4, 5, 2}, {6, 9, 7}, {9, 10, 7}, {7, 10, 8}, {10, 11, 8}};
  DracoAttribute position;
  position.kind = DracoKind::kPosition;
  position.unique_id = 7;
  position.component = kDracoFloat32;
  position.components = 3;
  position.value_size = 12;
  position.quantization_bits = 12;
  position.origin = {0.123456789f, -1e-5f, 0};
  position.range = 2.00000012f;
  DracoAttribute normal = position;
  normal.kind = DracoKind::kNormal;
  normal.unique_id = 9;
  normal.quantization_bits = 0;
  const float step = position.range / 4095;
  std::vector<float> positions, normals;
  const int columns[] = {0, 2047, 2047, 4095};
  for (int v = 0; v < kVertices; ++v) {
    const int grid[] = {columns[v / 3], 1000 * (v % 3), v / 3 == 1 || v / 3 == 2 ? 500 : 0};
    for (std::size_t axis = 0; axis < 3; ++axis) {
      positions.push_back(static_cast<float>(grid[axis]) * step + position.origin[axis]);
    }
    normals.insert(normals.end(), {v < 6 ? -0.6f : 0.6f, 0, 0.8f});
  }
  position.values = Packed(positions);
  normal.values = Packed(normals);
  points.attributes = {position, normal};

  Builder b;
  b.fixture = fixture;
  const int view = b.View(EncodeDracoPoints(points).value());
  fixture = b.fixture;
  Json& primitive = fixture.json["meshes"][0]["primitives"][0];
  primitive["extensions"]["KHR_draco_mesh_compression"] = {{"bufferView", view},
                                                           {"attributes", {{"POSITION", 7}, {"NORMAL", 9}}}};
  for (const char* name : {"POSITION", "NORMAL"}) {
    fixture.json["accessors"][primitive["attributes"][name].get<std::size_t>()].erase("bufferView");
  }
  Json& indices = fixture.json["accessors"][primitive["indices"].get<std::size_t>()];
  indices.erase("bufferView");
  indices["count"] = 24;
  fixture.json["extensionsUsed"].push_back("KHR_draco_mesh_compression");
  fixture.json["extensionsRequired"].push_back("KHR_draco_mesh_compression");
  return fixture;
}

}  // namespace planish
