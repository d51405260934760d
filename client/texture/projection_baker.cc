#include "client/texture/projection_baker.h"

#include <cmath>
#include <memory>

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
    for (const TextureSource& image : source.images) {
      levels_.push_back(std::make_unique<texture_internal::TextureLevels<float>>(image, /*srgb=*/true,
                                                                                 /*premultiplied=*/false, team));
    }
  }

  // The sums of the colours and normals that the rays of a texel hit.
  struct Seen {
    Vec3 color = Vec3::Zero(), normal = Vec3::Zero();
    int hits = 0;
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
      seen.normal += InFrame(direction.normalized(), normal, tangent, target_.tangents[t][0][3] < 0 ? -1 : 1);
      seen.color += ColorAt(f, hit.weights);
      ++seen.hits;
    }
    return seen;
  }

 private:
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
    if (source_.images.empty() || source_.face_image[f] < 0) return color;
    Vec2 uv = Vec2::Zero();
    for (std::size_t c = 0; c < 3; ++c) uv += w[c] * source_.uv[f][c];
    if (!(uv.cwiseAbs().maxCoeff() < 1e6)) uv.setZero();
    const auto& levels = *levels_[static_cast<std::size_t>(source_.face_image[f])];
    const auto& base = levels.level(0);
    const texture_internal::Rgba shown = levels.At(base, uv.x() * base.width, uv.y() * base.height, 0);
    return Vec3(color.x() * shown[0], color.y() * shown[1], color.z() * shown[2]);
  }

  const ProjectionSource& source_;
  const ProjectionTarget& target_;
  const ProjectionOptions& options_;
  const RayScene& scene_;
  std::vector<std::unique_ptr<texture_internal::TextureLevels<float>>> levels_;
};

std::uint8_t Byte(double value) {
  return static_cast<std::uint8_t>(std::lround(255 * std::clamp(value, 0.0, 1.0)));
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
        texture_internal::BandTexels texels = {
            std::vector<std::int32_t>(count, -1),
            std::vector<float>(count, static_cast<float>(texture_internal::kRing * texture_internal::kRing))};
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
          const double length = seen.normal.norm();
          const Vec3 normal = length > 0 ? Vec3(seen.normal / length) : Vec3(0, 0, 1);
          for (int c = 0; c < 3; ++c) {
            const std::size_t channel = 3 * at + static_cast<std::size_t>(c);
            result.normal.texels[channel] = Byte(0.5 + 0.5 * normal[c]);
            if (source.has_colors()) {
              result.color.texels[channel] =
                  Byte(SrgbOfLinear(std::clamp(seen.color[c] / seen.hits, 0.0, 1.0)));
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
  return result;
}

}  // namespace planish
