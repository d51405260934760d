#include "client/texture/texture_baker.h"

#include <algorithm>
#include <bit>
#include <cmath>
#include <cstring>
#include <limits>
#include <unordered_map>
#include <utility>

#include "Eigen/Geometry"
#include "client/texture/texture_levels.h"
#include "client/texture/texture_raster.h"
#include "core/base/error.h"
#include "core/base/status_macros.h"

namespace planish {
namespace {

using texture_internal::BandTexels;
using texture_internal::BeyondEdges;
using texture_internal::Cross;
using texture_internal::ForEachTexelNear;
using texture_internal::HalfPlane;
using texture_internal::kBandRows;
using texture_internal::kRing;
using texture_internal::NearestOnBorder;
using texture_internal::RasterTriangle;
using texture_internal::Rgba;
using texture_internal::SetTarget;
using texture_internal::TexelScale;
using texture_internal::TextureLevel;
using texture_internal::TextureLevels;

// A mipmap is read where a new texel would take more samples than these along the smaller or the larger axis of its
// footprint.
constexpr double kMostMinorSamples = 4;
constexpr double kMostMajorSamples = 64;
// Farthest distance of a sample beyond the edge of a chart, in old texels.
constexpr double kOverhang = 0.5;
// Interpolation is linear where a new texel is narrower than this, in old texels. It is cubic at a width of 1, and
// linear again from 2 on, where the mean over the footprint decides.
constexpr double kLinearBelow = 0.5;
// Larger UV count as 0, since floats of that size have hardly any digits of a fraction.
constexpr double kLargestUv = 1e6;

// Per corner k of each triangle, whether the opposite edge is whole: another triangle has the same UV at both ends of
// the edge, in the old map and in the new one.
class WholeEdges {
 public:
  explicit WholeEdges(std::span<const TextureTriangle> triangles) : whole_(3 * triangles.size(), false) {
    std::unordered_map<Key, std::size_t, Hash> edges;
    edges.reserve(3 * triangles.size());
    for (std::size_t t = 0; t < triangles.size(); ++t) {
      for (std::size_t k = 0; k < 3; ++k) {
        Key key = KeyOf(triangles[t], (k + 1) % 3, (k + 2) % 3);
        const auto [other, is_new] = edges.emplace(key, 3 * t + k);
        if (is_new) continue;
        whole_[3 * t + k] = whole_[other->second] = true;
      }
    }
  }
  bool At(std::size_t triangle, std::size_t k) const { return whole_[3 * triangle + k]; }

 private:
  using Key = std::array<std::uint64_t, 8>;
  struct Hash {
    std::size_t operator()(const Key& key) const {
      std::uint64_t hash = 0;
      for (const std::uint64_t part : key) hash = (std::rotl(hash, 23) ^ part) * 0x9E3779B97F4A7C15;
      return static_cast<std::size_t>(hash ^ hash >> 32);
    }
  };
  static Key KeyOf(const TextureTriangle& triangle, std::size_t a, std::size_t b) {
    std::array<std::array<double, 4>, 2> ends;
    for (const std::size_t i : {std::size_t{0}, std::size_t{1}}) {
      const std::size_t corner = i == 0 ? a : b;
      // Adding zero turns -0 into 0.
      ends[i] = {triangle.from[corner].x() + 0.0, triangle.from[corner].y() + 0.0, triangle.to[corner].x() + 0.0,
                 triangle.to[corner].y() + 0.0};
    }
    if (ends[1] < ends[0]) std::swap(ends[0], ends[1]);
    return std::bit_cast<Key>(ends);
  }

  std::vector<bool> whole_;
};

// One triangle, in texels of both images.
struct Footprint : RasterTriangle {
  Vec2 origin = Vec2(0, 0);                         // old texels at to[0]
  Vec2 along_x = Vec2(0, 0), along_y = Vec2(0, 0);  // old texels per new texel
  int level = 0;
  double level_scale = 1;
  float sharpness = 1;
  int samples_major = 1, samples_minor = 1;
  Vec2 major = Vec2(0, 0), minor = Vec2(0, 0);  // old texels from one sample to the next
  int limits = 0;
  std::array<HalfPlane, 3> limit;  // the first `limits` bound the samples, in old texels
  Vec2 centroid = Vec2(0, 0);      // in old texels

  Vec2 OldAt(const Vec2& p) const { return origin + (p.x() - to[0].x()) * along_x + (p.y() - to[0].y()) * along_y; }
};

// `uv` with values that are no numbers or above kLargestUv replaced by 0, and moved by whole repeats of the image to
// near 0.
std::array<Vec2, 3> TameUv(const std::array<Vec2, 3>& uv, TextureWrap wrap_u, TextureWrap wrap_v) {
  std::array<Vec2, 3> tame = uv;
  for (Vec2& value : tame) {
    for (double& x : value) {
      if (!(std::abs(x) <= kLargestUv)) x = 0;
    }
  }
  for (int axis = 0; axis < 2; ++axis) {
    const TextureWrap wrap = axis == 0 ? wrap_u : wrap_v;
    if (wrap == TextureWrap::kClamp) continue;
    const double least = std::min({tame[0][axis], tame[1][axis], tame[2][axis]});
    const double period = wrap == TextureWrap::kMirror ? 2 : 1;
    const double shift = period * std::floor(least / period);
    for (Vec2& value : tame) value[axis] -= shift;
  }
  return tame;
}

// Axes of the footprint of a new texel in old texels, with their lengths: the singular values of the map.
struct FootprintAxes {
  Vec2 major = Vec2(1, 0), minor = Vec2(0, 1);
  double s1 = 0, s2 = 0;
};

FootprintAxes AxesOf(const Vec2& along_x, const Vec2& along_y) {
  const double xx = along_x.x() * along_x.x() + along_y.x() * along_y.x();
  const double yy = along_x.y() * along_x.y() + along_y.y() * along_y.y();
  const double xy = along_x.x() * along_x.y() + along_y.x() * along_y.y();
  const double middle = (xx + yy) / 2, half = std::sqrt((xx - yy) * (xx - yy) / 4 + xy * xy);
  FootprintAxes axes;
  axes.s1 = std::sqrt(middle + half);
  axes.s2 = std::sqrt(std::max(0.0, middle - half));
  const Vec2 direction = xx > yy ? Vec2(middle + half - yy, xy) : Vec2(xy, middle + half - xx);
  const double length = direction.norm();
  if (length > 0) axes.major = direction / length;
  axes.minor = Vec2(-axes.major.y(), axes.major.x());
  return axes;
}

template <typename Texel>
class TextureDrawing {
 public:
  TextureDrawing(const TextureSource& source, const TextureGeometry& geometry, const BakeOptions& options,
                 const ImageHeader& target, ThreadTeam* team)
      : source_(source),
        triangles_(geometry.triangles),
        frames_(geometry.frames),
        colors_(geometry.colors),
        first_(geometry.first),
        options_(options),
        target_(target),
        whole_(geometry.triangles),
        levels_(source, options.meaning == TextureMeaning::kColor, options.premultiplied, team) {
    // Makes all mipmaps that the triangles need, before threads read them.
    int deepest = 0;
    for (std::size_t t = 0; t < triangles_.size(); ++t) {
      Footprint footprint;
      if (!SetTarget(triangles_[t], target, &footprint)) continue;
      SetSource(t, &footprint);
      deepest = std::max(deepest, LevelFor(AxesOf(footprint.along_x, footprint.along_y)));
    }
    deepest_ = levels_.MakeLevel(deepest);
  }

  // Draws rows [first_row, end_row). `list` has the triangles that may have texels there. `owner`: as
  // TextureBaker::owner_; if it is empty, a texel belongs to the nearest triangle of the list.
  void DrawBand(std::span<const std::int32_t> list, std::span<const std::int32_t> owner, int first_row, int end_row,
                TextureImage* image, std::vector<std::uint8_t>* drawn) const {
    const auto width = static_cast<std::size_t>(target_.width);
    const std::size_t first = width * static_cast<std::size_t>(first_row);
    std::vector<BandTexels> texels;
    if (owner.empty()) texels.emplace_back(width * static_cast<std::size_t>(end_row - first_row));
    std::vector<Footprint> footprints(list.size());
    for (std::size_t k = 0; k < list.size(); ++k) {
      const auto t = static_cast<std::size_t>(list[k]);
      Footprint& footprint = footprints[k];
      if (!SetTarget(triangles_[t], target_, &footprint)) continue;
      if (owner.empty()) {
        texture_internal::Claim(footprint, static_cast<std::int32_t>(k), first_row, end_row, &texels[0]);
        continue;
      }
      bool is_ready = false;
      ForEachTexelNear(footprint, first_row, end_row, target_.width, [&](std::size_t i, const Vec2& p) {
        if (owner[first + i] != static_cast<std::int32_t>(first_ + t)) return;
        if (!is_ready) Prepare(t, &footprint);
        is_ready = true;
        DrawTexel(footprint, t, p, BeyondEdges(footprint, p) <= 0, first + i, image, drawn);
      });
    }
    if (!owner.empty()) return;
    std::vector<bool> is_ready(list.size(), false);
    for (std::size_t i = 0; i < texels[0].owner.size(); ++i) {
      if (texels[0].owner[i] < 0) continue;
      const auto k = static_cast<std::size_t>(texels[0].owner[i]), t = static_cast<std::size_t>(list[k]);
      if (!is_ready[k]) Prepare(t, &footprints[k]);
      is_ready[k] = true;
      const Vec2 p(static_cast<double>(i % width) + 0.5, first_row + static_cast<double>(i / width) + 0.5);
      DrawTexel(footprints[k], t, p, texels[0].distance[i] <= 0, first + i, image, drawn);
    }
  }

 private:
  void Prepare(std::size_t t, Footprint* footprint) const {
    SetSource(t, footprint);
    SetSamples(footprint);
  }

  // Draws texel number `at`, whose middle is `p`.
  void DrawTexel(const Footprint& footprint, std::size_t t, const Vec2& p, bool is_inside, std::size_t at,
                 TextureImage* image, std::vector<std::uint8_t>* drawn) const {
    const std::uint8_t rank = is_inside ? 2 : 1;
    if ((*drawn)[at] >= rank) return;
    Rgba value = Mean(footprint, is_inside ? p : Near(footprint, p));
    if (!frames_.empty()) value = InNewFrame(footprint, t, p, value);
    value = Scaled(footprint, t, p, value);
    Store(value, image->texels.data() + at * static_cast<std::size_t>(target_.channels * (target_.bits / 8)));
    (*drawn)[at] = rank;
  }

  void SetSource(std::size_t t, Footprint* footprint) const {
    const TextureTriangle& triangle = triangles_[t];
    const ImageHeader& header = source_.image->header;
    std::array<Vec2, 3> from = TameUv(triangle.from, source_.wrap_u, source_.wrap_v);
    for (Vec2& p : from) p = Vec2(p.x() * header.width, p.y() * header.height);
    const std::array<Vec2, 3>& to = footprint->to;
    const Vec2 e1 = to[1] - to[0], e2 = to[2] - to[0];
    const Vec2 f1 = from[1] - from[0], f2 = from[2] - from[0];
    const double area = Cross(e1, e2);
    footprint->origin = from[0];
    footprint->along_x = (f1 * e2.y() - f2 * e1.y()) / area;
    footprint->along_y = (f2 * e1.x() - f1 * e2.x()) / area;
    const double old_area = Cross(f1, f2);
    footprint->limits = 0;
    if (old_area == 0) return;
    for (std::size_t k = 0; k < 3; ++k) {
      if (whole_.At(t, k)) continue;
      const Vec2& a = from[(k + 1) % 3];
      const Vec2 d = from[(k + 2) % 3] - a;
      const Vec2 normal = (old_area < 0 ? Vec2(-d.y(), d.x()) : Vec2(d.y(), -d.x())).normalized();
      if (!normal.allFinite()) continue;
      footprint->limit[static_cast<std::size_t>(footprint->limits++)] = {normal, normal.dot(a)};
    }
    footprint->centroid = (from[0] + from[1] + from[2]) / 3;
  }

  int LevelFor(const FootprintAxes& axes) const {
    if (source_.nearest) return 0;
    const double factor = std::max(axes.s2 / kMostMinorSamples, axes.s1 / kMostMajorSamples);
    return factor > 1 ? std::min(20, static_cast<int>(std::ceil(std::log2(factor)))) : 0;
  }

  void SetSamples(Footprint* footprint) const {
    const FootprintAxes axes = AxesOf(footprint->along_x, footprint->along_y);
    footprint->level = std::min(LevelFor(axes), deepest_);
    const double texel = std::ldexp(1.0, footprint->level);  // width of the level's texels, in old texels
    const auto samples = [&](double s, const Vec2& axis, int* count) -> Vec2 {
      s /= texel;
      // Without interpolation pixels keep their edges: averages over the whole width of the new texel.
      const double width = source_.nearest ? s : std::sqrt(std::max(0.0, s * s - 1));
      *count = static_cast<int>(std::clamp(std::ceil(source_.nearest ? 4 * width : width), 1.0, kMostMajorSamples));
      return axis * (texel * width / *count);
    };
    footprint->major = samples(axes.s1, axes.major, &footprint->samples_major);
    footprint->minor = samples(axes.s2, axes.minor, &footprint->samples_minor);
    const double sharp = std::min((axes.s1 - kLinearBelow) / (1 - kLinearBelow), 2 - axes.s2);
    footprint->sharpness = static_cast<float>(std::clamp(sharp, 0.0, 1.0));
    // Texels of mipmaps cover more old texels: samples stay that much farther inside, if the triangle is large enough.
    const double overhang = footprint->level == 0 ? kOverhang : 1.5 * (1 - texel) + kOverhang;
    for (int k = 0; k < footprint->limits; ++k) {
      HalfPlane& limit = footprint->limit[static_cast<std::size_t>(k)];
      limit.offset = std::max(limit.offset + overhang, limit.normal.dot(footprint->centroid));
    }
  }

  // `p`, which is beside the triangle; moved to the distance kOverhang, in old texels, if it is farther away.
  static Vec2 Near(const Footprint& footprint, const Vec2& p) {
    const Vec2 border = NearestOnBorder(footprint, p), beyond = p - border;
    const double old = (beyond.x() * footprint.along_x + beyond.y() * footprint.along_y).norm();
    return old > kOverhang ? Vec2(border + beyond * (kOverhang / old)) : p;
  }

  Rgba Mean(const Footprint& footprint, const Vec2& p) const {
    const TextureLevel<Texel>& level = levels_.level(footprint.level);
    const double scale_x = static_cast<double>(level.width) / source_.image->header.width;
    const double scale_y = static_cast<double>(level.height) / source_.image->header.height;
    const Vec2 centre = footprint.OldAt(p);
    Rgba sum = {};
    for (int j = 0; j < footprint.samples_minor; ++j) {
      const Vec2 row = centre + footprint.minor * (j - 0.5 * (footprint.samples_minor - 1));
      for (int i = 0; i < footprint.samples_major; ++i) {
        Vec2 at = row + footprint.major * (i - 0.5 * (footprint.samples_major - 1));
        for (int k = 0; k < footprint.limits; ++k) {
          const HalfPlane& limit = footprint.limit[static_cast<std::size_t>(k)];
          const double beyond = limit.normal.dot(at) - limit.offset;
          if (beyond > 0) at -= beyond * limit.normal;
        }
        // The map of a needle may send points arbitrarily far away, or to NaN.
        if (!(at.cwiseAbs().maxCoeff() < 1e12)) at = Vec2(0, 0);
        sum += levels_.At(level, at.x() * scale_x, at.y() * scale_y, footprint.sharpness);
      }
    }
    return sum * (1 / (TexelScale<Texel>() * static_cast<float>(footprint.samples_minor * footprint.samples_major)));
  }

  // Weights of the corners at `p`, or at a point of the triangle near it.
  static std::array<double, 3> CornerWeights(const Footprint& footprint, const Vec2& p) {
    std::array<double, 3> weights = footprint.WeightsAt(p);
    double total = 0;
    for (double& w : weights) total += w = std::clamp(w, 0.0, 1.0);
    for (double& w : weights) w /= total;
    return weights;
  }

  // `value` times the factor and the colours of the corners, plus the offset.
  Rgba Scaled(const Footprint& footprint, std::size_t t, const Vec2& p, Rgba value) const {
    Rgba factor = {options_.factor[0], options_.factor[1], options_.factor[2], options_.factor[3]};
    if (!colors_.empty()) {
      const std::array<double, 3> weights = CornerWeights(footprint, p);
      Rgba color = {};
      for (std::size_t k = 0; k < 3; ++k) {
        const CornerColor& corner = colors_[3 * t + k];
        color += static_cast<float>(weights[k]) * Rgba{corner[0], corner[1], corner[2], corner[3]};
      }
      factor *= color;
    }
    // Premultiplied colours change with the factor of alpha too.
    if (options_.premultiplied) factor *= Rgba{factor[3], factor[3], factor[3], 1};
    return factor * value + Rgba{options_.offset[0], options_.offset[1], options_.offset[2], options_.offset[3]};
  }

  // Converts a normal or a direction from the old tangent frame to the new one.
  Rgba InNewFrame(const Footprint& footprint, std::size_t t, const Vec2& p, Rgba value) const {
    const std::array<double, 3> weights = CornerWeights(footprint, p);
    Vec3 normal = Vec3::Zero(), from = Vec3::Zero(), to = Vec3::Zero();
    double from_sign = 1, to_sign = 1;
    for (std::size_t k = 0; k < 3; ++k) {
      const CornerFrames& corner = frames_[3 * t + k];
      const double w = weights[k];
      for (int axis = 0; axis < 3; ++axis) {
        const auto a = static_cast<std::size_t>(axis);
        normal[axis] += w * corner.normal[a];
        from[axis] += w * corner.from_tangent[a];
        to[axis] += w * corner.to_tangent[a];
      }
      from_sign = corner.from_tangent[3] < 0 ? -1 : 1;
      to_sign = corner.to_tangent[3] < 0 ? -1 : 1;
    }
    const bool is_normal = options_.meaning == TextureMeaning::kNormal;
    const double scale = is_normal ? options_.normal_scale : 1;
    const double x = (2.0 * value[0] - 1) * scale, y = (2.0 * value[1] - 1) * scale,
                 z = is_normal ? 2.0 * value[2] - 1 : 0;
    const Vec3 direction = x * from + y * from_sign * normal.cross(from) + z * normal;
    const Vec3 bitangent = to_sign * normal.cross(to);
    Vec3 c(direction.dot(bitangent.cross(normal)), direction.dot(normal.cross(to)), direction.dot(to.cross(bitangent)));
    c /= to.dot(bitangent.cross(normal));
    if (!c.allFinite()) c = Vec3(x, y, z);
    if (!is_normal) {
      const double length = std::hypot(c.x(), c.y());
      if (length > 0)
        value = Rgba{static_cast<float>(0.5 + 0.5 * c.x() / length), static_cast<float>(0.5 + 0.5 * c.y() / length),
                     value[2], value[3]};
      return value;
    }
    if (scale != 0 && options_.keeps_normal_scale) c = Vec3(c.x() / scale, c.y() / scale, c.z());
    const double length = c.norm();
    c = length > 0 ? Vec3(c / length) : Vec3(0, 0, 1);
    return Rgba{static_cast<float>(0.5 + 0.5 * c.x()), static_cast<float>(0.5 + 0.5 * c.y()),
                static_cast<float>(0.5 + 0.5 * c.z()), value[3]};
  }

  // Clamps to [0, 1]; NaN becomes 0.
  static float Unit(float value) { return value > 0 ? std::min(value, 1.0F) : 0; }

  void Store(Rgba value, std::uint8_t* out) const {
    const float alpha = Unit(value[3]);
    if (options_.premultiplied && alpha > 0) value /= alpha;
    const bool srgb = options_.meaning == TextureMeaning::kColor;
    for (int c = 0; c < target_.channels; ++c) {
      const bool is_alpha = target_.has_alpha() && c == target_.channels - 1;
      const float x = is_alpha ? alpha : Unit(value[c]);
      if (target_.bits == 8) {
        out[c] = srgb && !is_alpha ? texture_internal::Srgb8OfLinear16()[static_cast<int>(x * 65535 + 0.5F)]
                                   : static_cast<std::uint8_t>(x * 255 + 0.5F);
      } else {
        const double y = srgb && !is_alpha ? SrgbOfLinear(x) : x;
        const auto wide = static_cast<std::uint16_t>(y * 65535 + 0.5);
        std::memcpy(out + 2 * c, &wide, sizeof wide);
      }
    }
  }

  const TextureSource& source_;
  std::span<const TextureTriangle> triangles_;
  std::span<const CornerFrames> frames_;
  std::span<const CornerColor> colors_;
  std::size_t first_;  // index of the first of triangles_ in the list given to Claim()
  const BakeOptions& options_;
  const ImageHeader& target_;
  WholeEdges whole_;
  TextureLevels<Texel> levels_;
  int deepest_ = 0;
};

}  // namespace

TextureBaker::TextureBaker(const ImageHeader& header, ThreadTeam* team) : team_(team) {
  image_.header = header;
}

void TextureBaker::MakeImage() {
  drawn_.resize(static_cast<std::size_t>(image_.header.texels()), 0);
  image_.texels.resize(static_cast<std::size_t>(image_.header.bytes()), 0);
}

void TextureBaker::Claim(std::span<const TextureTriangle> all) {
  const ImageHeader& target = image_.header;
  owner_.resize(static_cast<std::size_t>(target.texels()));
  const std::vector<std::vector<std::int32_t>> of_band = texture_internal::TrianglesOfBands(all, target);
  team_->ForEach(
      std::ssize(of_band),
      [&](std::int64_t band) {
        const int first = static_cast<int>(band) * kBandRows, end = std::min(target.height, first + kBandRows);
        const auto width = static_cast<std::size_t>(target.width);
        BandTexels texels(width * static_cast<std::size_t>(end - first));
        for (const std::int32_t t : of_band[static_cast<std::size_t>(band)]) {
          RasterTriangle triangle;
          if (!SetTarget(all[static_cast<std::size_t>(t)], target, &triangle)) continue;
          texture_internal::Claim(triangle, t, first, end, &texels);
        }
        std::copy(texels.owner.begin(), texels.owner.end(),
                  owner_.begin() + static_cast<std::ptrdiff_t>(width * static_cast<std::size_t>(first)));
      },
      1);
}

template <typename Texel>
absl::Status TextureBaker::DrawFrom(const TextureSource& source, const TextureGeometry& geometry,
                                    const BakeOptions& options, const std::atomic<bool>* stop) {
  const ImageHeader& target = image_.header;
  const TextureDrawing<Texel> drawing(source, geometry, options, target, team_);
  if (source.spent != nullptr) source.spent->texels = std::vector<std::uint8_t>();
  MakeImage();
  const std::vector<std::vector<std::int32_t>> of_band = texture_internal::TrianglesOfBands(geometry.triangles, target);
  const auto bands = std::ssize(of_band);
  const auto is_stopped = [stop] { return stop != nullptr && stop->load(std::memory_order_relaxed); };
  team_->ForEach(
      bands,
      [&](std::int64_t band) {
        if (is_stopped()) return;
        const int first = static_cast<int>(band) * kBandRows;
        drawing.DrawBand(of_band[static_cast<std::size_t>(band)], owner_, first,
                         std::min(target.height, first + kBandRows), &image_, &drawn_);
      },
      1);
  if (is_stopped()) return MakeError(absl::StatusCode::kCancelled, "CANCELLED", "interrupted");
  return absl::OkStatus();
}

absl::Status TextureBaker::Draw(const TextureSource& source, const TextureGeometry& geometry,
                                const BakeOptions& options, const std::atomic<bool>* stop) {
  if (source.image->header.bits == 8) return DrawFrom<std::uint16_t>(source, geometry, options, stop);
  return DrawFrom<float>(source, geometry, options, stop);
}

std::int64_t TextureBaker::SourceBytes(const ImageHeader& header) {
  return header.texels() * header.bits * 4 / 3;
}

double TextureSideOf(std::span<const TextureTriangle> triangles, std::span<const double> areas, int old_width,
                     int old_height) {
  std::vector<std::pair<double, double>> sides;  // per triangle: the side that it needs, and its area on the surface
  double total = 0;
  for (std::size_t t = 0; t < triangles.size(); ++t) {
    const TextureTriangle& triangle = triangles[t];
    const double before = std::abs(Cross(triangle.from[1] - triangle.from[0], triangle.from[2] - triangle.from[0])) *
                          old_width * old_height;
    const double after = std::abs(Cross(triangle.to[1] - triangle.to[0], triangle.to[2] - triangle.to[0]));
    const double side = std::sqrt(before / after);
    if (!(side > 0) || !std::isfinite(side) || !(areas[t] > 0) || !std::isfinite(areas[t])) continue;
    sides.emplace_back(side, areas[t]);
    total += areas[t];
  }
  std::sort(sides.begin(), sides.end());
  double below = 0;
  for (const auto& [side, area] : sides) {
    below += area;
    if (below >= 0.9 * total) return side;
  }
  return 0;
}

}  // namespace planish
