#include "client/texture/texture_levels.h"

#include <algorithm>
#include <array>
#include <bit>

namespace planish::texture_internal {

const float* LinearOfSrgb8() {
  static const std::array<float, 256> table = [] {
    std::array<float, 256> values;
    for (std::size_t i = 0; i < values.size(); ++i) {
      values[i] = static_cast<float>(LinearOfSrgb(static_cast<double>(i) / 255));
    }
    return values;
  }();
  return table.data();
}

const std::uint8_t* Srgb8OfLinear16() {
  static const std::vector<std::uint8_t> table = [] {
    std::vector<std::uint8_t> values(65536);
    for (std::size_t i = 0; i < values.size(); ++i) {
      values[i] = static_cast<std::uint8_t>(std::lround(255 * SrgbOfLinear(static_cast<double>(i) / 65535)));
    }
    return values;
  }();
  return table.data();
}

namespace {

constexpr std::int64_t kRowsAChunk = 32;

template <typename Texel>
Texel Rounded(float value) {
  if constexpr (sizeof(Texel) == 2) {
    return static_cast<Texel>(std::clamp(value, 0.0F, 65535.0F) + 0.5F);
  } else {
    return value;
  }
}

}  // namespace

template <typename Texel>
TextureLevels<Texel>::TextureLevels(const TextureSource& source, bool srgb, bool premultiplied, ThreadTeam* team)
    : wrap_u_(source.wrap_u), wrap_v_(source.wrap_v), nearest_(source.nearest), team_(team), levels_(1) {
  const ImageHeader& header = source.image->header;
  TextureLevel<Texel>& base = levels_[0];
  base.width = header.width;
  base.height = header.height;
  base.texels.resize(4 * static_cast<std::size_t>(header.texels()));
  // Tables from values of 8 or 16 bits to numbers of a level: `linear` for colours, `plain` for alpha.
  constexpr float scale = TexelScale<Texel>();
  std::vector<float> linear(std::size_t{1} << header.bits), plain(linear.size());
  const double most = static_cast<double>(linear.size()) - 1;
  for (std::size_t i = 0; i < linear.size(); ++i) {
    const double value = static_cast<double>(i) / most;
    plain[i] = static_cast<float>(scale * value);
    linear[i] =
        srgb ? static_cast<float>(scale * (header.bits == 8 ? LinearOfSrgb8()[i] : LinearOfSrgb(value))) : plain[i];
  }
  const int channels = header.channels;
  const bool has_alpha = header.has_alpha();
  const auto fill = [&](const auto* values) {
    team->For(header.height, kRowsAChunk, [&](std::int64_t begin, std::int64_t end) {
      const std::size_t first = static_cast<std::size_t>(begin) * static_cast<std::size_t>(header.width);
      const std::size_t last = static_cast<std::size_t>(end) * static_cast<std::size_t>(header.width);
      for (std::size_t i = first; i < last; ++i) {
        const auto* const in = values + i * static_cast<std::size_t>(channels);
        Texel* const out = base.texels.data() + 4 * i;
        const float alpha = has_alpha ? plain[in[channels - 1]] : scale;
        const float weight = premultiplied && has_alpha ? alpha / scale : 1.0F;
        for (int c = 0; c < 3; ++c) out[c] = Rounded<Texel>(weight * linear[in[channels >= 3 ? c : 0]]);
        out[3] = Rounded<Texel>(alpha);
      }
    });
  };
  if (header.bits == 8) {
    fill(source.image->texels.data());
  } else {
    fill(reinterpret_cast<const std::uint16_t*>(source.image->texels.data()));
  }
}

template <typename Texel>
int TextureLevels<Texel>::MakeLevel(int level) {
  while (static_cast<int>(levels_.size()) <= level) {
    const TextureLevel<Texel>& from = levels_.back();
    if (from.width == 1 && from.height == 1) break;
    TextureLevel<Texel> to;
    to.width = std::max(1, from.width / 2);
    to.height = std::max(1, from.height / 2);
    to.texels.resize(4 * static_cast<std::size_t>(to.width) * static_cast<std::size_t>(to.height));
    // A texel is the mean over the area that it covers. Where a side is odd, this area has parts of texels.
    const double step_x = static_cast<double>(from.width) / to.width;
    const double step_y = static_cast<double>(from.height) / to.height;
    team_->For(to.height, kRowsAChunk, [&](std::int64_t begin, std::int64_t end) {
      for (std::int64_t y = begin; y < end; ++y) {
        const double top = static_cast<double>(y) * step_y, bottom = top + step_y;
        for (int x = 0; x < to.width; ++x) {
          const double left = x * step_x, right = left + step_x;
          Rgba sum = {};
          for (int j = static_cast<int>(top); j < from.height && j < bottom; ++j) {
            const double rows = std::min(bottom, j + 1.0) - std::max(top, static_cast<double>(j));
            for (int i = static_cast<int>(left); i < from.width && i < right; ++i) {
              const double columns = std::min(right, i + 1.0) - std::max(left, static_cast<double>(i));
              sum += static_cast<float>(rows * columns) *
                     Load(from.texels.data() + 4 * (static_cast<std::size_t>(j) * static_cast<std::size_t>(from.width) +
                                                    static_cast<std::size_t>(i)));
            }
          }
          sum /= static_cast<float>(step_x * step_y);
          Texel* const out = to.texels.data() + 4 * (static_cast<std::size_t>(y) * static_cast<std::size_t>(to.width) +
                                                     static_cast<std::size_t>(x));
          for (int c = 0; c < 4; ++c) out[c] = Rounded<Texel>(sum[c]);
        }
      }
    });
    levels_.push_back(std::move(to));
  }
  return std::min(level, static_cast<int>(levels_.size()) - 1);
}

template class TextureLevels<std::uint16_t>;
template class TextureLevels<float>;

}  // namespace planish::texture_internal
