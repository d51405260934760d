// Textures for tests, and a renderer's view of them.
#pragma once

#include <cstdint>
#include <functional>
#include <vector>

#include "client/texture/image.h"
#include "client/texture/texture_baker.h"

namespace planish {

// An image of `channels` whose values, in [0, 1], are value(x, y, channel) at the centres of texels.
TextureImage MakeTexture(int width, int height, int channels, int bits,
                         const std::function<double(double, double, int)>& value);

// Waves of at most `cycles` a texel, seeded.
TextureImage SmoothTexture(int width, int height, double cycles, std::uint32_t seed, int channels = 3, int bits = 8);
TextureImage NoiseTexture(int width, int height, std::uint32_t seed);

// What a renderer shows at (u, v), v downwards: bilinear, wrapped round. 0 to 255, as the image has the values.
std::vector<double> Shown(const TextureImage& image, const Vec2& uv);
// The same of a texture of colours, three of 8 bits: interpolated in linear light, as glTF has it (Khronos' sample
// TextureLinearInterpolationTest shows the difference), and encoded as sRGB again.
std::vector<double> ShownColor(const TextureImage& image, const Vec2& uv);

// A sheet of n x n squares over the whole old image; in the new map each row of squares is a chart of its own, turned
// by an angle, at the same texels a length where both images have `side` texels and the new map is `shrink` times as
// dense.
std::vector<TextureTriangle> TurnedSheet(int n, double turn, double shrink);

struct Difference {
  double mean = 0, percentile99 = 0;
};
// Of what both maps show at random points of the triangles.
Difference Compare(const TextureImage& before, const TextureImage& after, const std::vector<TextureTriangle>& triangles,
                   int points);

}  // namespace planish
