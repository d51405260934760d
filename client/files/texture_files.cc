#include "client/files/texture_files.h"

#include <algorithm>
#include <cctype>
#include <cmath>
#include <filesystem>
#include <optional>
#include <system_error>
#include <utility>

#include "client/files/file_io.h"
#include "core/base/error.h"
#include "core/base/status_macros.h"
#include "core/base/thread_team.h"

namespace planish {

namespace fs = std::filesystem;

namespace {

constexpr std::int64_t kLargestImageFile = std::int64_t{1} << 30;

// Resolves symbolic links as far as the path exists.
fs::path Resolved(const fs::path& path) {
  std::error_code error;
  const fs::path resolved = fs::weakly_canonical(path, error);
  return error ? fs::absolute(path, error).lexically_normal() : resolved;
}

std::string Megabytes(std::int64_t bytes) {
  return std::to_string((bytes + 999999) / 1000000) + " MB";
}

}  // namespace

absl::StatusOr<std::string> ReadImageFile(const std::string& model, const std::string& name, bool allow_outside) {
  const fs::path folder = fs::path(model).parent_path();
  const fs::path path = folder / name;
  if (!allow_outside) {
    const fs::path inside = Resolved(path).lexically_relative(Resolved(folder.empty() ? fs::path(".") : folder));
    if (inside.empty() || *inside.begin() == "..") {
      return MakeError(absl::StatusCode::kInvalidArgument, "IMAGE_OUTSIDE",
                       model + ": the image " + name +
                           " does not lie in the folder of the model; --allow-outside reads it all the same",
                       {{"image", name}});
    }
  }
  return ReadFileStart(path.string(), kLargestImageFile);
}

absl::Status WithTextureAdvice(const absl::Status& status) {
  const ErrorInfo info = ErrorInfoOf(status);
  if (status.ok() || info.reason == "CANCELLED" || info.reason == "IMAGE_OUTSIDE") return status;
  return MakeError(status.code(), info.reason,
                   std::string(status.message()) +
                       ". It must be read, as the new map moves its texture; --textures=keep leaves the textures "
                       "and their UV as they are (glTF), --textures=drop removes them",
                   info.metadata);
}

namespace {

// The side of an image that needs `wanted` texels per side to keep its texel density; options.size if that is set.
// Warns if the side would be larger than kLargestAutoTexture.
int SideFor(double wanted, int least, const std::string& name, const TextureOptions& options,
            std::vector<OutputWarning>* warnings) {
  if (options.size != 0) return options.size;
  // Rounds up to a multiple of four, which GPUs can compress.
  const double rounded = 4 * std::ceil(std::min(wanted, 1e9) / 4 - 1e-9);
  const int side = std::min(kLargestAutoTexture, std::max(least, static_cast<int>(rounded)));
  if (rounded > kLargestAutoTexture) {
    warnings->push_back({"TEXTURE_SIZE", name + " would take " + std::to_string(static_cast<std::int64_t>(rounded)) +
                                             " texels per side to keep its texel density; it gets " +
                                             std::to_string(side) + " (--texture-size sets another size)"});
  }
  return side;
}

// TEXTURE_MEMORY unless options.memory suffices to draw image `old`, from a file of `file_bytes`, into an image with
// `header`. `is_part`: the new image exists already. Otherwise the old image is freed before the new one is allocated.
absl::Status CheckMemory(const std::string& name, std::int64_t file_bytes, const ImageHeader& old,
                         const ImageHeader& header, bool is_part, const TextureOptions& options) {
  const std::int64_t result = 2 * header.bytes() + (is_part ? 6 : 2) * header.texels();
  const std::int64_t memory =
      file_bytes + TextureBaker::SourceBytes(old) + (is_part ? old.bytes() + result : std::max(old.bytes(), result));
  if (options.memory == 0 || memory <= options.memory) return absl::OkStatus();
  return MakeError(absl::StatusCode::kResourceExhausted, "TEXTURE_MEMORY",
                   name + ": resampling " + std::to_string(old.width) + " x " + std::to_string(old.height) +
                       " texels into " + std::to_string(header.width) + " x " + std::to_string(header.height) +
                       " takes " + Megabytes(memory) + " of memory, and the limit is " + Megabytes(options.memory) +
                       "; --texture-size makes the new image smaller, --memory raises the limit",
                   {{"image", name}, {"bytes", std::to_string(memory)}});
}

// Draws `image` by the triangles of `bake`. `first`: see TextureGeometry.
absl::Status DrawPart(TextureImage* image, const TextureBake& bake, std::size_t first, const TextureOptions& options,
                      TextureBaker* baker) {
  TextureSource source;
  source.image = image;
  source.spent = image;
  source.wrap_u = bake.wrap_u;
  source.wrap_v = bake.wrap_v;
  source.nearest = bake.nearest;
  BakeOptions how = bake.options;
  const bool is_direction = how.meaning == TextureMeaning::kNormal || how.meaning == TextureMeaning::kDirection;
  if (image->header.channels < 3 && is_direction) how.meaning = TextureMeaning::kData;
  TextureGeometry geometry = {bake.triangles, {}, bake.colors, first};
  if (how.meaning == TextureMeaning::kNormal || how.meaning == TextureMeaning::kDirection)
    geometry.frames = bake.frames;
  return baker->Draw(source, geometry, how, options.stop);
}

TextureImage WhiteTexel() {
  TextureImage image;
  image.header = {ImageKind::kPng, 1, 1, 3, 8};
  image.texels = {255, 255, 255};
  return image;
}

bool HaveTheSame(const std::vector<TextureImage::ColorChunk>& a, const std::vector<TextureImage::ColorChunk>& b) {
  return std::equal(a.begin(), a.end(), b.begin(), b.end(),
                    [](const auto& x, const auto& y) { return x.type == y.type && x.data == y.data; });
}

}  // namespace

absl::StatusOr<std::string> BakeImage(std::string bytes, const TextureBake& bake, const TextureOptions& options,
                                      std::vector<OutputWarning>* warnings) {
  PLANISH_ASSIGN_OR_RETURN(const ImageHeader old, ReadImageHeader(bytes, bake.name));
  ImageHeader header = old;
  const bool is_constant = options.size == 0 && old.texels() <= 1;
  header.width = header.height = is_constant ? 1
                                             : SideFor(TextureSideOf(bake.triangles, bake.areas, old.width, old.height),
                                                       options.least_size, bake.name, options, warnings);
  PLANISH_RETURN_IF_ERROR(CheckMemory(bake.name, std::ssize(bytes), old, header, /*is_part=*/false, options));
  PLANISH_ASSIGN_OR_RETURN(TextureImage image, DecodeImage(bytes, bake.name));
  bytes = std::string();  // frees the file, since an image may be large
  ThreadTeam team(std::max(1, options.threads));
  TextureBaker baker(header, &team);
  PLANISH_RETURN_IF_ERROR(DrawPart(&image, bake, 0, options, &baker));
  TextureImage result = baker.Finish();
  result.header.kind = old.kind;
  result.is_lossless = image.is_lossless;
  result.color_chunks = std::move(image.color_chunks);
  return EncodeImage(result);
}

double SideOfVertexColors(std::span<const TextureTriangle> triangles, std::span<const double> areas) {
  constexpr int kTexelsPerEdge = 2;
  std::vector<TextureTriangle> halves(triangles.begin(), triangles.end());
  for (TextureTriangle& triangle : halves) triangle.from = {Vec2(0, 0), Vec2(1, 0), Vec2(0, 1)};
  return TextureSideOf(halves, areas, kTexelsPerEdge, kTexelsPerEdge);
}

absl::StatusOr<std::string> BakeParts(std::vector<TexturePart> parts, const std::string& name, bool has_alpha,
                                      const TextureOptions& options, std::vector<OutputWarning>* warnings) {
  // Least side, in texels, of an image with constants or painted colours: at the size for which the atlas was packed,
  // charts keep all of the padding between them.
  constexpr int kLeastPainted = 512;
  ImageHeader header = {ImageKind::kPng, 0, 0, has_alpha ? 4 : 3, 8};
  std::optional<ImageKind> kind;
  bool is_one_kind = true;
  int least = options.least_size;
  double wanted = 1;
  std::vector<TextureTriangle> all;
  for (const TexturePart& part : parts) {
    const TextureBake& bake = part.bake;
    all.insert(all.end(), bake.triangles.begin(), bake.triangles.end());
    if (!bake.colors.empty()) wanted = std::max(wanted, SideOfVertexColors(bake.triangles, bake.areas));
    if (!part.read || !bake.colors.empty()) least = std::max({least, 2 * options.least_size, kLeastPainted});
    if (!part.read) continue;
    PLANISH_ASSIGN_OR_RETURN(const std::string bytes, part.read());
    PLANISH_ASSIGN_OR_RETURN(const ImageHeader old, ReadImageHeader(bytes, bake.name));
    if (old.texels() > 1) {
      wanted = std::max(wanted, TextureSideOf(bake.triangles, bake.areas, old.width, old.height));
    }
    header.bits = std::max(header.bits, old.bits);
    is_one_kind = is_one_kind && kind.value_or(old.kind) == old.kind;
    kind = old.kind;
  }
  if (kind && is_one_kind && !(kind == ImageKind::kJpeg && has_alpha)) header.kind = *kind;
  header.width = header.height = SideFor(wanted, least, name, options, warnings);
  ThreadTeam team(std::max(1, options.threads));
  TextureBaker baker(header, &team);
  baker.Claim(all);
  all = std::vector<TextureTriangle>();
  std::optional<std::vector<TextureImage::ColorChunk>> chunks;
  bool is_lossless = true;
  bool have_same_chunks = true;
  std::size_t first = 0;
  for (TexturePart& part : parts) {
    TextureImage image = WhiteTexel();
    if (part.read) {
      PLANISH_ASSIGN_OR_RETURN(std::string bytes, part.read());
      PLANISH_ASSIGN_OR_RETURN(const ImageHeader old, ReadImageHeader(bytes, part.bake.name));
      PLANISH_RETURN_IF_ERROR(CheckMemory(part.bake.name, std::ssize(bytes), old, header, /*is_part=*/true, options));
      PLANISH_ASSIGN_OR_RETURN(image, DecodeImage(bytes, part.bake.name));
      is_lossless = is_lossless && image.is_lossless;
      // The colour profile of a grey image does not apply to colours.
      have_same_chunks = have_same_chunks && old.channels >= 3 && (!chunks || HaveTheSame(*chunks, image.color_chunks));
      chunks = std::move(image.color_chunks);
    }
    PLANISH_RETURN_IF_ERROR(DrawPart(&image, part.bake, first, options, &baker));
    first += part.bake.triangles.size();
    part.bake = TextureBake();
  }
  TextureImage result = baker.Finish();
  result.header.kind = header.kind;
  result.is_lossless = is_lossless;
  if (chunks && have_same_chunks) result.color_chunks = *std::move(chunks);
  return EncodeImage(result);
}

TextureFileNames::TextureFileNames(const std::string& output, const std::vector<std::string>& taken) : output_(output) {
  for (const std::string& path : taken) taken_.insert(Resolved(path).string());
}

std::string TextureFileNames::Next(const std::string& image, ImageKind kind) {
  std::string name = fs::path(output_).stem().string() + "_";
  for (const char c : fs::path(image).stem().string()) {
    const bool is_plain = std::isalnum(static_cast<unsigned char>(c)) != 0 || c == '-' || c == '_' || c == '.' || c < 0;
    name += is_plain ? c : '_';
  }
  return Unused(name, Extension(kind));
}

std::string TextureFileNames::NextMaterialFile() {
  return Unused(fs::path(output_).stem().string(), "mtl");
}

std::string TextureFileNames::Unused(const std::string& name, const std::string& extension) {
  for (int i = 1;; ++i) {
    const std::string file = name + (i > 1 ? "_" + std::to_string(i) : "") + "." + extension;
    const fs::path path = fs::path(output_).parent_path() / file;
    if (taken_.insert(Resolved(path).string()).second) return path.string();
  }
}

}  // namespace planish
