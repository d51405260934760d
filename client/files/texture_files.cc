#include "client/files/texture_files.h"

#include <algorithm>
#include <cctype>
#include <cmath>
#include <filesystem>
#include <system_error>

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

absl::StatusOr<std::string> BakeImage(std::string bytes, const TextureBake& bake, const TextureOptions& options,
                                      std::vector<OutputWarning>* warnings) {
  PLANISH_ASSIGN_OR_RETURN(const ImageHeader old, ReadImageHeader(bytes, bake.name));
  ImageHeader header = old;
  int side = options.size;
  if (side == 0 && old.texels() > 1) {
    const double wanted = TextureSideOf(bake.triangles, bake.areas, old.width, old.height);
    // GPUs can compress sizes that are multiples of four.
    const double rounded = 4 * std::ceil(std::min(wanted, 1e9) / 4 - 1e-9);
    side = std::min(kLargestAutoTexture, std::max(options.least_size, static_cast<int>(rounded)));
    if (rounded > kLargestAutoTexture) {
      warnings->push_back({"TEXTURE_SIZE", bake.name + " would take " +
                                               std::to_string(static_cast<std::int64_t>(rounded)) +
                                               " texels per side to keep its texel density; it gets " +
                                               std::to_string(side) + " (--texture-size sets another size)"});
    }
  }
  header.width = header.height = std::max(1, side);
  // The old image goes before the new one is there.
  const std::int64_t memory = static_cast<std::int64_t>(bytes.size()) + TextureBaker::SourceBytes(old) +
                              std::max(old.bytes(), 2 * header.bytes() + 2 * header.texels());
  if (options.memory > 0 && memory > options.memory) {
    return MakeError(absl::StatusCode::kResourceExhausted, "TEXTURE_MEMORY",
                     bake.name + ": resampling " + std::to_string(old.width) + " x " + std::to_string(old.height) +
                         " texels into " + std::to_string(header.width) + " x " + std::to_string(header.height) +
                         " takes " + Megabytes(memory) + " of memory, and the limit is " + Megabytes(options.memory) +
                         "; --texture-size makes the new image smaller, --memory raises the limit",
                     {{"image", bake.name}, {"bytes", std::to_string(memory)}});
  }
  PLANISH_ASSIGN_OR_RETURN(TextureImage image, DecodeImage(bytes, bake.name));
  bytes = std::string();  // one image at a time may be large
  ThreadTeam team(std::max(1, options.threads));
  TextureBaker baker(header, &team);
  TextureSource source;
  source.image = &image;
  source.spent = &image;
  source.wrap_u = bake.wrap_u;
  source.wrap_v = bake.wrap_v;
  source.nearest = bake.nearest;
  BakeOptions how = bake.options;
  if (old.channels < 3 && (how.meaning == TextureMeaning::kNormal || how.meaning == TextureMeaning::kDirection)) {
    how.meaning = TextureMeaning::kData;
  }
  const bool has_frames = how.meaning == TextureMeaning::kNormal || how.meaning == TextureMeaning::kDirection;
  PLANISH_RETURN_IF_ERROR(baker.Draw(
      std::move(source), bake.triangles,
      has_frames ? std::span<const CornerFrames>(bake.frames) : std::span<const CornerFrames>(), how, options.stop));
  TextureImage result = baker.Finish();
  result.header.kind = old.kind;
  result.is_lossless = image.is_lossless;
  result.color_chunks = std::move(image.color_chunks);
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
