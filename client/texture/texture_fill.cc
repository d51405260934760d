// Fills a new image where nothing was drawn.
#include <array>
#include <cstddef>
#include <cstdint>
#include <type_traits>
#include <utility>
#include <vector>

#include "client/texture/texture_raster.h"

namespace planish {
namespace {

// The means of the drawn texels, one for each square of 2^k texels.
struct FillLevel {
  int width = 0, height = 0;
  std::vector<std::uint16_t> values;
  std::vector<bool> has;
};

template <typename Value>
void FillGaps(const ImageHeader& header, const std::vector<std::uint8_t>& drawn, Value* texels) {
  const auto channels = static_cast<std::size_t>(header.channels);
  std::vector<FillLevel> levels;
  // Adds the level above a level of `width` x `height` with these values.
  const auto add = [&](int width, int height, const auto& has, const auto* values) {
    FillLevel level;
    level.width = (width + 1) / 2;
    level.height = (height + 1) / 2;
    const auto count = static_cast<std::size_t>(level.width) * static_cast<std::size_t>(level.height);
    level.values.resize(count * channels);
    level.has.resize(count);
    for (int y = 0; y < level.height; ++y) {
      for (int x = 0; x < level.width; ++x) {
        std::array<std::uint32_t, 4> sum = {};
        std::uint32_t found = 0;
        for (int k = 0; k < 4; ++k) {
          const int i = 2 * x + k % 2, j = 2 * y + k / 2;
          if (i >= width || j >= height) continue;
          const std::size_t at =
              static_cast<std::size_t>(j) * static_cast<std::size_t>(width) + static_cast<std::size_t>(i);
          if (!has[at]) continue;
          ++found;
          for (std::size_t c = 0; c < channels; ++c) sum[c] += values[at * channels + c];
        }
        const std::size_t at =
            static_cast<std::size_t>(y) * static_cast<std::size_t>(level.width) + static_cast<std::size_t>(x);
        level.has[at] = found > 0;
        for (std::size_t c = 0; c < channels && found > 0; ++c) {
          level.values[at * channels + c] = static_cast<std::uint16_t>((sum[c] + found / 2) / found);
        }
      }
    }
    levels.push_back(std::move(level));
  };
  add(header.width, header.height, drawn, texels);
  levels.reserve(32);  // keeps references to elements valid
  while (levels.back().width > 1 || levels.back().height > 1) {
    const FillLevel& below = levels.back();
    add(below.width, below.height, below.has, below.values.data());
  }
  if (!levels.back().has[0]) return;  // nothing was drawn
  const auto fill = [&](int width, int height, const FillLevel& from, const auto& has, auto* values) {
    for (int y = 0; y < height; ++y) {
      for (int x = 0; x < width; ++x) {
        const std::size_t at =
            static_cast<std::size_t>(y) * static_cast<std::size_t>(width) + static_cast<std::size_t>(x);
        if (has[at]) continue;
        const std::size_t source =
            static_cast<std::size_t>(y / 2) * static_cast<std::size_t>(from.width) + static_cast<std::size_t>(x / 2);
        for (std::size_t c = 0; c < channels; ++c) {
          values[at * channels + c] =
              static_cast<std::decay_t<decltype(values[0])>>(from.values[source * channels + c]);
        }
      }
    }
  };
  for (std::size_t l = levels.size() - 1; l > 0; --l) {
    fill(levels[l - 1].width, levels[l - 1].height, levels[l], levels[l - 1].has, levels[l - 1].values.data());
  }
  fill(header.width, header.height, levels[0], drawn, texels);
}

}  // namespace

void texture_internal::FillUndrawn(const std::vector<std::uint8_t>& drawn, TextureImage* image) {
  if (image->header.bits == 8) {
    FillGaps(image->header, drawn, image->texels.data());
  } else {
    FillGaps(image->header, drawn, reinterpret_cast<std::uint16_t*>(image->texels.data()));
  }
}

TextureImage TextureBaker::Finish() {
  owner_ = std::vector<std::int32_t>();
  MakeImage();  // no effect if something was drawn
  texture_internal::FillUndrawn(drawn_, &image_);
  drawn_.clear();
  return std::move(image_);
}

}  // namespace planish
