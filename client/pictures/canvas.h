// Pictures: pixels, PNG bytes, and a small rasterizer for pictures of maps (triangles with depth and thick lines,
// smoothed by several samples a pixel).
#pragma once

#include <algorithm>
#include <array>
#include <cmath>
#include <cstdint>
#include <string>
#include <vector>

#include "absl/status/statusor.h"
#include "core/mesh/mesh.h"

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

// The colour with these shares of red, green and blue, in [0, 1].
Rgb ToRgb(const Vec3& colour);

// All lengths are in samples: `oversampling` of them make a pixel in either direction. x to the right, y downwards.
class Canvas {
 public:
  // Width and height are in pixels, at least 1. Takes 7 bytes of memory per sample.
  Canvas(int width, int height, int oversampling, const Rgb& background = {});

  // Fills the triangle of `points` (x, y, and z: the depth, nearer is larger), any orientation, where nothing as near
  // was drawn before. shade(barycentric) gives the Rgb of a sample.
  template <typename Shade>
  void Fill(const std::array<Vec3, 3>& points, const Shade& shade) {
    const auto cross = [](const Vec3& a, const Vec3& b, double x, double y) {
      return (b.x() - a.x()) * (y - a.y()) - (b.y() - a.y()) * (x - a.x());
    };
    const double area = cross(points[0], points[1], points[2].x(), points[2].y());
    if (area == 0 || !std::isfinite(area)) return;
    const auto [left, right] = std::minmax({points[0].x(), points[1].x(), points[2].x()});
    const auto [top, bottom] = std::minmax({points[0].y(), points[1].y(), points[2].y()});
    const int x0 = First(left), x1 = Last(right, width_), y0 = First(top), y1 = Last(bottom, height_);
    for (int y = y0; y <= y1; ++y) {
      for (int x = x0; x <= x1; ++x) {
        Vec3 weight;
        for (int k = 0; k < 3; ++k) weight[k] = cross(points[Next(k)], points[Prev(k)], x + 0.5, y + 0.5) / area;
        if (weight.minCoeff() < 0) continue;
        const double depth = weight[0] * points[0].z() + weight[1] * points[1].z() + weight[2] * points[2].z();
        float& nearest = depth_[At(x, y)];
        if (static_cast<float>(depth) <= nearest) continue;
        nearest = static_cast<float>(depth);
        colour_[At(x, y)] = shade(weight);
      }
    }
  }

  // A line with round ends, over everything.
  void Stroke(const Vec2& from, const Vec2& to, double width, const Rgb& colour);
  // The samples whose centres lie in [low, high], over everything.
  void Box(const Vec2& low, const Vec2& high, const Rgb& colour);

  // The mean of each pixel's samples.
  Image Downsample() const;

 private:
  // The first and the last sample whose centre is on the canvas and not before, or not behind, `at`.
  static int First(double at) { return static_cast<int>(std::ceil(std::clamp(at, 0.0, 1e9) - 0.5)); }
  static int Last(double at, int size) { return static_cast<int>(std::floor(std::clamp(at, 0.0, 1.0 * size) - 0.5)); }
  std::size_t At(int x, int y) const { return static_cast<std::size_t>(y) * width_ + x; }

  int width_, height_, oversampling_;  // in samples
  std::vector<Rgb> colour_;
  std::vector<float> depth_;
};

}  // namespace planish
