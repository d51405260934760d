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

}  // namespace

FUZZ_TARGET(images, bytes) {
  const MemoryBudget budget(kMemory);
  const absl::StatusOr<TextureImage> image = DecodeImage(bytes, "image");
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
