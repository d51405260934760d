#pragma once

#include <cstdint>
#include <string>
#include <vector>

#include "absl/status/statusor.h"

namespace planish {

struct Rgb {
  std::uint8_t r = 255, g = 255, b = 255;
};

struct Image {
  Image(int image_width, int image_height)
      : width(image_width), height(image_height), pixels(static_cast<std::size_t>(width) * height) {}
  Rgb& At(int x, int y) { return pixels[static_cast<std::size_t>(y) * width + x]; }
  const Rgb& At(int x, int y) const { return pixels[static_cast<std::size_t>(y) * width + x]; }

  int width, height;        // pixels, at least 1
  std::vector<Rgb> pixels;  // rows from the top
};

// The bytes of a PNG file, 8 bits a channel. INTERNAL if libpng fails.
absl::StatusOr<std::string> EncodePng(const Image& image);

}  // namespace planish
