#include "client/texture/projection_baker.h"

#include <algorithm>
#include <cmath>
#include <cstring>
#include <memory>
#include <optional>

#include "Eigen/Geometry"
#include "client/texture/texture_levels.h"
#include "client/texture/texture_raster.h"
#include "core/base/error.h"
#include "core/mesh/ray_scene.h"

namespace planish {
namespace {

using texture_internal::RasterTriangle;

constexpr int kPointsASide = 2;  // of a texel, from each of which rays are cast

class ProjectionDrawing {
 public:
  ProjectionDrawing(const ProjectionSource& source, const ProjectionTarget& target, const ProjectionOptions& options,
                    const RayScene& scene, ThreadTeam* team)
      : source_(source), target_(target), options_(options), scene_(scene) {
    for (const TextureSource& image : source.color_maps.images) {
      colors_.push_back(std::make_unique<Levels>(image, /*srgb=*/true, /*premultiplied=*/false, team));
    }
    for (const TextureSource& image : source.normal_maps.images) {
      normals_.push_back(std::make_unique<Levels>(image, /*srgb=*/false, /*premultiplied=*/false, team));
    }
  }

  // The sums of the colours and normals that the rays of a texel hit.
  struct Seen {
    Vec3 color = Vec3::Zero(), normal = Vec3::Zero();
    double height = 0;
    int hits = 0;
    int sky_rays = 0, hidden = 0;
  };

  Seen At(std::size_t t, const RasterTriangle& raster, const Vec2& centre) const {
    Seen seen;
    for (int k = 0; k < kPointsASide * kPointsASide; ++k) {
      const Vec2 offset((k % kPointsASide + 0.5) / kPointsASide - 0.5, (k / kPointsASide + 0.5) / kPointsASide - 0.5);
      Vec2 p = centre + offset;
      std::array<double, 3> w = raster.WeightsAt(p);
      if (std::min({w[0], w[1], w[2]}) < 0) w = raster.WeightsAt(texture_internal::NearestOnBorder(raster, p));
      Vec3 place = Vec3::Zero(), normal = Vec3::Zero(), tangent = Vec3::Zero();
      for (std::size_t c = 0; c < 3; ++c) {
        place += w[c] * target_.positions[t][c];
        for (int axis = 0; axis < 3; ++axis) {
          const auto a = static_cast<std::size_t>(axis);
          normal[axis] += w[c] * static_cast<double>(target_.normals[t][c][a]);
          tangent[axis] += w[c] * static_cast<double>(target_.tangents[t][c][a]);
        }
      }
      const RayScene::Hit hit = scene_.Nearest(place, normal, options_.reach);
      if (hit.face < 0) continue;
      const auto f = static_cast<std::size_t>(hit.face);
      Vec3 direction = Vec3::Zero();
      for (std::size_t c = 0; c < 3; ++c) {
        const std::array<float, 3>& n = source_.normals[3 * f + c];
        direction += hit.weights[c] * Vec3(n[0], n[1], n[2]);
      }
      if (!(direction.norm() > 0)) continue;
      direction.normalize();
      seen.normal +=
          InFrame(Bumped(f, hit.weights, direction), normal, tangent, target_.tangents[t][0][3] < 0 ? -1 : 1);
      seen.color += ColorAt(f, hit.weights);
      seen.height += hit.distance;
      ++seen.hits;
      if (options_.occlusion) LookAtSky(f, hit.weights, k, TurnOf(centre), &seen);
    }
    return seen;
  }

 private:
  using Levels = texture_internal::TextureLevels<float>;

  // A fixed angle for a texel.
  static double TurnOf(const Vec2& centre) {
    const auto x = static_cast<std::uint32_t>(centre.x()), y = static_cast<std::uint32_t>(centre.y());
    std::uint32_t hash = x * 0x9E3779B1U ^ (y + 0x7F4A7C15U) * 0x85EBCA77U;
    hash = (hash ^ hash >> 15) * 0xC2B2AE3DU;
    return 2 * M_PI * ((hash ^ hash >> 13) * 0x1p-32);
  }

  // Casts the rays of point `k` of a texel from a place of the source.
  void LookAtSky(std::size_t f, const std::array<double, 3>& weights, int k, double turn, Seen* seen) const {
    // Away from the face by more than the rounding of the rays.
    constexpr double kLift = 1e-5;  // of the diagonal
    constexpr int kAll = kPointsASide * kPointsASide * kSkyRays;
    const Face& face = source_.mesh->faces[f];
    std::array<Vec3, 3> corners;
    Vec3 place = Vec3::Zero();
    for (std::size_t c = 0; c < 3; ++c) {
      corners[c] = source_.mesh->positions[static_cast<std::size_t>(face[c])];
      place += weights[c] * corners[c];
    }
    // Smooth normals lean away from walls.
    Vec3 normal = (corners[1] - corners[0]).cross(corners[2] - corners[0]);
    if (!(normal.norm() > 0)) return;
    normal.normalize();
    place += kLift * 2 * scene_.half * normal;
    const rays::Point origin = scene_.PointAt(place);
    const Vec3 side = normal.unitOrthogonal(), other = normal.cross(side);
    for (int i = k; i < kAll; i += kPointsASide * kPointsASide) {
      // Hammersley's points on the disc, raised to the hemisphere: their density there is that of the cosine.
      std::uint32_t bits = static_cast<std::uint32_t>(i);
      double inverse = 0;
      for (double digit = 0.5; bits != 0; bits >>= 1, digit /= 2) inverse += (bits & 1) != 0 ? digit : 0;
      const double square = (i + 0.5) / kAll, radius = std::sqrt(square), angle = 2 * M_PI * inverse + turn;
      const Vec3 ray =
          radius * std::cos(angle) * side + radius * std::sin(angle) * other + std::sqrt(1 - square) * normal;
      ++seen->sky_rays;
      seen->hidden += scene_.solid->IsMet(
          origin, {static_cast<float>(ray.x()), static_cast<float>(ray.y()), static_cast<float>(ray.z())},
          static_cast<float>(options_.occlusion_reach));
    }
  }

  // What a map shows on a face; false: it has none there.
  static bool MapAt(const FaceImages& maps, const std::vector<std::unique_ptr<Levels>>& levels, std::size_t f,
                    const std::array<double, 3>& w, texture_internal::Rgba* shown) {
    if (maps.images.empty() || maps.of_face[f] < 0) return false;
    Vec2 uv = Vec2::Zero();
    for (std::size_t c = 0; c < 3; ++c) uv += w[c] * maps.uv[f][c];
    if (!(uv.cwiseAbs().maxCoeff() < 1e6)) uv.setZero();
    const Levels& map = *levels[static_cast<std::size_t>(maps.of_face[f])];
    const auto& base = map.level(0);
    *shown = map.At(base, uv.x() * base.width, uv.y() * base.height, 0);
    return true;
  }

  // The source's normal as its normal map bends it.
  Vec3 Bumped(std::size_t f, const std::array<double, 3>& weights, const Vec3& normal) const {
    texture_internal::Rgba shown = {};
    if (!MapAt(source_.normal_maps, normals_, f, weights, &shown)) return normal;
    Vec3 tangent = Vec3::Zero();
    for (std::size_t c = 0; c < 3; ++c) {
      const std::array<float, 4>& each = source_.tangents[3 * f + c];
      tangent += weights[c] * Vec3(each[0], each[1], each[2]);
    }
    const double sign = source_.tangents[3 * f][3] < 0 ? -1 : 1;
    const double scale = source_.normal_scales[static_cast<std::size_t>(source_.normal_maps.of_face[f])];
    const Vec3 bent = scale * (2.0 * shown[0] - 1) * tangent +
                      scale * (2.0 * shown[1] - 1) * sign * normal.cross(tangent) + (2.0 * shown[2] - 1) * normal;
    return bent.allFinite() && bent.norm() > 0 ? Vec3(bent.normalized()) : normal;
  }

  // A direction in the frame that shaders make of normal and tangent: x tangent + y bitangent + z normal.
  static Vec3 InFrame(const Vec3& direction, const Vec3& normal, const Vec3& tangent, double sign) {
    const Vec3 bitangent = sign * normal.cross(tangent);
    Vec3 c(direction.dot(bitangent.cross(normal)), direction.dot(normal.cross(tangent)),
           direction.dot(tangent.cross(bitangent)));
    c /= tangent.dot(bitangent.cross(normal));
    return c.allFinite() && c.norm() > 0 ? Vec3(c.normalized()) : Vec3(0, 0, 1);
  }

  Vec3 ColorAt(std::size_t f, const std::array<double, 3>& w) const {
    Vec3 color = Vec3::Ones();
    if (!source_.colors.empty()) {
      color.setZero();
      for (std::size_t c = 0; c < 3; ++c) {
        const std::array<float, 3>& rgb = source_.colors[3 * f + c];
        color += w[c] * Vec3(rgb[0], rgb[1], rgb[2]);
      }
    }
    texture_internal::Rgba shown = {};
    if (!MapAt(source_.color_maps, colors_, f, w, &shown)) return color;
    return Vec3(color.x() * shown[0], color.y() * shown[1], color.z() * shown[2]);
  }

  const ProjectionSource& source_;
  const ProjectionTarget& target_;
  const ProjectionOptions& options_;
  const RayScene& scene_;
  std::vector<std::unique_ptr<Levels>> colors_, normals_;
};

std::uint8_t Byte(double value) {
  return static_cast<std::uint8_t>(std::lround(255 * std::clamp(value, 0.0, 1.0)));
}

// Distances as an image, between the least and the greatest.
void SetHeights(const std::vector<float>& heights, const std::vector<std::uint8_t>& drawn, const ImageHeader& header,
                Projection* result) {
  float low = HUGE_VALF, high = -HUGE_VALF;
  for (std::size_t i = 0; i < heights.size(); ++i) {
    if (drawn[i] == 0) continue;
    low = std::min(low, heights[i]);
    high = std::max(high, heights[i]);
  }
  if (!(low <= high)) low = high = 0;  // nothing was drawn
  result->low = low;
  result->high = high;
  result->height.header = header;
  result->height.header.channels = 1;
  result->height.header.bits = 16;
  std::vector<std::uint16_t> values(heights.size(), 0);
  const double scale = high > low ? 65535 / (static_cast<double>(high) - low) : 0;
  for (std::size_t i = 0; i < heights.size(); ++i) {
    if (drawn[i] != 0) values[i] = static_cast<std::uint16_t>((static_cast<double>(heights[i]) - low) * scale + 0.5);
  }
  result->height.texels.resize(values.size() * sizeof(std::uint16_t));
  std::memcpy(result->height.texels.data(), values.data(), result->height.texels.size());
  texture_internal::FillUndrawn(drawn, &result->height);
}

}  // namespace

absl::StatusOr<Projection> Project(const ProjectionSource& source, const ProjectionTarget& target,
                                   const ProjectionOptions& options, ThreadTeam* team) {
  Execution execution;
  execution.team = team;
  const std::optional<RayScene> scene = MakeRayScene(*source.mesh, execution);
  if (!scene) {
    return MakeError(absl::StatusCode::kInvalidArgument, "SURFACE_EMPTY",
                     "the surface to project has no extent, or positions that are not finite");
  }
  const ProjectionDrawing drawing(source, target, options, *scene, team);
  Projection result;
  const ImageHeader header = {ImageKind::kPng, options.size, options.size, 3, 8};
  const auto width = static_cast<std::size_t>(header.width);
  result.normal.header = result.color.header = header;
  result.normal.texels.resize(static_cast<std::size_t>(header.bytes()));
  if (source.has_colors()) result.color.texels.resize(static_cast<std::size_t>(header.bytes()));
  if (options.occlusion) {
    result.occlusion.header = header;
    result.occlusion.header.channels = 1;
    result.occlusion.texels.resize(static_cast<std::size_t>(header.texels()), 255);
  }
  std::vector<float> heights(options.height ? static_cast<std::size_t>(header.texels()) : 0, 0);
  std::vector<std::uint8_t> drawn(static_cast<std::size_t>(header.texels()), 0);
  std::vector<TextureTriangle> triangles(target.uv.size());
  for (std::size_t t = 0; t < triangles.size(); ++t) triangles[t].to = target.uv[t];
  const std::vector<std::vector<std::int32_t>> of_band = texture_internal::TrianglesOfBands(triangles, header);
  std::vector<std::array<std::int64_t, 2>> counts(of_band.size(), {0, 0});
  const auto is_stopped = [&] { return options.stop != nullptr && options.stop->load(std::memory_order_relaxed); };
  team->ForEach(
      std::ssize(of_band),
      [&](std::int64_t band) {
        const std::vector<std::int32_t>& list = of_band[static_cast<std::size_t>(band)];
        const int first = static_cast<int>(band) * texture_internal::kBandRows;
        const int end = std::min(header.height, first + texture_internal::kBandRows);
        const std::size_t count = width * static_cast<std::size_t>(end - first);
        texture_internal::BandTexels texels(count);
        std::vector<RasterTriangle> rasters(list.size());
        for (std::size_t i = 0; i < list.size(); ++i) {
          if (!SetTarget(triangles[static_cast<std::size_t>(list[i])], header, &rasters[i])) continue;
          Claim(rasters[i], static_cast<std::int32_t>(i), first, end, &texels);
        }
        for (std::size_t i = 0; i < count; ++i) {
          if (texels.owner[i] < 0 || is_stopped()) continue;
          const auto own = static_cast<std::size_t>(texels.owner[i]);
          const Vec2 p(static_cast<double>(i % width) + 0.5, first + static_cast<double>(i / width) + 0.5);
          const ProjectionDrawing::Seen seen = drawing.At(static_cast<std::size_t>(list[own]), rasters[own], p);
          const bool is_inside = texels.distance[i] <= 0;
          std::array<std::int64_t, 2>& counted = counts[static_cast<std::size_t>(band)];
          counted[0] += is_inside;
          counted[1] += is_inside && seen.hits == 0;
          if (seen.hits == 0) continue;
          const std::size_t at = width * static_cast<std::size_t>(first) + i;
          drawn[at] = 1;
          if (options.height) heights[at] = static_cast<float>(seen.height / seen.hits);
          if (options.occlusion && seen.sky_rays > 0) {
            result.occlusion.texels[at] = Byte(1 - static_cast<double>(seen.hidden) / seen.sky_rays);
          }
          const double length = seen.normal.norm();
          const Vec3 normal = length > 0 ? Vec3(seen.normal / length) : Vec3(0, 0, 1);
          for (int c = 0; c < 3; ++c) {
            const std::size_t channel = 3 * at + static_cast<std::size_t>(c);
            result.normal.texels[channel] = Byte(0.5 + 0.5 * normal[c]);
            if (source.has_colors()) {
              result.color.texels[channel] = Byte(SrgbOfLinear(std::clamp(seen.color[c] / seen.hits, 0.0, 1.0)));
            }
          }
        }
      },
      1);
  if (is_stopped()) return MakeError(absl::StatusCode::kCancelled, "CANCELLED", "interrupted");
  for (const auto& [inside, missed] : counts) {
    result.texels += inside;
    result.missed += missed;
  }
  texture_internal::FillUndrawn(drawn, &result.normal);
  if (source.has_colors()) texture_internal::FillUndrawn(drawn, &result.color);
  if (options.occlusion) texture_internal::FillUndrawn(drawn, &result.occlusion);
  if (options.height) SetHeights(heights, drawn, header, &result);
  return result;
}

}  // namespace planish
