// Resamples images from one map of a surface to another.
#pragma once

#include <array>
#include <atomic>
#include <cstdint>
#include <memory>
#include <span>
#include <vector>

#include "absl/status/status.h"
#include "client/texture/image.h"
#include "core/base/thread_team.h"
#include "core/mesh/mesh.h"

namespace planish {

enum class TextureWrap { kRepeat, kMirror, kClamp };

// How the values of a texture are interpreted.
enum class TextureMeaning {
  kColor,      // colours: filtered in linear light
  kData,       // values that are filtered without conversion
  kNormal,     // directions in the tangent frame, as RGB: converted to the frame of the new map
  kDirection,  // as kNormal, but directions in the tangent plane, as RG; B is data (KHR_materials_anisotropy)
};

// A triangle of the surface in both maps: UV from the upper left corner of the image, v downwards. `from` may be
// anywhere; the sampler decides how it wraps. `to` is in [0, 1]; parts outside are not drawn.
struct TextureTriangle {
  std::array<Vec2, 3> from, to;
};

// The tangent frame of a corner in both maps, as glTF has it: the bitangent is normal x tangent, times the sign.
struct CornerFrames {
  std::array<float, 3> normal;
  std::array<float, 4> from_tangent, to_tangent;  // x, y, z, sign
};

// An image to read from, and how the sampler reads it.
struct TextureSource {
  const TextureImage* image = nullptr;
  TextureImage* spent = nullptr;  // `image`, if Draw() may free its texels once they are read
  TextureWrap wrap_u = TextureWrap::kRepeat, wrap_v = TextureWrap::kRepeat;
  bool nearest = false;  // the sampler magnifies without interpolation: pixels keep their edges
};

struct BakeOptions {
  TextureMeaning meaning = TextureMeaning::kColor;
  // Colours are weighted with their alpha when they are filtered. Otherwise each channel is filtered by itself.
  bool premultiplied = false;
  double normal_scale = 1;  // for kNormal: multiplies x and y when the image is read
  // kNormal: whether the new image keeps the scale for the renderer to apply; otherwise the scale is painted in.
  bool keeps_normal_scale = true;
  // Each value becomes factor * value + offset: colours in linear light, and their alpha. Colours have no offset.
  std::array<float, 4> factor = {1, 1, 1, 1}, offset = {0, 0, 0, 0};
};

using CornerColor = std::array<float, 4>;  // red, green, blue (linear) and alpha

// The triangles that Draw() draws. `frames` and `colors` are empty, or have three elements per triangle.
struct TextureGeometry {
  std::span<const TextureTriangle> triangles;
  std::span<const CornerFrames> frames = {};  // for kNormal and kDirection
  std::span<const CornerColor> colors = {};   // the image is multiplied by them
  std::size_t first = 0;                      // index of the first of `triangles` in the list given to Claim()
};

// Draws sources into a new image, one after the other.
//
// The affine map of each triangle from the new image to the old one gives the exact footprint of a new texel. Along
// each principal axis of that map, of singular value s (old texels per new texel), the image is averaged over
// sqrt(max(0, s^2 - 1)) old texels: together with the texel's own width a box of variance s^2. Samples are one old
// texel apart or closer; where that would be more than kMostMinorSamples or kMostMajorSamples, they are read from a
// mipmap. Each sample is interpolated by the cubic of Catmull and Rom, so that the image stays as sharp as it was;
// where the new map is denser, or half as dense, the interpolation becomes linear, as renderers draw the old image.
//
// Texels beside a chart, up to kRing away, are drawn from the nearest triangle. Samples do not go farther than half an
// old texel beyond an edge at which either map is cut, since the texels there belong to something else.
class TextureBaker {
 public:
  // Starts with an empty image. From the first Draw() on, takes header.bytes() of memory and a byte per texel.
  TextureBaker(const ImageHeader& header, ThreadTeam* team);

  // For a new image of several sources: decides, before the first Draw(), which of all its triangles each texel belongs
  // to, so that a texel between charts gets the nearest of them all. Each Draw() then takes as long as its own
  // triangles are large. Takes 4 bytes of memory a texel until Finish().
  void Claim(std::span<const TextureTriangle> all);

  // Takes 8 bytes per texel of the old image (16 if it has 16 bits), and a third more for mipmaps. CANCELLED once *stop
  // is true (null: never).
  absl::Status Draw(const TextureSource& source, const TextureGeometry& geometry, const BakeOptions& options,
                    const std::atomic<bool>* stop = nullptr);

  // Fills texels that were not drawn, so that no mipmap shows a background. Each takes the mean of the drawn texels in
  // the smallest aligned square of 2^k texels around it that has any. Returns the image, and leaves the baker empty.
  TextureImage Finish();

  // The bytes of memory that Draw() takes for an old image.
  static std::int64_t SourceBytes(const ImageHeader& header);

 private:
  template <typename Texel>
  absl::Status DrawFrom(const TextureSource& source, const TextureGeometry& geometry, const BakeOptions& options,
                        const std::atomic<bool>* stop);

  void MakeImage();

  TextureImage image_;
  std::vector<std::int32_t> owner_;  // per texel: the triangle given to Claim() that it belongs to, -1: none
  std::vector<std::uint8_t> drawn_;  // per texel: 0 not drawn, 1 beside a triangle, 2 in a triangle
  ThreadTeam* team_;
};

// The side of a square image in which nine tenths of the surface have at least as many texels per length as in the old
// image. This is the 90th percentile, weighted by `areas` (of the triangles on the surface), of the square root of a
// triangle's area in old texels over its area in the new map. 0 if no triangle has an area in both.
double TextureSideOf(std::span<const TextureTriangle> triangles, std::span<const double> areas, int old_width,
                     int old_height);

}  // namespace planish
