#include "client/texture/image.h"

#include <cmath>
#include <new>

#include "core/base/error.h"
#include "core/base/status_macros.h"

namespace planish {

const char* ToString(ImageKind kind) {
  switch (kind) {
    case ImageKind::kPng:
      return "PNG";
    case ImageKind::kJpeg:
      return "JPEG";
    case ImageKind::kWebp:
      return "WebP";
  }
  return "";
}

const char* Extension(ImageKind kind) {
  switch (kind) {
    case ImageKind::kPng:
      return "png";
    case ImageKind::kJpeg:
      return "jpg";
    case ImageKind::kWebp:
      return "webp";
  }
  return "";
}

const char* MimeType(ImageKind kind) {
  switch (kind) {
    case ImageKind::kPng:
      return "image/png";
    case ImageKind::kJpeg:
      return "image/jpeg";
    case ImageKind::kWebp:
      return "image/webp";
  }
  return "";
}

namespace texture_internal {

absl::Status ImageMalformed(const std::string& name, const std::string& message) {
  return MakeError(absl::StatusCode::kInvalidArgument, "IMAGE_MALFORMED", name + ": " + message, {{"image", name}});
}

absl::Status ImageUnsupported(const std::string& name, const std::string& message) {
  return MakeError(absl::StatusCode::kInvalidArgument, "IMAGE_UNSUPPORTED", name + ": " + message, {{"image", name}});
}

}  // namespace texture_internal

using texture_internal::ImageMalformed;
using texture_internal::ImageUnsupported;

std::optional<ImageKind> KindOfImage(std::string_view bytes) {
  if (bytes.starts_with("\x89PNG\r\n\x1A\n")) return ImageKind::kPng;
  if (bytes.starts_with("\xFF\xD8\xFF")) return ImageKind::kJpeg;
  if (bytes.starts_with("RIFF") && bytes.size() >= 12 && bytes.substr(8, 4) == "WEBP") return ImageKind::kWebp;
  return std::nullopt;
}

namespace {

// The name of a common kind of image that we cannot read, by its first bytes; empty for other bytes.
std::string OtherKind(std::string_view bytes) {
  if (bytes.starts_with(std::string_view("\xABKTX 20\xBB", 8))) return "KTX2";
  if (bytes.starts_with(std::string_view("\xABKTX 11\xBB", 8))) return "KTX";
  if (bytes.starts_with("DDS ")) return "DDS";
  if (bytes.starts_with("GIF8")) return "GIF";
  if (bytes.starts_with("BM")) return "BMP";
  if (bytes.starts_with("#?RADIANCE")) return "HDR";
  if (bytes.starts_with("\x76\x2F\x31\x01")) return "EXR";
  if (bytes.starts_with(std::string_view("II*\0", 4)) || bytes.starts_with(std::string_view("MM\0*", 4))) return "TIFF";
  if (bytes.size() >= 12 && bytes.substr(4, 8) == "ftypavif") return "AVIF";
  return "";
}

absl::Status CheckSize(const ImageHeader& header, std::string_view bytes, const std::string& name) {
  const std::string size = std::to_string(header.width) + " x " + std::to_string(header.height) + " texels";
  if (header.width < 1 || header.height < 1) return ImageMalformed(name, "the image has no texels");
  if (header.width > kLargestImageSide || header.height > kLargestImageSide) {
    return ImageUnsupported(name, size + "; at most " + std::to_string(kLargestImageSide) + " per side can be read");
  }
  // Refuses images that claim more texels than their bytes can hold. Deflate expands a byte to at most 1032 bytes. JPEG
  // and WebP have no such bound, so an image of more than 4096 x 4096 texels is refused if it claims more than 1024
  // texels per byte, which no real image has.
  constexpr std::int64_t kMostDeflated = 1032;
  constexpr std::int64_t kAlwaysBelieved = std::int64_t{4096} * 4096;
  constexpr std::int64_t kMostTexelsAByte = 1024;
  const auto count = static_cast<std::int64_t>(bytes.size());
  // Divides by 8, since a PNG has at least 1 bit per texel: palettes and small depths are expanded later.
  const bool is_bomb = header.kind == ImageKind::kPng
                           ? header.texels() / 8 > kMostDeflated * count
                           : header.texels() > kAlwaysBelieved && header.texels() > kMostTexelsAByte * count;
  if (is_bomb) return ImageMalformed(name, size + " cannot be in a file of " + std::to_string(count) + " bytes");
  return absl::OkStatus();
}

}  // namespace

absl::StatusOr<ImageHeader> ReadImageHeader(std::string_view bytes, const std::string& name) {
  const std::optional<ImageKind> kind = KindOfImage(bytes);
  if (!kind) {
    if (bytes.empty()) return ImageMalformed(name, "the image is empty");
    const std::string other = OtherKind(bytes);
    return ImageUnsupported(name, other.empty() ? "not a PNG, JPEG or WebP image"
                                                : "a " + other + " image; only PNG, JPEG and WebP can be read");
  }
  ImageHeader header;
  bool is_cut_off = false;
  switch (*kind) {
    case ImageKind::kPng: {
      PLANISH_ASSIGN_OR_RETURN(header, texture_internal::ReadPngHeader(bytes, name));
      is_cut_off = texture_internal::IsPngCutOff(bytes);
      break;
    }
    case ImageKind::kJpeg: {
      PLANISH_ASSIGN_OR_RETURN(header, texture_internal::ReadJpegHeader(bytes, name));
      is_cut_off = texture_internal::IsJpegCutOff(bytes);
      break;
    }
    case ImageKind::kWebp: {
      PLANISH_ASSIGN_OR_RETURN(header, texture_internal::ReadWebpHeader(bytes, name));
      is_cut_off = texture_internal::IsWebpCutOff(bytes);
      break;
    }
  }
  header.kind = *kind;
  if (is_cut_off) return ImageMalformed(name, "the image is cut off");
  PLANISH_RETURN_IF_ERROR(CheckSize(header, bytes, name));
  return header;
}

absl::StatusOr<TextureImage> DecodeImage(std::string_view bytes, const std::string& name) {
  TextureImage image;
  PLANISH_ASSIGN_OR_RETURN(image.header, ReadImageHeader(bytes, name));
  try {
    image.texels.resize(static_cast<std::size_t>(image.header.bytes()));
  } catch (const std::bad_alloc&) {
    return MakeError(absl::StatusCode::kResourceExhausted, "OUT_OF_MEMORY",
                     name + ": not enough memory for " + std::to_string(image.header.bytes()) + " bytes",
                     {{"image", name}});
  }
  switch (image.header.kind) {
    case ImageKind::kPng:
      PLANISH_RETURN_IF_ERROR(texture_internal::DecodePng(bytes, name, &image));
      break;
    case ImageKind::kJpeg:
      PLANISH_RETURN_IF_ERROR(texture_internal::DecodeJpeg(bytes, name, &image));
      break;
    case ImageKind::kWebp:
      PLANISH_RETURN_IF_ERROR(texture_internal::DecodeWebp(bytes, name, &image));
      break;
  }
  return image;
}

absl::StatusOr<std::string> EncodeImage(const TextureImage& image) {
  switch (image.header.kind) {
    case ImageKind::kPng:
      return texture_internal::EncodePngImage(image);
    case ImageKind::kJpeg:
      return texture_internal::EncodeJpegImage(image);
    case ImageKind::kWebp:
      return texture_internal::EncodeWebpImage(image);
  }
  return InternalError("no such kind of image");
}

double LinearOfSrgb(double srgb) {
  return srgb <= 0.04045 ? srgb / 12.92 : std::pow((srgb + 0.055) / 1.055, 2.4);
}

double SrgbOfLinear(double linear) {
  return linear <= 0.0031308 ? 12.92 * linear : 1.055 * std::pow(linear, 1 / 2.4) - 0.055;
}

}  // namespace planish
