#include "tests/texture/sample_textures.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <cstring>
#include <numbers>
#include <random>

namespace planish {
namespace {

double Uniform(std::mt19937* random) {
  return static_cast<double>((*random)() >> 4) / (1U << 28);
}

double ValueAt(const TextureImage& image, std::int64_t x, std::int64_t y, int channel) {
  const ImageHeader& header = image.header;
  const std::int64_t wrapped_x = (x % header.width + header.width) % header.width;
  const std::int64_t wrapped_y = (y % header.height + header.height) % header.height;
  const auto at = static_cast<std::size_t>((wrapped_y * header.width + wrapped_x) * header.channels + channel);
  if (header.bits == 8) return image.texels[at];
  std::uint16_t value = 0;
  std::memcpy(&value, image.texels.data() + 2 * at, sizeof value);
  return value / 257.0;
}

}  // namespace

TextureImage MakeTexture(int width, int height, int channels, int bits,
                         const std::function<double(double, double, int)>& value) {
  TextureImage image;
  image.header = {ImageKind::kPng, width, height, channels, bits};
  for (int y = 0; y < height; ++y) {
    for (int x = 0; x < width; ++x) {
      for (int c = 0; c < channels; ++c) {
        const double v = std::clamp(value(x + 0.5, y + 0.5, c), 0.0, 1.0);
        if (bits == 8) {
          image.texels.push_back(static_cast<std::uint8_t>(std::lround(255 * v)));
        } else {
          const auto wide = static_cast<std::uint16_t>(std::lround(65535 * v));
          image.texels.resize(image.texels.size() + 2);
          std::memcpy(image.texels.data() + image.texels.size() - 2, &wide, 2);
        }
      }
    }
  }
  return image;
}

TextureImage SmoothTexture(int width, int height, double cycles, std::uint32_t seed, int channels, int bits) {
  std::mt19937 random(seed);
  struct Wave {
    double fx, fy, phase;
  };
  std::vector<std::vector<Wave>> waves(static_cast<std::size_t>(channels));
  for (auto& list : waves) {
    for (int i = 0; i < 6; ++i) {
      // Whole waves, so that the image tiles.
      const double angle = 2 * std::numbers::pi * Uniform(&random), f = cycles * std::sqrt(Uniform(&random));
      list.push_back({std::trunc(f * std::cos(angle) * width) / width,
                      std::trunc(f * std::sin(angle) * height) / height, 2 * std::numbers::pi * Uniform(&random)});
    }
  }
  return MakeTexture(width, height, channels, bits, [&](double x, double y, int c) {
    double sum = 0;
    for (const Wave& w : waves[static_cast<std::size_t>(c)]) {
      sum += std::sin(2 * std::numbers::pi * (w.fx * x + w.fy * y) + w.phase);
    }
    return 0.5 + 0.12 * sum;
  });
}

TextureImage NoiseTexture(int width, int height, std::uint32_t seed) {
  std::mt19937 random(seed);
  return MakeTexture(width, height, 3, 8, [&](double, double, int) { return Uniform(&random); });
}

namespace {

// `decoded`: of a value as the image has it.
template <typename Decoded>
std::vector<double> Bilinear(const TextureImage& image, const Vec2& uv, const Decoded& decoded) {
  const double x = uv.x() * image.header.width - 0.5, y = uv.y() * image.header.height - 0.5;
  const double fx = x - std::floor(x), fy = y - std::floor(y);
  const auto ix = static_cast<std::int64_t>(std::floor(x)), iy = static_cast<std::int64_t>(std::floor(y));
  const auto at = [&](std::int64_t i, std::int64_t j, int c) { return decoded(ValueAt(image, i, j, c)); };
  std::vector<double> values;
  for (int c = 0; c < image.header.channels; ++c) {
    values.push_back((1 - fy) * ((1 - fx) * at(ix, iy, c) + fx * at(ix + 1, iy, c)) +
                     fy * ((1 - fx) * at(ix, iy + 1, c) + fx * at(ix + 1, iy + 1, c)));
  }
  return values;
}

}  // namespace

std::vector<double> Shown(const TextureImage& image, const Vec2& uv) {
  return Bilinear(image, uv, [](double value) { return value; });
}

std::vector<double> ShownColor(const TextureImage& image, const Vec2& uv) {
  static const std::array<double, 256> linear = [] {
    std::array<double, 256> values;
    for (std::size_t i = 0; i < values.size(); ++i) values[i] = LinearOfSrgb(static_cast<double>(i) / 255);
    return values;
  }();
  std::vector<double> values =
      Bilinear(image, uv, [](double value) { return linear[static_cast<std::size_t>(value)]; });
  for (double& value : values) value = 255 * SrgbOfLinear(value);
  return values;
}

std::vector<TextureTriangle> TurnedSheet(int n, double turn, double shrink) {
  std::vector<TextureTriangle> triangles;
  const double scale = shrink * 0.45;
  for (int row = 0; row < n; ++row) {
    // Charts lie across each other's direction, far enough from each other for padding.
    const double angle = turn * (row + 1);
    const auto place = [&](double i, double j) {
      const Vec2 local = scale * Vec2(i / n - 0.5, (j - row - 0.5) / n);
      const Vec2 turned(std::cos(angle) * local.x() - std::sin(angle) * local.y(),
                        std::sin(angle) * local.x() + std::cos(angle) * local.y());
      return Vec2(turned + Vec2(0.25 + 0.5 * (row % 2), 0.25 + 0.5 * (row / 2 % 2)));
    };
    for (int i = 0; i < n; ++i) {
      const auto corner = [&](int di, int dj, std::size_t k, TextureTriangle* triangle) {
        triangle->from[k] = Vec2(static_cast<double>(i + di) / n, static_cast<double>(row + dj) / n);
        triangle->to[k] = place(i + di, row + dj);
      };
      TextureTriangle first, second;
      corner(0, 0, 0, &first), corner(1, 0, 1, &first), corner(1, 1, 2, &first);
      corner(0, 0, 0, &second), corner(1, 1, 1, &second), corner(0, 1, 2, &second);
      triangles.push_back(first);
      triangles.push_back(second);
    }
  }
  return triangles;
}

Difference Compare(const TextureImage& before, const TextureImage& after, const std::vector<TextureTriangle>& triangles,
                   int points) {
  std::mt19937 random(7);
  std::vector<double> differences;
  for (int i = 0; i < points; ++i) {
    const TextureTriangle& triangle = triangles[random() % triangles.size()];
    double a = Uniform(&random), b = Uniform(&random);
    if (a + b > 1) a = 1 - a, b = 1 - b;
    const auto at = [&](const std::array<Vec2, 3>& uv) {
      return Vec2(uv[0] + a * (uv[1] - uv[0]) + b * (uv[2] - uv[0]));
    };
    const std::vector<double> x = Shown(before, at(triangle.from)), y = Shown(after, at(triangle.to));
    for (std::size_t c = 0; c < x.size(); ++c) differences.push_back(std::abs(x[c] - y[c]));
  }
  std::sort(differences.begin(), differences.end());
  Difference result;
  for (const double d : differences) result.mean += d / static_cast<double>(differences.size());
  result.percentile99 = differences[differences.size() * 99 / 100];
  return result;
}

}  // namespace planish
