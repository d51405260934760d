#include "client/cli/report_images.h"

#include <algorithm>
#include <array>
#include <bit>
#include <cmath>
#include <cstddef>
#include <cstdint>
#include <limits>
#include <map>
#include <optional>
#include <unordered_map>
#include <utility>

#include "absl/strings/escaping.h"
#include "client/src/errors.h"
#include "client/texture/image.h"
#include "client/texture/texture_baker.h"
#include "core/base/thread_team.h"

namespace planish::cli {
namespace {

// Redraws the image with 8 bits, `divisor` times smaller. A new texel is the mean of the old texels that it covers, of
// colours in linear light.
TextureImage Shrunk(const TextureImage& image, bool is_color, int divisor) {
  ImageHeader header = image.header;
  header.bits = 8;
  header.width = std::max(1, header.width / divisor);
  header.height = std::max(1, header.height / divisor);
  std::array<TextureTriangle, 2> all;
  all[0].from = all[0].to = {Vec2(0, 0), Vec2(1, 0), Vec2(1, 1)};
  all[1].from = all[1].to = {Vec2(0, 0), Vec2(1, 1), Vec2(0, 1)};
  TextureSource source;
  source.image = &image;
  source.wrap_u = source.wrap_v = TextureWrap::kClamp;
  ThreadTeam team(1);
  TextureBaker baker(header, &team);
  const absl::Status drawn = baker.Draw(
      source, {all},
      {is_color ? TextureMeaning::kColor : TextureMeaning::kData, /*premultiplied=*/is_color && header.has_alpha()});
  if (!drawn.ok()) throw ErrorFrom(drawn);
  TextureImage small = baker.Finish();
  small.is_lossless = image.is_lossless;
  small.color_chunks = image.color_chunks;
  return small;
}

// The places of the corners of a triangle, beginning with the least, so that triangles are equal if they are the same.
using TrianglePlaces = std::array<float, 9>;

TrianglePlaces TrianglePlacesOf(const Mesh& mesh, std::size_t face) {
  std::array<std::array<float, 3>, 3> corners;
  for (std::size_t k = 0; k < 3; ++k) {
    const Vec3& p = mesh.positions[static_cast<std::size_t>(mesh.faces[face][k])];
    for (std::size_t i = 0; i < 3; ++i) corners[k][i] = static_cast<float>(p[static_cast<int>(i)]) + 0.0F;
  }
  std::rotate(corners.begin(), std::min_element(corners.begin(), corners.end()), corners.end());
  TrianglePlaces places;
  for (std::size_t i = 0; i < 9; ++i) places[i] = corners[i / 3][i % 3];
  return places;
}

struct TrianglePlacesHash {
  std::size_t operator()(const TrianglePlaces& places) const {
    std::uint64_t hash = 0;
    for (const float x : places) hash = (hash ^ std::bit_cast<std::uint32_t>(x)) * 0x9E3779B97F4A7C15U;
    return hash ^ (hash >> 32);
  }
};

Vec2 MiddleInMap(const std::vector<double>& uv, std::size_t face) {
  Vec2 sum = Vec2::Zero();
  for (std::size_t k = 0; k < 3; ++k) sum += Vec2(uv[6 * face + 2 * k], uv[6 * face + 2 * k + 1]);
  return sum / 3;
}

// Finds the triangles of a map in the file that was written.
class WrittenTriangles {
 public:
  explicit WrittenTriangles(const MeshInput& written) : mesh_(written.mesh()), uv_(written.CornerUv()) {
    for (std::size_t f = 0; f < mesh_.faces.size(); ++f) by_places_.emplace(TrianglePlacesOf(mesh_, f), f);
  }

  // The triangle with the same corners; if there are several, the nearest in the map.
  std::optional<std::size_t> Find(const CheckedMap& map, std::size_t face) const {
    const auto [begin, end] = by_places_.equal_range(TrianglePlacesOf(map.mesh, face));
    const Vec2 middle = MiddleInMap(map.uv, face);
    std::optional<std::size_t> found;
    double least = std::numeric_limits<double>::infinity();
    for (auto i = begin; i != end; ++i) {
      const double distance = (MiddleInMap(uv_, i->second) - middle).norm();
      if (distance < least) least = distance, found = i->second;
    }
    return found;
  }

  // The corner of `found` at the place of corner k of a face that it was found for.
  std::size_t CornerOf(std::size_t found, const CheckedMap& map, std::size_t face, std::size_t k) const {
    const Vec3& place = map.mesh.positions[static_cast<std::size_t>(map.mesh.faces[face][k])];
    std::size_t nearest = 0;
    for (std::size_t j = 1; j < 3; ++j) {
      if ((At(found, j) - place).squaredNorm() < (At(found, nearest) - place).squaredNorm()) nearest = j;
    }
    return 3 * found + nearest;
  }

 private:
  const Vec3& At(std::size_t face, std::size_t k) const {
    return mesh_.positions[static_cast<std::size_t>(mesh_.faces[face][k])];
  }

  const Mesh& mesh_;
  const std::vector<double> uv_;
  std::unordered_multimap<TrianglePlaces, std::size_t, TrianglePlacesHash> by_places_;
};

// The colours of a glTF's corners have the factors of the materials in them.
void LeaveFactorsToColors(MapTextures* textures) {
  if (textures->colors.empty()) return;
  for (BaseColor& color : textures->list) color.factor = {1, 1, 1, 1};
}

bool ShowsNoImage(const std::vector<BaseColor>& colors) {
  return std::all_of(colors.begin(), colors.end(),
                     [](const BaseColor& color) { return color.image < 0 && color.normals.image < 0; });
}

}  // namespace

std::int64_t ReportImages::Add(const std::string& name, const absl::StatusOr<std::string>& bytes, bool is_color) {
  const absl::StatusOr<ImageHeader> header =
      bytes.ok() ? ReadImageHeader(*bytes, name) : absl::StatusOr<ImageHeader>(bytes.status());
  if (!header.ok()) {
    notes_.push_back(name + " is not shown: " + ErrorFrom(header.status()).what());
    return -1;
  }
  for (std::size_t i = 0; i < images_.size(); ++i) {
    if (images_[i].bytes == *bytes && images_[i].is_color == is_color) return static_cast<std::int64_t>(i);
  }
  images_.push_back(
      {name, *bytes, header->width, header->height, header->width, header->height, MimeType(header->kind), is_color});
  return static_cast<std::int64_t>(images_.size()) - 1;
}

std::vector<BaseColor> ReportImages::Read(const MeshInput& input, int texcoord, bool allow_outside) {
  std::vector<BaseColor> all;
  for (const MeshFile* const file : input.Files()) {
    const BaseColorReader reader(*file, allow_outside);
    std::vector<BaseColor> colors = reader.of_material();
    colors.resize(file->mesh.material_names.size());
    std::map<std::pair<std::int64_t, bool>, std::int64_t> number;
    const auto add = [&](ShownImage* shown, bool is_color) {
      const std::int64_t image = shown->texcoord == (file->gltf ? texcoord : 0) ? shown->image : -1;
      shown->image = -1;
      if (image < 0) return;
      const auto [known, is_new] = number.insert({{image, is_color}, -1});
      if (is_new) known->second = Add(shown->image_name, reader.Image(image), is_color);
      shown->image = known->second;
    };
    for (BaseColor& color : colors) {
      add(&color, true);
      add(&color.normals, false);
    }
    all.insert(all.end(), colors.begin(), colors.end());
  }
  return all;
}

MapTextures ReportImages::Of(const MeshInput& input, const CheckedMap& map, int texcoord, bool colors_suffice,
                             bool allow_outside) {
  MapTextures textures;
  std::vector<BaseColor> list = Read(input, texcoord, allow_outside);
  if (ShowsNoImage(list) && !colors_suffice) return textures;
  const std::vector<CornerColor> colors = input.CornerColors();
  for (std::size_t f = 0; f < map.mesh.faces.size(); ++f) {
    textures.of_face.push_back(map.material_of_face.empty() ? -1 : map.material_of_face[f]);
    if (colors.empty()) continue;
    const auto triangle = static_cast<std::size_t>(map.triangle_of_face[f]);
    for (std::size_t k = 0; k < 3; ++k) textures.colors.push_back(colors[3 * triangle + k]);
  }
  textures.list = std::move(list);
  LeaveFactorsToColors(&textures);
  return textures;
}

MapTextures ReportImages::OfWritten(const MeshInput& written, const CheckedMap& map, int texcoord) {
  MapTextures textures;
  const std::vector<std::int32_t> materials = written.FaceMaterials();
  if (materials.empty()) return textures;
  std::vector<BaseColor> list = Read(written, texcoord, true);
  if (ShowsNoImage(list)) return textures;
  const std::vector<CornerColor> colors = written.CornerColors();
  const WrittenTriangles triangles(written);
  for (std::size_t f = 0; f < map.mesh.faces.size(); ++f) {
    const std::optional<std::size_t> found = triangles.Find(map, f);
    textures.of_face.push_back(found ? materials[*found] : -1);
    for (std::size_t k = 0; k < 3 && !colors.empty(); ++k) {
      textures.colors.push_back(found ? colors[triangles.CornerOf(*found, map, f, k)] : CornerColor{1, 1, 1, 1});
    }
  }
  textures.list = std::move(list);
  LeaveFactorsToColors(&textures);
  return textures;
}

void ReportImages::Shrink(int divisor) {
  for (Image& image : images_) {
    absl::StatusOr<TextureImage> decoded = DecodeImage(image.bytes, image.name);
    if (!decoded.ok()) throw ErrorFrom(decoded.status());
    const TextureImage small = Shrunk(*decoded, image.is_color, divisor);
    absl::StatusOr<std::string> bytes = EncodeImage(small);
    if (!bytes.ok()) throw ErrorFrom(bytes.status());
    image.bytes = *std::move(bytes);
    image.width = small.header.width;
    image.height = small.header.height;
  }
}

std::string ReportImages::Write(Json* page) {
  for (;;) {
    std::size_t bytes = 0;
    int side = 0;
    for (const Image& image : images_) {
      bytes += image.bytes.size();
      side = std::max({side, image.width, image.height});
    }
    int divisor = 1;
    while (side / divisor > kMostSide || bytes / static_cast<std::size_t>(divisor * divisor) > kMostBytes) divisor *= 2;
    if (divisor == 1 || side == 1) break;
    Shrink(divisor);
  }
  std::string elements;
  for (std::size_t i = 0; i < images_.size(); ++i) {
    const Image& image = images_[i];
    (*page)["images"].push_back({{"name", image.name},
                                 {"type", image.type},
                                 {"width", image.width},
                                 {"height", image.height},
                                 {"fileWidth", image.file_width},
                                 {"fileHeight", image.file_height}});
    elements += "<script type=\"text/plain\" id=\"planish-image-" + std::to_string(i) + "\">" +
                absl::Base64Escape(image.bytes) + "</script>\n";
  }
  if (!notes_.empty()) (*page)["imageNotes"] = notes_;
  return elements;
}

}  // namespace planish::cli
