#include "client/texture/image.h"

#include <cmath>
#include <cstdint>
#include <random>

#include "core/base/error.h"
#include "gmock/gmock.h"
#include "gtest/gtest.h"
#include "tests/texture/sample_textures.h"

namespace planish {
namespace {

std::string Encoded(const TextureImage& image) {
  const absl::StatusOr<std::string> bytes = EncodeImage(image);
  EXPECT_TRUE(bytes.ok()) << bytes.status();
  return bytes.value_or("");
}

std::string ReasonOf(const std::string& bytes) {
  const absl::StatusOr<TextureImage> image = DecodeImage(bytes, "the image");
  return image.ok() ? "" : ErrorInfoOf(image.status()).reason;
}

TEST(Image, PngKeepsEveryTexelOfEveryKind) {
  for (const int channels : {1, 2, 3, 4}) {
    for (const int bits : {8, 16}) {
      TextureImage image = SmoothTexture(37, 21, 0.2, 4, channels, bits);
      image.color_chunks = {{"gAMA", std::string("\0\0\xB1\x8F", 4)}, {"cICP", std::string("\x0C\x0D\0\x01", 4)}};
      const absl::StatusOr<TextureImage> read = DecodeImage(Encoded(image), "image");
      ASSERT_TRUE(read.ok()) << read.status();
      EXPECT_EQ(read->header.channels, channels);
      EXPECT_EQ(read->header.bits, bits);
      EXPECT_EQ(read->texels, image.texels);
      ASSERT_EQ(read->color_chunks.size(), 2u);
      EXPECT_EQ(read->color_chunks[0].type, "gAMA");
      EXPECT_EQ(read->color_chunks[1].data, image.color_chunks[1].data);
    }
  }
}

TEST(Image, JpegAndWebpComeBackAlike) {
  for (const ImageKind kind : {ImageKind::kJpeg, ImageKind::kWebp}) {
    for (const bool lossless : {false, true}) {
      if (kind == ImageKind::kJpeg && lossless) continue;
      TextureImage image = SmoothTexture(40, 30, 0.05, 4);
      image.header.kind = kind;
      image.is_lossless = lossless;
      const std::string bytes = Encoded(image);
      const absl::StatusOr<TextureImage> read = DecodeImage(bytes, "image");
      ASSERT_TRUE(read.ok()) << read.status();
      EXPECT_EQ(read->header.kind, kind);
      EXPECT_EQ(read->header.width, 40);
      if (kind == ImageKind::kWebp) {
        EXPECT_EQ(read->is_lossless, lossless);
      }
      double difference = 0;
      for (std::size_t i = 0; i < image.texels.size(); ++i) difference += std::abs(image.texels[i] - read->texels[i]);
      EXPECT_LE(difference / static_cast<double>(image.texels.size()), lossless ? 0 : 4);
    }
  }
}

TEST(Image, OtherKindsAreNamed) {
  EXPECT_EQ(ReasonOf(std::string("\xABKTX 20\xBB\r\n\x1A\n", 12)), "IMAGE_UNSUPPORTED");
  EXPECT_THAT(std::string(DecodeImage(std::string("\xABKTX 20\xBB\r\n\x1A\n", 12), "wood.ktx2").status().message()),
              ::testing::AllOf(::testing::HasSubstr("wood.ktx2"), ::testing::HasSubstr("KTX2")));
  EXPECT_EQ(ReasonOf("GIF89a"), "IMAGE_UNSUPPORTED");
  EXPECT_EQ(ReasonOf(""), "IMAGE_MALFORMED");
}

// Chunk lengths and CRCs stay right, so that only the size is wrong.
std::string WithPngSize(std::string png, std::uint32_t side) {
  for (const std::size_t at : {16u, 20u}) {
    for (std::size_t i = 0; i < 4; ++i) png[at + i] = static_cast<char>(side >> (24 - 8 * i) & 0xFF);
  }
  std::uint32_t crc = 0xFFFFFFFF;
  for (std::size_t i = 12; i < 29; ++i) {
    crc ^= static_cast<unsigned char>(png[i]);
    for (int k = 0; k < 8; ++k) crc = (crc >> 1) ^ (0xEDB88320 & (0 - (crc & 1)));
  }
  crc = ~crc;
  for (std::size_t i = 0; i < 4; ++i) png[29 + i] = static_cast<char>(crc >> (24 - 8 * i) & 0xFF);
  return png;
}

TEST(Image, BombsAreRefusedBeforeTheyTakeMemory) {
  const std::string png = Encoded(SmoothTexture(16, 16, 0.1, 1));
  EXPECT_EQ(ReasonOf(WithPngSize(png, 30000)), "IMAGE_MALFORMED");
  EXPECT_EQ(ReasonOf(WithPngSize(png, 100000)), "IMAGE_MALFORMED");  // beyond the limit of the library
  TextureImage webp = SmoothTexture(16, 16, 0.1, 1);
  webp.header.kind = ImageKind::kWebp;
  std::string bytes = Encoded(webp);
  // VP8L: 14 bits of width - 1 and of height - 1 behind the signature.
  bytes[21] = bytes[22] = bytes[23] = static_cast<char>(0xFF);
  bytes[24] = static_cast<char>(0x0F);
  EXPECT_EQ(ReasonOf(bytes), "IMAGE_MALFORMED");
}

TEST(Image, DamagedBytesCostAnError) {
  std::mt19937 random(11);
  for (const ImageKind kind : {ImageKind::kPng, ImageKind::kJpeg, ImageKind::kWebp}) {
    TextureImage image = SmoothTexture(48, 48, 0.2, 1);
    image.header.kind = kind;
    const std::string whole = Encoded(image);
    for (int i = 0; i < 50; ++i) {
      EXPECT_EQ(ReasonOf(whole.substr(0, 12 + random() % (whole.size() - 12))), "IMAGE_MALFORMED");
    }
    for (int i = 0; i < 500; ++i) {
      std::string bytes = whole;
      for (int k = 0; k < 3; ++k) bytes[random() % bytes.size()] = static_cast<char>(random());
      const absl::StatusOr<TextureImage> read = DecodeImage(bytes, "image");
      if (read.ok()) {
        EXPECT_EQ(static_cast<std::int64_t>(read->texels.size()), read->header.bytes());
      }
    }
  }
}

}  // namespace
}  // namespace planish
