// Images of textures that a person gives the client.
#include <string>

#include "client/texture/image.h"
#include "core/base/error.h"
#include "tests/fuzz/check.h"
#include "tests/fuzz/memory_budget.h"

namespace planish::fuzz::images {
namespace {

// Images of up to 4096 x 4096 texels are believed, whatever the size of the file.
constexpr std::int64_t kMemory = std::int64_t{256} << 20;
// Encoding is no code that reads: a few of them will do.
constexpr std::int64_t kEncodedTexels = 4096;

// Decodes `bytes` without the checks of ReadImageHeader(). False also for images of more texels.
bool CodecDecodes(std::string_view bytes) {
  constexpr std::int64_t kTexels = 1 << 16;
  const std::optional<ImageKind> kind = KindOfImage(bytes);
  if (!kind) return false;
  const auto decodes = [&](const auto& read_header, const auto& decode) {
    const absl::StatusOr<ImageHeader> header = read_header(bytes, "image");
    if (!header.ok() || header->texels() > kTexels) return false;
    TextureImage image;
    image.header = *header;
    image.texels.resize(static_cast<std::size_t>(header->bytes()));
    return decode(bytes, "image", &image).ok();
  };
  if (*kind == ImageKind::kPng) return decodes(texture_internal::ReadPngHeader, texture_internal::DecodePng);
  if (*kind == ImageKind::kJpeg) return decodes(texture_internal::ReadJpegHeader, texture_internal::DecodeJpeg);
  return decodes(texture_internal::ReadWebpHeader, texture_internal::DecodeWebp);
}

}  // namespace

FUZZ_TARGET(images, bytes) {
  const MemoryBudget budget(kMemory);
  const absl::StatusOr<TextureImage> image = DecodeImage(bytes, "image");
  Require(image.ok() || !CodecDecodes(bytes), "no image is refused that the codec decodes");
  if (!image.ok()) return RequireReason(image.status(), {"IMAGE_MALFORMED", "IMAGE_UNSUPPORTED", "OUT_OF_MEMORY"});
  const ImageHeader& header = image->header;
  Require(header.width > 0 && header.height > 0 && header.channels >= 1 && header.channels <= 4, "an image has texels");
  Require(static_cast<std::int64_t>(image->texels.size()) == header.bytes(), "as many texels as the header says");
  if (header.texels() > kEncodedTexels) return;
  const absl::StatusOr<std::string> again = EncodeImage(*image);
  Require(again.ok(), "what was read can be written: " + again.status().ToString());
  const absl::StatusOr<TextureImage> twice = DecodeImage(*again, "image");
  Require(twice.ok(), "what was written can be read: " + twice.status().ToString());
  // WebP leaves out an alpha that is opaque everywhere.
  const bool keeps_channels = twice->header.channels == header.channels || header.kind == ImageKind::kWebp;
  Require(keeps_channels && twice->header.bits == header.bits, "writing keeps channels");
  if (header.kind == ImageKind::kPng) Require(twice->texels == image->texels, "PNG keeps every texel");
}

}  // namespace planish::fuzz::images
