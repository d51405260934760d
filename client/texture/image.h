// Images of textures: PNG, JPEG and WebP, to and from bytes. Functions are thread-safe.
#pragma once

#include <cstdint>
#include <optional>
#include <string>
#include <string_view>
#include <vector>

#include "absl/status/statusor.h"

namespace planish {

enum class ImageKind { kPng, kJpeg, kWebp };
const char* ToString(ImageKind kind);   // "PNG"
const char* Extension(ImageKind kind);  // "png"
const char* MimeType(ImageKind kind);   // "image/png"

struct ImageHeader {
  ImageKind kind = ImageKind::kPng;
  int width = 0, height = 0;  // texels
  int channels = 3;           // 1 grey, 2 grey and alpha, 3 RGB, 4 RGBA; palettes are expanded
  int bits = 8;               // per channel, 8 or 16

  bool has_alpha() const { return channels == 2 || channels == 4; }
  std::int64_t texels() const { return std::int64_t{width} * height; }
  std::int64_t bytes() const { return texels() * channels * (bits / 8); }
};

struct TextureImage {
  ImageHeader header;
  std::vector<std::uint8_t> texels;  // rows from the top, channels beside each other; 16 bits in the machine's order

  bool is_lossless = true;  // whether a WebP is lossless; then it is written without loss too
  // Chunks of a PNG (cHRM, cICP, gAMA, iCCP, sRGB: type and data) and marker APP2 of a JPEG (type "APP2"), which say
  // what its colours mean.
  struct ColorChunk {
    std::string type, data;
  };
  std::vector<ColorChunk> color_chunks;
};

// JPEG and lossy WebP are written with this quality, JPEG with colours at full resolution.
inline constexpr int kImageQuality = 95;
// Texels per side of an image that can be read.
inline constexpr int kLargestImageSide = 32768;

// Detects the kind by the first bytes; nullopt for other kinds of file.
std::optional<ImageKind> KindOfImage(std::string_view bytes);

// Kind and size of an image, without decoding it. `bytes` is the whole file; bytes behind the image are ignored. `name`
// is for messages. INVALID_ARGUMENT: IMAGE_UNSUPPORTED for other kinds of file (KTX2, GIF, ...), CMYK and animations;
// IMAGE_MALFORMED for damaged headers, images that are cut off, and images that are larger than their bytes can be.
absl::StatusOr<ImageHeader> ReadImageHeader(std::string_view bytes, const std::string& name);

// Errors as of ReadImageHeader(), and OUT_OF_MEMORY; damage behind the header is IMAGE_MALFORMED. Takes header.bytes()
// of memory, and what the codec needs.
absl::StatusOr<TextureImage> DecodeImage(std::string_view bytes, const std::string& name);

// The bytes of a file of kind image.header.kind. INTERNAL if the library fails.
absl::StatusOr<std::string> EncodeImage(const TextureImage& image);

// Conversions between sRGB and linear light (IEC 61966-2-1), both in [0, 1].
double SrgbOfLinear(double linear);
double LinearOfSrgb(double srgb);

namespace texture_internal {

// The codecs, one file for each. `image` has kind and size from the header that was read.
absl::StatusOr<ImageHeader> ReadPngHeader(std::string_view bytes, const std::string& name);
absl::StatusOr<ImageHeader> ReadJpegHeader(std::string_view bytes, const std::string& name);
absl::StatusOr<ImageHeader> ReadWebpHeader(std::string_view bytes, const std::string& name);
// Whether the bytes end before the image does. They step over the parts of the file without decoding them. The decoders
// refuse such an image too. `bytes` has a header that was read.
bool IsPngCutOff(std::string_view bytes);
bool IsJpegCutOff(std::string_view bytes);
bool IsWebpCutOff(std::string_view bytes);
absl::Status DecodePng(std::string_view bytes, const std::string& name, TextureImage* image);
absl::Status DecodeJpeg(std::string_view bytes, const std::string& name, TextureImage* image);
absl::Status DecodeWebp(std::string_view bytes, const std::string& name, TextureImage* image);
absl::StatusOr<std::string> EncodePngImage(const TextureImage& image);
absl::StatusOr<std::string> EncodeJpegImage(const TextureImage& image);
absl::StatusOr<std::string> EncodeWebpImage(const TextureImage& image);

absl::Status ImageMalformed(const std::string& name, const std::string& message);
absl::Status ImageUnsupported(const std::string& name, const std::string& message);

}  // namespace texture_internal
}  // namespace planish
