// Finds which texels of a new image belong to which triangle. Used inside client/texture only.
#pragma once

#include <algorithm>
#include <array>
#include <cmath>
#include <cstddef>
#include <cstdint>
#include <limits>
#include <span>
#include <vector>

#include "client/texture/image.h"
#include "client/texture/texture_baker.h"

namespace planish::texture_internal {

constexpr int kBandRows = 32;  // rows that a thread draws at a time
// Texels up to this distance from a triangle are drawn with it, since bilinear filters read that far.
constexpr double kRing = 1.5;

inline double Cross(const Vec2& a, const Vec2& b) {
  return a.x() * b.y() - a.y() * b.x();
}

// The half-plane of points p with normal . p <= offset; the normal has length 1.
struct HalfPlane {
  Vec2 normal = Vec2(0, 0);
  double offset = std::numeric_limits<double>::infinity();
};

// A triangle in texels of the new image.
struct RasterTriangle {
  std::array<Vec2, 3> to;
  std::array<HalfPlane, 3> edge;  // inside the edge of `to` opposite corner k
  double area = 0;                // twice the area, positive
  bool flipped = false;

  std::array<double, 3> WeightsAt(const Vec2& p) const {
    const double sign = flipped ? -1 : 1;
    const double w0 = sign * Cross(to[1] - p, to[2] - p) / area, w1 = sign * Cross(to[2] - p, to[0] - p) / area;
    return {w0, w1, 1 - w0 - w1};
  }
};

// Sets *footprint. False if the triangle has no area in the new map, or lies too far from the image.
inline bool SetTarget(const TextureTriangle& triangle, const ImageHeader& header, RasterTriangle* footprint) {
  for (std::size_t k = 0; k < 3; ++k) {
    footprint->to[k] = Vec2(triangle.to[k].x() * header.width, triangle.to[k].y() * header.height);
    if (!(footprint->to[k].cwiseAbs().maxCoeff() < 1e7)) return false;
  }
  const double area = Cross(footprint->to[1] - footprint->to[0], footprint->to[2] - footprint->to[0]);
  footprint->flipped = area < 0;
  footprint->area = std::abs(area);
  if (!(footprint->area > 0)) return false;
  for (std::size_t k = 0; k < 3; ++k) {
    const Vec2& a = footprint->to[(k + 1) % 3];
    const Vec2 d = footprint->to[(k + 2) % 3] - a;
    Vec2 normal = footprint->flipped ? Vec2(-d.y(), d.x()) : Vec2(d.y(), -d.x());
    const double length = normal.norm();
    if (!(length > 0)) return false;
    normal /= length;
    footprint->edge[k] = {normal, normal.dot(a)};
  }
  return true;
}

struct BandTexels {
  explicit BandTexels(std::size_t count) : owner(count, -1), distance(count, static_cast<float>(kRing * kRing)) {}

  std::vector<std::int32_t> owner;  // the number given to Claim(); -1: none
  std::vector<float> distance;      // squared distance to the owner
};

// The point of the triangle's border that is nearest to `p`.
inline Vec2 NearestOnBorder(const RasterTriangle& footprint, const Vec2& p) {
  Vec2 nearest = footprint.to[0];
  for (std::size_t k = 0; k < 3; ++k) {
    const Vec2& a = footprint.to[k];
    const Vec2 d = footprint.to[(k + 1) % 3] - a;
    const double along = std::clamp((p - a).dot(d) / d.squaredNorm(), 0.0, 1.0);
    const Vec2 point = a + along * d;
    if ((point - p).squaredNorm() < (nearest - p).squaredNorm()) nearest = point;
  }
  return nearest;
}

// How far `p` is beyond the edges of the triangle; 0 inside.
inline double BeyondEdges(const RasterTriangle& footprint, const Vec2& p) {
  double outside = 0;
  for (const HalfPlane& edge : footprint.edge) outside = std::max(outside, edge.normal.dot(p) - edge.offset);
  return outside;
}

// Calls visit(i, p) for all texels in the triangle or up to kRing beside it, and for some others: p is the texel's
// middle, and i its number in a band with the rows [first_row, end_row), `width` texels wide.
template <typename Visit>
void ForEachTexelNear(const RasterTriangle& footprint, int first_row, int end_row, std::int64_t width,
                      const Visit& visit) {
  const auto [top, bottom] = std::minmax({footprint.to[0].y(), footprint.to[1].y(), footprint.to[2].y()});
  const auto [left, right] = std::minmax({footprint.to[0].x(), footprint.to[1].x(), footprint.to[2].x()});
  const auto first = std::max<std::int64_t>(first_row, static_cast<std::int64_t>(std::floor(top - kRing - 0.5)));
  const auto last = std::min<std::int64_t>(end_row - 1, static_cast<std::int64_t>(std::ceil(bottom + kRing - 0.5)));
  for (std::int64_t y = first; y <= last; ++y) {
    const double py = static_cast<double>(y) + 0.5;
    double low = left - kRing, high = right + kRing;
    for (const HalfPlane& edge : footprint.edge) {
      const double room = edge.offset + kRing - edge.normal.y() * py;
      if (std::abs(edge.normal.x()) < 1e-9) {
        if (room < -1e-6) high = low - 1;
      } else if (edge.normal.x() > 0) {
        high = std::min(high, room / edge.normal.x());
      } else {
        low = std::max(low, room / edge.normal.x());
      }
    }
    if (high < low) continue;
    const auto x0 = std::max<std::int64_t>(0, static_cast<std::int64_t>(std::floor(low - 0.5)));
    const auto x1 = std::min<std::int64_t>(width - 1, static_cast<std::int64_t>(std::ceil(high - 0.5)));
    for (std::int64_t x = x0; x <= x1; ++x) {
      visit(static_cast<std::size_t>((y - first_row) * width + x), Vec2(static_cast<double>(x) + 0.5, py));
    }
  }
}

// Makes triangle `id` the owner of the texels in it, and of texels up to kRing beside it that are nearer to it than to
// their present owner.
inline void Claim(const RasterTriangle& footprint, std::int32_t id, int first_row, int end_row, BandTexels* texels) {
  const auto width = static_cast<std::int64_t>(texels->owner.size()) / (end_row - first_row);
  ForEachTexelNear(footprint, first_row, end_row, width, [&](std::size_t i, const Vec2& p) {
    if (texels->distance[i] <= 0) return;
    const double outside = BeyondEdges(footprint, p);
    if (outside * outside >= texels->distance[i]) return;
    const auto distance = static_cast<float>(outside > 0 ? (NearestOnBorder(footprint, p) - p).squaredNorm() : 0.0);
    if (distance >= texels->distance[i]) return;
    texels->distance[i] = distance;
    texels->owner[i] = id;
  });
}

// Per band of kBandRows rows, the triangles that may own texels in it.
inline std::vector<std::vector<std::int32_t>> TrianglesOfBands(std::span<const TextureTriangle> triangles,
                                                               const ImageHeader& target) {
  const int bands = (target.height + kBandRows - 1) / kBandRows;
  std::vector<std::vector<std::int32_t>> of_band(static_cast<std::size_t>(bands));
  for (std::size_t t = 0; t < triangles.size(); ++t) {
    RasterTriangle triangle;
    if (!SetTarget(triangles[t], target, &triangle)) continue;
    const auto [top, bottom] = std::minmax({triangle.to[0].y(), triangle.to[1].y(), triangle.to[2].y()});
    const int first = std::max(0, static_cast<int>(std::floor((top - kRing - 1) / kBandRows)));
    const int last = std::min(bands - 1, static_cast<int>(std::floor((bottom + kRing + 1) / kBandRows)));
    for (int band = first; band <= last; ++band) {
      of_band[static_cast<std::size_t>(band)].push_back(static_cast<std::int32_t>(t));
    }
  }
  return of_band;
}

// Fills texels that were not drawn (0), so that no mipmap shows a background. Each takes the mean of the drawn texels
// in the smallest aligned square of 2^k texels around it that has any.
void FillUndrawn(const std::vector<std::uint8_t>& drawn, TextureImage* image);

}  // namespace planish::texture_internal
