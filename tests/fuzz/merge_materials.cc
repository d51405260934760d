// glTF files whose materials are merged and whose vertex colours are painted (--merge-materials, --bake=colors). The
// first bytes edit the JSON, which mutations of its text would mostly break.
#include <algorithm>
#include <cstddef>
#include <cstdint>
#include <initializer_list>
#include <iterator>
#include <random>
#include <string>
#include <string_view>
#include <vector>

#include "client/files/gltf_document.h"
#include "client/files/gltf_mesh.h"
#include "client/files/mesh_output.h"
#include "client/files/readers.h"
#include "core/base/error.h"
#include "tests/fuzz/check.h"
#include "tests/fuzz/memory_budget.h"

namespace planish::fuzz::merge_materials {
namespace {

constexpr std::int64_t kMemory = std::int64_t{256} << 20;
constexpr std::int64_t kImageMemory = std::int64_t{16} << 20;
constexpr int kTexels = 16;
constexpr std::size_t kMostCorners = 3000;
// Nothing beside it can be read.
constexpr char kPath[] = "/no such directory/in.gltf";

// A value in `root` that bytes of the input lead to, at most 12 levels deep.
Json* Chosen(Json* root, Bytes* input) {
  Json* at = root;
  for (int depth = 0; depth < 12 && at->is_structured() && !at->empty(); ++depth) {
    const int choice = input->Byte();
    if (depth > 0 && choice >= 240) break;
    at = &*std::next(at->begin(), choice % static_cast<int>(at->size()));
  }
  return at;
}

void Edit(Json* root, Bytes* input) {
  Json* const at = Chosen(root, input);
  switch (input->Below(12)) {
    case 0:
      *at = -1;
      break;
    case 1:
      *at = input->Byte();
      break;
    case 2:
      *at = std::int64_t{1} << input->Below(63);
      break;
    case 3:
      *at = 1e300 * (input->Byte() - 128);
      break;
    case 4:
      *at = nullptr;
      break;
    case 5:
      *at = std::string(input->Take(4));
      break;
    case 6:
      *at = Json::object();
      break;
    case 7:
      *at = Json::array();
      break;
    case 8:
      *at = input->Below(2) == 0;
      break;
    case 9:
      if (at->is_structured() && !at->empty()) at->erase(std::next(at->begin(), input->Byte() % std::ssize(*at)));
      break;
    case 10: {
      const Json other = *Chosen(root, input);
      if (at->is_array()) {
        at->push_back(other);
      } else {
        *at = other;
      }
      break;
    }
    default: {
      Json* const other = Chosen(root, input);
      const Json mine = *at, theirs = *other;
      *other = mine;  // before *at, which may contain it
      if (at != other && !at->is_structured()) *at = theirs;
    }
  }
}

std::string Edited(std::string_view text, int edits, Bytes* input) {
  Json json = Json::parse(text, nullptr, /*allow_exceptions=*/false);
  if (json.is_discarded()) return std::string(text);
  for (int i = 0; i < edits; ++i) Edit(&json, input);
  return json.dump(-1, ' ', false, Json::error_handler_t::replace);
}

}  // namespace

// Bytes that choose the edits, made of all of `bytes`: any mutation of them makes other edits.
std::string DrawnFrom(std::string_view bytes) {
  std::uint32_t hash = 2166136261U;  // FNV-1a
  for (const char c : bytes) hash = (hash ^ static_cast<unsigned char>(c)) * 16777619U;
  std::mt19937 random(hash);
  std::string drawn(96, '\0');
  for (char& c : drawn) c = static_cast<char>(random());
  return drawn;
}

// How many edits, how to write, and bytes that choose the edits. The text of the glTF begins with the first brace. With
// 128 or more in the first byte the edits are drawn from the others: they are many in the corpus, since most mutations
// of the text make it no JSON.
FUZZ_TARGET(merge_materials, bytes) {
  const MemoryBudget budget(kMemory);
  const std::size_t brace = std::min(bytes.find('{'), bytes.size());
  Bytes input(bytes.substr(0, brace));
  const int edits = input.Byte();
  const int how = input.Byte();
  const std::string_view given = input.Rest();
  const std::string choices = edits >= 128 ? DrawnFrom(given) : std::string(given);
  Bytes chosen(choices);
  const std::string text = Edited(bytes.substr(brace), edits % 128 % 5, &chosen);
  MeshFile file;
  file.path = kPath;
  file.format = MeshFormat::kGltf;
  auto mesh = ReadGltf(kPath, text, 0, &file.gltf);
  if (!mesh.ok()) {
    return RequireReason(mesh.status(), {"FILE_MALFORMED", "FILE_UNSUPPORTED", "FILE_UNREADABLE", "OUT_OF_MEMORY"});
  }
  if (mesh->corner_vertex.size() > kMostCorners) return;
  file.bytes = text;
  file.mesh = *std::move(mesh);

  OutputOptions output;
  output.path = "/no such directory/out.glb";
  output.format = MeshFormat::kGlb;
  output.texcoord = how / 16 % 2;
  output.textures.mode = TextureMode::kTransfer;
  output.textures.merge_materials = how % 4 != 3;
  output.textures.bake_colors = how % 4 >= 2;
  output.textures.size = how / 4 % 4 == 3 ? 0 : kTexels;
  output.textures.memory = kImageMemory;
  const std::int64_t corners = std::ssize(file.mesh.corner_vertex);
  if (how >= 128) {
    output.textures.polygon_atlas.resize(static_cast<std::size_t>(file.mesh.num_polygons()), 0);
  }
  // A map of small triangles, each in a place of its own; some beyond the image.
  std::vector<double> uv;
  for (std::int64_t c = 0; c < corners; ++c) {
    const auto face = static_cast<double>(c / 3 % 64);
    uv.push_back((face + (c % 3 == 1 ? 0.9 : 0.1)) / 32);
    uv.push_back((c % 3 == 2 ? 0.9 : 0.1) + (how == 127 ? 1e6 : 0));
  }
  const std::initializer_list<std::string_view> reasons = {
      "FILE_MALFORMED", "FILE_UNSUPPORTED",   "FILE_UNREADABLE", "FILE_TOO_LARGE",
      "OUT_OF_MEMORY",  "OUTPUT_UNSUPPORTED", "IMAGE_MALFORMED", "IMAGE_UNSUPPORTED",
      "IMAGE_OUTSIDE",  "TEXTURE_ANIMATED",   "TEXTURE_MEMORY",  "OPTIONS_INVALID"};
  const absl::Status check = CheckOutput(file, output);
  if (!check.ok()) return RequireReason(check, reasons);
  const absl::StatusOr<double> side = EstimateTextureSide(file, output, 1);
  if (!side.ok()) return RequireReason(side.status(), reasons);
  const absl::StatusOr<WrittenMesh> written = WriteMeshWithUv(file, uv, output);
  if (!written.ok()) return RequireReason(written.status(), reasons);
  const auto again = ReadGltf(kPath, written->files.back().bytes, output.texcoord, &file.gltf);
  Require(again.ok(), "what was written here can be read: " + again.status().ToString());
  Require(again->corner_vertex.size() == static_cast<std::size_t>(corners), "writing keeps corners");
}

}  // namespace planish::fuzz::merge_materials
