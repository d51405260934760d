// Images that are cut off are refused without decoding them, and no whole image is.
#include <algorithm>
#include <cstddef>
#include <cstdint>
#include <cstdio>
#include <cstdlib>
#include <filesystem>
#include <string>
#include <vector>

// jpeglib.h needs size_t and FILE.
#include <jpeglib.h>
#include <png.h>

#include "absl/strings/str_cat.h"
#include "client/files/mesh_output.h"
#include "client/texture/image.h"
#include "core/base/error.h"
#include "gmock/gmock.h"
#include "gtest/gtest.h"
#include "tests/testing/files.h"
#include "tests/texture/sample_textures.h"

namespace planish {
namespace {

struct WholeImage {
  std::string name, bytes;
};

struct PngStyle {
  int color_type = PNG_COLOR_TYPE_RGB, bits = 8;
  bool is_interlaced = false, has_chunks_behind = false;
};

std::string PngOf(const TextureImage& image, const PngStyle& style) {
  std::string bytes;
  png_structp png = png_create_write_struct(PNG_LIBPNG_VER_STRING, nullptr, nullptr, nullptr);
  png_infop info = png_create_info_struct(png);
  png_set_write_fn(
      png, &bytes,
      [](png_structp writer, png_bytep data, png_size_t size) {
        static_cast<std::string*>(png_get_io_ptr(writer))->append(reinterpret_cast<const char*>(data), size);
      },
      [](png_structp) {});
  png_set_IHDR(png, info, image.header.width, image.header.height, style.bits, style.color_type,
               style.is_interlaced ? PNG_INTERLACE_ADAM7 : PNG_INTERLACE_NONE, PNG_COMPRESSION_TYPE_DEFAULT,
               PNG_FILTER_TYPE_DEFAULT);
  const png_color palette[2] = {{200, 0, 0}, {0, 90, 30}};
  if (style.color_type == PNG_COLOR_TYPE_PALETTE) png_set_PLTE(png, info, palette, 2);
  // Several IDAT.
  png_set_compression_buffer_size(png, 100);
  png_write_info(png, info);
  std::vector<png_bytep> rows;
  const std::size_t row = image.texels.size() / image.header.height;
  for (int y = 0; y < image.header.height; ++y) rows.push_back(const_cast<png_bytep>(&image.texels[y * row]));
  png_write_image(png, rows.data());
  png_text text = {};
  text.key = const_cast<char*>("Comment");
  text.text = const_cast<char*>("behind the image, IEND in its text");
  text.compression = PNG_TEXT_COMPRESSION_NONE;
  if (style.has_chunks_behind) png_set_text(png, info, &text, 1);
  png_write_end(png, info);
  png_destroy_write_struct(&png, &info);
  return bytes;
}

// With a chunk of the type `chunk`, four letters, in front of the first IDAT.
std::string WithPngChunk(std::string png, const std::string& chunk, const std::string& data) {
  std::string inserted = {0, 0, 0, static_cast<char>(data.size())};
  inserted += chunk + data;
  std::uint32_t crc = 0xFFFFFFFF;
  for (std::size_t i = 4; i < inserted.size(); ++i) {
    crc ^= static_cast<unsigned char>(inserted[i]);
    for (int k = 0; k < 8; ++k) crc = (crc >> 1) ^ (0xEDB88320 & (0 - (crc & 1)));
  }
  for (int shift = 24; shift >= 0; shift -= 8) inserted += static_cast<char>(~crc >> shift & 0xFF);
  return png.insert(png.find("IDAT") - 4, inserted);
}

struct JpegStyle {
  bool is_progressive = false, is_arithmetic = false, is_subsampled = false;
  unsigned restart_interval = 0;
  std::string exif = "";  // an APP1
};

std::string JpegOf(const TextureImage& image, const JpegStyle& style) {
  jpeg_compress_struct jpeg = {};
  jpeg_error_mgr errors;
  jpeg.err = jpeg_std_error(&errors);
  jpeg_create_compress(&jpeg);
  unsigned char* buffer = nullptr;
  unsigned long size = 0;
  jpeg_mem_dest(&jpeg, &buffer, &size);
  jpeg.image_width = static_cast<JDIMENSION>(image.header.width);
  jpeg.image_height = static_cast<JDIMENSION>(image.header.height);
  jpeg.input_components = image.header.channels;
  jpeg.in_color_space = image.header.channels == 1 ? JCS_GRAYSCALE : JCS_RGB;
  jpeg_set_defaults(&jpeg);
  jpeg_set_quality(&jpeg, 90, TRUE);
  if (style.is_progressive) jpeg_simple_progression(&jpeg);
  if (!style.is_subsampled) jpeg.comp_info[0].h_samp_factor = jpeg.comp_info[0].v_samp_factor = 1;
  jpeg.arith_code = style.is_arithmetic ? TRUE : FALSE;
  jpeg.restart_interval = style.restart_interval;
  jpeg_start_compress(&jpeg, TRUE);
  if (!style.exif.empty()) {
    jpeg_write_marker(&jpeg, JPEG_APP0 + 1, reinterpret_cast<const JOCTET*>(style.exif.data()),
                      static_cast<unsigned>(style.exif.size()));
  }
  const std::size_t row_bytes = image.texels.size() / image.header.height;
  while (jpeg.next_scanline < jpeg.image_height) {
    JSAMPROW row = const_cast<JSAMPROW>(image.texels.data()) + jpeg.next_scanline * row_bytes;
    jpeg_write_scanlines(&jpeg, &row, 1);
  }
  jpeg_finish_compress(&jpeg);
  jpeg_destroy_compress(&jpeg);
  std::string bytes(reinterpret_cast<const char*>(buffer), size);
  std::free(buffer);
  return bytes;
}

std::string LittleEndian(std::size_t number, int bytes) {
  std::string text;
  for (int i = 0; i < bytes; ++i) text += static_cast<char>(number >> 8 * i & 0xFF);
  return text;
}

std::string RiffChunk(const std::string& type, const std::string& data) {
  return type + LittleEndian(data.size(), 4) + data + std::string(data.size() % 2, '\0');
}

std::string WebpOf(TextureImage image, bool is_lossless) {
  image.header.kind = ImageKind::kWebp;
  image.is_lossless = is_lossless;
  return EncodeImage(image).value_or("");
}

// A WebP that begins with "VP8X", with chunks behind the image or in front of it.
std::string ExtendedWebp(const TextureImage& image, bool is_lossless, char flags, const std::string& before,
                         const std::string& behind) {
  const std::string plain = WebpOf(image, is_lossless);
  const std::string header =
      std::string{flags, 0, 0, 0} + LittleEndian(image.header.width - 1, 3) + LittleEndian(image.header.height - 1, 3);
  const std::string body = "WEBP" + RiffChunk("VP8X", header) + before + plain.substr(12) + behind;
  return RiffChunk("RIFF", body);
}

std::vector<WholeImage> WholeImages() {
  const TextureImage rgb = SmoothTexture(41, 27, 0.2, 3), grey = SmoothTexture(41, 27, 0.2, 4, 1);
  const TextureImage rgba = SmoothTexture(41, 27, 0.2, 5, 4), deep = SmoothTexture(41, 27, 0.2, 6, 3, 16);
  std::vector<WholeImage> all;
  for (const bool is_interlaced : {false, true}) {
    const std::string how = is_interlaced ? "interlaced " : "";
    all.push_back({how + "PNG, RGB", PngOf(rgb, {PNG_COLOR_TYPE_RGB, 8, is_interlaced})});
    all.push_back({how + "PNG, 16 bits", PngOf(deep, {PNG_COLOR_TYPE_RGB, 16, is_interlaced})});
    all.push_back({how + "PNG, RGBA", PngOf(rgba, {PNG_COLOR_TYPE_RGB_ALPHA, 8, is_interlaced, true})});
    all.push_back({how + "PNG, 1 bit", PngOf(grey, {PNG_COLOR_TYPE_GRAY, 1, is_interlaced, true})});
    all.push_back({how + "PNG, palette", PngOf(grey, {PNG_COLOR_TYPE_PALETTE, 1, is_interlaced})});
  }
  const std::string control = {0, 0, 0, 1, 0, 0, 0, 0};
  all.push_back({"animated PNG", WithPngChunk(all[0].bytes, "acTL", control)});
  all.push_back({"PNG with a strange chunk", WithPngChunk(all[0].bytes, "plAn", "IEND IEND IEND")});
  for (const bool is_progressive : {false, true}) {
    for (const bool is_arithmetic : {false, true}) {
      const std::string how = absl::StrCat(is_progressive ? "progressive " : "", is_arithmetic ? "arithmetic " : "");
      JpegStyle style = {is_progressive, is_arithmetic};
      all.push_back({how + "JPEG, RGB", JpegOf(rgb, style)});
      all.push_back({how + "JPEG, grey", JpegOf(grey, style)});
      style.is_subsampled = true;
      style.restart_interval = 2;
      all.push_back({how + "JPEG with restarts", JpegOf(rgb, style)});
      // Cameras put a small JPEG, which ends with an EOI of its own, into an APP1.
      style.exif = std::string("Exif\0\0", 6) + JpegOf(SmoothTexture(9, 6, 0.2, 7), {});
      all.push_back({how + "JPEG with a thumbnail", JpegOf(rgb, style)});
    }
  }
  std::string filled = all.back().bytes, strewn = filled;
  all.push_back({"JPEG with fill bytes", filled.insert(filled.size() - 2, "\xFF\xFF\xFF")});
  all.push_back({"JPEG with bytes in front of EOI", strewn.insert(strewn.size() - 2, std::string("ab\xFF\0c", 5))});
  const std::string exif = RiffChunk("EXIF", "an odd number"), profile = RiffChunk("ICCP", "a profile");
  constexpr char kExif = 0x08, kAlpha = 0x10, kProfile = 0x20;
  for (const bool is_lossless : {false, true}) {
    const std::string how = is_lossless ? "lossless " : "";
    all.push_back({how + "WebP, RGB", WebpOf(rgb, is_lossless)});
    all.push_back({how + "WebP, RGBA", WebpOf(rgba, is_lossless)});
    all.push_back({how + "WebP with EXIF", ExtendedWebp(rgb, is_lossless, kExif, "", exif)});
    all.push_back({how + "WebP with all", ExtendedWebp(rgb, is_lossless, kExif | kProfile, profile, exif)});
  }
  all.push_back({"lossless WebP with all, RGBA", ExtendedWebp(rgba, true, kExif | kProfile | kAlpha, profile, exif)});
  return all;
}

TEST(CutImage, NoWholeImageIsRefused) {
  const std::vector<WholeImage> all = WholeImages();
  const std::vector<std::string> behind = {std::string(1, '\0'), std::string(5000, '\0'),   "text", "\xFF", "\xFF\xE1",
                                           all.back().bytes,     all[0].bytes.substr(0, 60)};
  for (const WholeImage& whole : all) {
    const absl::StatusOr<TextureImage> image = DecodeImage(whole.bytes, whole.name);
    EXPECT_TRUE(ReadImageHeader(whole.bytes, whole.name).ok()) << whole.name;
    ASSERT_TRUE(image.ok()) << image.status();
    for (const std::string& more : behind) {
      const absl::StatusOr<TextureImage> same = DecodeImage(whole.bytes + more, whole.name);
      ASSERT_TRUE(same.ok()) << same.status() << " with " << more.size() << " bytes behind it";
      EXPECT_EQ(same->texels, image->texels) << whole.name;
    }
  }
}

TEST(CutImage, EachCutIsRefusedWithoutDecoding) {
  for (const WholeImage& whole : WholeImages()) {
    for (std::size_t size = 0; size < whole.bytes.size(); ++size) {
      const absl::StatusOr<ImageHeader> header = ReadImageHeader(whole.bytes.substr(0, size), whole.name);
      ASSERT_FALSE(header.ok()) << whole.name << " cut to " << size << " of " << whole.bytes.size() << " bytes";
      // Of a WebP without "WEBP" nobody knows what it is.
      const bool is_known = size >= 12 || (size >= 8 && whole.bytes[0] != 'R') || size == 0;
      if (is_known) {
        EXPECT_EQ(ErrorInfoOf(header.status()).reason, "IMAGE_MALFORMED") << whole.name << " cut to " << size;
      }
    }
  }
}

// What the codecs make of cut images: they refuse them too, so that the check refuses nothing that they decode.
TEST(CutImage, TheCodecsRefuseEachCutToo) {
  for (const WholeImage& whole : WholeImages()) {
    const absl::StatusOr<ImageHeader> header = ReadImageHeader(whole.bytes, whole.name);
    ASSERT_TRUE(header.ok()) << header.status();
    TextureImage image;
    image.header = *header;
    image.texels.resize(static_cast<std::size_t>(header->bytes()));
    const auto decode = header->kind == ImageKind::kPng    ? texture_internal::DecodePng
                        : header->kind == ImageKind::kJpeg ? texture_internal::DecodeJpeg
                                                           : texture_internal::DecodeWebp;
    const std::size_t step = std::max<std::size_t>(1, whole.bytes.size() / 200);
    std::vector<std::size_t> sizes;
    for (std::size_t size = 12; size + 20 < whole.bytes.size(); size += step) sizes.push_back(size);
    for (std::size_t left = 20; left > 0; --left) sizes.push_back(whole.bytes.size() - left);
    for (const std::size_t size : sizes) {
      EXPECT_FALSE(decode(whole.bytes.substr(0, size), whole.name, &image).ok()) << whole.name << " cut to " << size;
    }
    EXPECT_TRUE(decode(whole.bytes, whole.name, &image).ok()) << whole.name;
  }
}

// CheckOutput() comes before a job is sent.
TEST(CutImage, TheOutputIsRefusedBeforeThereIsAMap) {
  const std::string folder = ::testing::TempDir() + "planish_cut_image/";
  std::filesystem::create_directories(folder);
  PutFile(folder + "in.mtl", "newmtl wood\nmap_Kd wood.png\n");
  PutFile(folder + "in.obj",
          "mtllib in.mtl\nv 0 0 0\nv 1 0 0\nv 0 1 0\nvt 0 0\nvt 1 0\nvt 0 1\nusemtl wood\nf 1/1 2/2 3/3\n");
  const absl::StatusOr<MeshFile> file = ReadMeshFile(folder + "in.obj");
  ASSERT_TRUE(file.ok()) << file.status();
  OutputOptions options;
  options.path = folder + "out.obj";
  options.textures.mode = TextureMode::kTransfer;
  const std::string png = WholeImages()[0].bytes;
  PutFile(folder + "wood.png", png);
  EXPECT_TRUE(CheckOutput(*file, options).ok()) << CheckOutput(*file, options);
  PutFile(folder + "wood.png", png.substr(0, png.size() - 1));
  const absl::Status refused = CheckOutput(*file, options);
  EXPECT_EQ(ErrorInfoOf(refused).reason, "IMAGE_MALFORMED") << refused;
  EXPECT_THAT(std::string(refused.message()), ::testing::HasSubstr("wood.png: the image is cut off"));
}

TEST(CutImage, AnAnimatedWebpIsUnsupportedEvenIfItIsCutOff) {
  const TextureImage image = SmoothTexture(16, 16, 0.2, 3);
  constexpr char kAnimation = 0x02;
  const std::string frame = std::string(6, '\0') + LittleEndian(15, 3) + LittleEndian(15, 3) + LittleEndian(40, 3) +
                            std::string(1, '\0') + WebpOf(image, true).substr(12);
  const std::string header = std::string{kAnimation, 0, 0, 0} + LittleEndian(15, 3) + LittleEndian(15, 3);
  const std::string animated =
      RiffChunk("RIFF", "WEBP" + RiffChunk("VP8X", header) + RiffChunk("ANIM", std::string(6, '\0')) +
                            RiffChunk("ANMF", frame) + RiffChunk("ANMF", frame));
  for (const std::size_t size : {animated.size(), animated.size() - 1, animated.size() / 2}) {
    const absl::StatusOr<ImageHeader> read = ReadImageHeader(animated.substr(0, size), "image");
    EXPECT_EQ(ErrorInfoOf(read.status()).reason, "IMAGE_UNSUPPORTED") << read.status();
  }
}

}  // namespace
}  // namespace planish
