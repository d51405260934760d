#include "client/pictures/map_picture.h"

#include <png.h>

#include <algorithm>

#include "gtest/gtest.h"

namespace planish {
namespace {

// One square of two triangles in the xy plane, mapped to the unit square.
Mesh Square() {
  return {{{0, 0, 0}, {1, 0, 0}, {1, 1, 0}, {0, 1, 0}}, {{0, 1, 2}, {0, 2, 3}}};
}
const std::vector<double> kSquareUv = {0, 0, 1, 0, 1, 1, 0, 0, 1, 1, 0, 1};

bool Near(const Rgb& a, const Rgb& b, int tolerance) {
  return std::abs(a.r - b.r) <= tolerance && std::abs(a.g - b.g) <= tolerance && std::abs(a.b - b.b) <= tolerance;
}

TEST(MapPicture, ShowsTheSameChecksOnTheSurfaceAndInThePlane) {
  MapPictureOptions options;
  options.height = 200;
  options.checks = 2;
  options.azimuth = options.elevation = 0;
  const Image image = DrawMap(Square(), kSquareUv, options);
  ASSERT_EQ(image.width, 400);
  ASSERT_EQ(image.height, 200);
  const Rgb white;
  EXPECT_TRUE(Near(image.At(2, 2), white, 0));
  // The centres of the four checks, on both halves; the surface is shaded a little.
  for (const int half : {0, 200}) {
    const Rgb low_left = image.At(half + 54, 146), low_right = image.At(half + 146, 146);
    const Rgb high_left = image.At(half + 54, 54), high_right = image.At(half + 146, 54);
    EXPECT_GT(low_left.r + low_left.g, low_right.g + low_right.b) << "light lower left, dark lower right";
    EXPECT_FALSE(Near(low_left, high_left, 20));
    EXPECT_FALSE(Near(low_right, high_right, 20));
  }
  EXPECT_TRUE(Near(image.At(54, 146), image.At(254, 146), 60));
}

TEST(MapPicture, DrawsSeamsDark) {
  MapPictureOptions options;
  options.height = 100;
  std::vector<double> apart = kSquareUv;
  for (std::size_t i = 6; i < 12; ++i) apart[i] *= 0.5;  // the second triangle is a chart of its own
  const auto dark = [&](const std::vector<double>& uv) {
    const Image image = DrawMap(Square(), uv, options);
    return std::count_if(image.pixels.begin(), image.pixels.end(),
                         [](const Rgb& p) { return p.r < 80 && p.g < 80 && p.b < 80; });
  };
  EXPECT_GT(dark(apart), dark(kSquareUv) + 50);
}

TEST(EncodePng, ReadsBackTheSame) {
  Image image(3, 2);
  image.At(0, 0) = {1, 2, 3};
  image.At(2, 1) = {250, 128, 7};
  const std::string bytes = EncodePng(image).value();
  png_image header = {};
  header.version = PNG_IMAGE_VERSION;
  ASSERT_TRUE(png_image_begin_read_from_memory(&header, bytes.data(), bytes.size()));
  header.format = PNG_FORMAT_RGB;
  ASSERT_EQ(header.width, 3u);
  ASSERT_EQ(header.height, 2u);
  std::vector<Rgb> pixels(6);
  ASSERT_TRUE(png_image_finish_read(&header, nullptr, pixels.data(), 0, nullptr));
  for (int i = 0; i < 6; ++i) EXPECT_TRUE(Near(pixels[i], image.pixels[i], 0)) << i;
}

}  // namespace
}  // namespace planish
