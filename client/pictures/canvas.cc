#include "client/pictures/canvas.h"

#include <png.h>

#include <limits>

#include "absl/strings/str_cat.h"

namespace planish {

absl::StatusOr<std::string> EncodePng(const Image& image) {
  png_image header = {};
  header.version = PNG_IMAGE_VERSION;
  header.width = static_cast<png_uint_32>(image.width);
  header.height = static_cast<png_uint_32>(image.height);
  header.format = PNG_FORMAT_RGB;
  png_alloc_size_t size = 0;
  const auto write = [&](void* memory) {
    return png_image_write_to_memory(&header, memory, &size, /*convert_to_8_bit=*/0, image.pixels.data(),
                                     /*row_stride=*/0, nullptr);
  };
  std::string bytes;
  // The first call only measures.
  if (write(nullptr)) {
    bytes.resize(size);
    if (write(bytes.data())) {
      bytes.resize(size);
      return bytes;
    }
  }
  return absl::InternalError(absl::StrCat("libpng: ", header.message));
}

Rgb ToRgb(const Vec3& colour) {
  const Vec3 c = (255 * colour).cwiseMax(0).cwiseMin(255);
  return {static_cast<std::uint8_t>(c.x() + 0.5), static_cast<std::uint8_t>(c.y() + 0.5),
          static_cast<std::uint8_t>(c.z() + 0.5)};
}

Canvas::Canvas(int width, int height, int oversampling, const Rgb& background)
    : width_(width * oversampling),
      height_(height * oversampling),
      oversampling_(oversampling),
      colour_(static_cast<std::size_t>(width_) * height_, background),
      depth_(colour_.size(), -std::numeric_limits<float>::infinity()) {}

void Canvas::Stroke(const Vec2& from, const Vec2& to, double width, const Rgb& colour) {
  const double radius = width / 2, length_squared = (to - from).squaredNorm();
  if (!std::isfinite(length_squared)) return;
  const Vec2 low = from.cwiseMin(to).array() - radius, high = from.cwiseMax(to).array() + radius;
  for (int y = First(low.y()); y <= Last(high.y(), height_); ++y) {
    for (int x = First(low.x()); x <= Last(high.x(), width_); ++x) {
      const Vec2 p(x + 0.5, y + 0.5);
      const double along = length_squared > 0 ? std::clamp((p - from).dot(to - from) / length_squared, 0.0, 1.0) : 0.0;
      if ((from + along * (to - from) - p).squaredNorm() <= radius * radius) colour_[At(x, y)] = colour;
    }
  }
}

void Canvas::Box(const Vec2& low, const Vec2& high, const Rgb& colour) {
  for (int y = First(low.y()); y <= Last(high.y(), height_); ++y) {
    for (int x = First(low.x()); x <= Last(high.x(), width_); ++x) colour_[At(x, y)] = colour;
  }
}

Image Canvas::Downsample() const {
  Image image(width_ / oversampling_, height_ / oversampling_);
  const int samples = oversampling_ * oversampling_;
  for (int y = 0; y < image.height; ++y) {
    for (int x = 0; x < image.width; ++x) {
      int r = samples / 2, g = r, b = r;
      for (int i = 0; i < samples; ++i) {
        const Rgb& c = colour_[At(x * oversampling_ + i % oversampling_, y * oversampling_ + i / oversampling_)];
        r += c.r;
        g += c.g;
        b += c.b;
      }
      image.At(x, y) = {static_cast<std::uint8_t>(r / samples), static_cast<std::uint8_t>(g / samples),
                        static_cast<std::uint8_t>(b / samples)};
    }
  }
  return image;
}

}  // namespace planish
