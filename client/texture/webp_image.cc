#include <webp/decode.h>
#include <webp/encode.h>

#include "client/texture/image.h"
#include "core/base/error.h"
#include "core/base/status_macros.h"

namespace planish::texture_internal {
namespace {

const std::uint8_t* Data(std::string_view bytes) {
  return reinterpret_cast<const std::uint8_t*>(bytes.data());
}

int AppendWebp(const std::uint8_t* data, std::size_t size, const WebPPicture* picture) {
  static_cast<std::string*>(picture->custom_ptr)->append(reinterpret_cast<const char*>(data), size);
  return 1;
}

absl::StatusOr<WebPBitstreamFeatures> Features(std::string_view bytes, const std::string& name) {
  WebPBitstreamFeatures features;
  if (WebPGetFeatures(Data(bytes), bytes.size(), &features) != VP8_STATUS_OK) {
    return ImageMalformed(name, "libwebp: the image is damaged");
  }
  if (features.has_animation != 0) return ImageUnsupported(name, "an animated WebP image");
  return features;
}

}  // namespace

absl::StatusOr<ImageHeader> ReadWebpHeader(std::string_view bytes, const std::string& name) {
  PLANISH_ASSIGN_OR_RETURN(const WebPBitstreamFeatures features, Features(bytes, name));
  ImageHeader header;
  header.width = features.width;
  header.height = features.height;
  header.channels = features.has_alpha != 0 ? 4 : 3;
  return header;
}

bool IsWebpCutOff(std::string_view bytes) {
  // The size behind "RIFF" counts the bytes behind itself.
  constexpr std::size_t kRiffHeader = 8;
  std::size_t size = 0;
  for (std::size_t i = kRiffHeader; i-- > 4;) size = size << 8 | static_cast<unsigned char>(bytes[i]);
  return size > bytes.size() - kRiffHeader;
}

absl::Status DecodeWebp(std::string_view bytes, const std::string& name, TextureImage* image) {
  PLANISH_ASSIGN_OR_RETURN(const WebPBitstreamFeatures features, Features(bytes, name));
  const auto row = static_cast<int>(image->header.bytes() / image->header.height);
  const auto decode = image->header.channels == 4 ? WebPDecodeRGBAInto : WebPDecodeRGBInto;
  if (decode(Data(bytes), bytes.size(), image->texels.data(), image->texels.size(), row) == nullptr) {
    return ImageMalformed(name, "libwebp: the image is damaged or cut off");
  }
  image->is_lossless = features.format == 2;
  return absl::OkStatus();
}

absl::StatusOr<std::string> EncodeWebpImage(const TextureImage& image) {
  if (image.header.bits != 8 || image.header.channels < 3) return InternalError("WebP is RGB or RGBA of 8 bits");
  if (image.header.width > WEBP_MAX_DIMENSION || image.header.height > WEBP_MAX_DIMENSION) {
    return InternalError("WebP has at most 16383 texels per side");
  }
  WebPConfig config;
  WebPPicture picture;
  if (WebPConfigInit(&config) == 0 || WebPPictureInit(&picture) == 0) return InternalError("libwebp: wrong version");
  config.quality = kImageQuality;
  config.lossless = image.is_lossless ? 1 : 0;
  config.exact = 1;                            // keeps colours where alpha is 0, as mipmaps need them
  if (image.is_lossless) config.quality = 50;  // effort, not quality
  std::string bytes;
  picture.use_argb = config.lossless;
  picture.width = image.header.width;
  picture.height = image.header.height;
  picture.writer = AppendWebp;
  picture.custom_ptr = &bytes;
  const int row = image.header.width * image.header.channels;
  const auto import = image.header.channels == 4 ? WebPPictureImportRGBA : WebPPictureImportRGB;
  const bool written = import(&picture, image.texels.data(), row) != 0 && WebPEncode(&config, &picture) != 0;
  WebPPictureFree(&picture);
  if (!written) return InternalError("libwebp: cannot encode, error " + std::to_string(picture.error_code));
  return bytes;
}

}  // namespace planish::texture_internal
