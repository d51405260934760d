// A texture as numbers to filter, with mipmaps. Used inside client/texture only.
#pragma once

#include <cmath>
#include <cstddef>
#include <cstdint>
#include <vector>

#include "client/texture/image.h"
#include "client/texture/texture_baker.h"
#include "core/base/thread_team.h"

namespace planish::texture_internal {

// Red, green, blue and alpha. GCC and clang make vector instructions of it.
using Rgba = float __attribute__((vector_size(16)));

// One level: four channels a texel, linear, in units of TexelScale<Texel>().
template <typename Texel>
struct TextureLevel {
  int width = 0, height = 0;
  std::vector<Texel> texels;
};

// The number that stands for 1 in a level. Levels of 16 bits suffice for images of 8 bits, even in linear light.
template <typename Texel>
constexpr float TexelScale() {
  return sizeof(Texel) == 2 ? 65535.0F : 1.0F;
}

// Tables: the linear light of each sRGB value of 8 bits, and the sRGB value of 8 bits for each linear one of 16 bits.
const float* LinearOfSrgb8();           // 256 entries
const std::uint8_t* Srgb8OfLinear16();  // 65536 entries

template <typename Texel>
class TextureLevels {
 public:
  TextureLevels(const TextureSource& source, bool srgb, bool premultiplied, ThreadTeam* team);

  // Makes mipmaps up to `level`, but none below a level of one texel. Returns the last level up to `level`.
  int MakeLevel(int level);
  const TextureLevel<Texel>& level(int level) const { return levels_[static_cast<std::size_t>(level)]; }

  // The value at (x, y), in texels of the level with centres at halves. `sharpness`: 0 (linear) to 1 (cubic).
  // The result is in units of TexelScale, and may lie outside of [0, 1].
  Rgba At(const TextureLevel<Texel>& level, double x, double y, float sharpness) const;

 private:
  static int Wrapped(std::int64_t i, int size, TextureWrap wrap);
  static Rgba Load(const Texel* texel);

  TextureWrap wrap_u_, wrap_v_;
  bool nearest_;
  ThreadTeam* team_;
  std::vector<TextureLevel<Texel>> levels_;
};

template <typename Texel>
inline Rgba TextureLevels<Texel>::Load(const Texel* texel) {
  if constexpr (sizeof(Texel) == 2) {
    return Rgba{static_cast<float>(texel[0]), static_cast<float>(texel[1]), static_cast<float>(texel[2]),
                static_cast<float>(texel[3])};
  } else {
    return Rgba{texel[0], texel[1], texel[2], texel[3]};
  }
}

template <typename Texel>
inline int TextureLevels<Texel>::Wrapped(std::int64_t i, int size, TextureWrap wrap) {
  if (wrap == TextureWrap::kClamp) return static_cast<int>(i < 0 ? 0 : i >= size ? size - 1 : i);
  const std::int64_t period = wrap == TextureWrap::kMirror ? 2 * std::int64_t{size} : size;
  std::int64_t m = i % period;
  if (m < 0) m += period;
  return static_cast<int>(m < size ? m : period - 1 - m);
}

template <typename Texel>
inline Rgba TextureLevels<Texel>::At(const TextureLevel<Texel>& level, double x, double y, float sharpness) const {
  const double fx = std::floor(x - 0.5), fy = std::floor(y - 0.5);
  const auto ix = static_cast<std::int64_t>(fx), iy = static_cast<std::int64_t>(fy);
  const Texel* const texels = level.texels.data();
  const auto width = static_cast<std::size_t>(level.width);
  if (nearest_) {
    const int px = Wrapped(static_cast<std::int64_t>(std::floor(x)), level.width, wrap_u_);
    const int py = Wrapped(static_cast<std::int64_t>(std::floor(y)), level.height, wrap_v_);
    return Load(texels + 4 * (static_cast<std::size_t>(py) * width + static_cast<std::size_t>(px)));
  }
  const auto weights = [sharpness](float t, float* w) {
    // A mixture of the cubic of Catmull and Rom and linear interpolation.
    const float t2 = t * t, t3 = t2 * t, s = sharpness;
    w[0] = s * 0.5F * (-t3 + 2 * t2 - t);
    w[3] = s * 0.5F * (t3 - t2);
    w[1] = s * 0.5F * (3 * t3 - 5 * t2 + 2) + (1 - s) * (1 - t);
    w[2] = s * 0.5F * (-3 * t3 + 4 * t2 + t) + (1 - s) * t;
  };
  float wx[4], wy[4];
  weights(static_cast<float>(x - 0.5 - fx), wx);
  weights(static_cast<float>(y - 0.5 - fy), wy);
  Rgba sum = {};
  if (ix >= 1 && iy >= 1 && ix + 2 < level.width && iy + 2 < level.height) {
    const Texel* row = texels + 4 * (static_cast<std::size_t>(iy - 1) * width + static_cast<std::size_t>(ix - 1));
    for (int j = 0; j < 4; ++j, row += 4 * width) {
      sum += wy[j] * (wx[0] * Load(row) + wx[1] * Load(row + 4) + wx[2] * Load(row + 8) + wx[3] * Load(row + 12));
    }
    return sum;
  }
  std::size_t columns[4];
  for (int i = 0; i < 4; ++i) columns[i] = 4 * static_cast<std::size_t>(Wrapped(ix - 1 + i, level.width, wrap_u_));
  for (int j = 0; j < 4; ++j) {
    const Texel* const row = texels + 4 * width * static_cast<std::size_t>(Wrapped(iy - 1 + j, level.height, wrap_v_));
    Rgba line = {};
    for (int i = 0; i < 4; ++i) line += wx[i] * Load(row + columns[i]);
    sum += wy[j] * line;
  }
  return sum;
}

}  // namespace planish::texture_internal
