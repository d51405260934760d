#include "core/mesh/visibility.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <cstddef>
#include <cstdint>
#include <numbers>
#include <optional>
#include <utility>
#include <vector>

#include "core/base/portable_math.h"
#include "core/base/radix_sort.h"
#include "core/mesh/ray_scene.h"

namespace planish {
namespace {

using rays::Cross;
using rays::Normalize;
using rays::Point;
using rays::Solid;
using rays::operator-;

constexpr std::size_t kRays = 16;                         // from each sampled face
constexpr double kFirstRays = 6000, kRaysPerFace = 0.05;  // the first plus the second per face: the most rays in all
constexpr float kAbove = 1e-4F;  // distance of the rays' origins above the surface, in diagonals of the mesh

// Directions about the z axis, distributed by their cosine (Vogel's spiral).
std::array<Point, kRays> Directions() {
  const double golden = std::numbers::pi * (3 - std::sqrt(5.0));
  std::array<Point, kRays> directions;
  for (std::size_t i = 0; i < kRays; ++i) {
    const double square = (static_cast<double>(i) + 0.5) / kRays, radius = std::sqrt(square);
    const auto [sine, cosine] = portable::SinCos(golden * static_cast<double>(i));
    directions[i] = {static_cast<float>(radius * cosine), static_cast<float>(radius * sine),
                     static_cast<float>(std::sqrt(1 - square))};
  }
  return directions;
}

// The share of the rays from a place that hit nothing. `normal` has length 1.
float OpenShare(const Solid& solid, const Point& place, const Point& normal,
                const std::array<Point, kRays>& directions) {
  Point x = Cross(std::abs(normal[0]) < 0.7F ? Point{1, 0, 0} : Point{0, 1, 0}, normal);
  Normalize(&x);
  const Point y = Cross(normal, x);
  Point origin;
  for (int k = 0; k < 3; ++k) origin[k] = place[k] + kAbove * normal[k];
  int open = 0;
  for (const Point& d : directions) {
    Point direction;
    for (int k = 0; k < 3; ++k) direction[k] = d[0] * x[k] + d[1] * y[k] + d[2] * normal[k];
    open += solid.IsMet(origin, direction) ? 0 : 1;
  }
  return static_cast<float>(open) / static_cast<float>(kRays);
}

// The share of the rays from the middle of a triangle that hit nothing; 1 if the triangle has no area.
float OpenShare(const Solid& solid, const std::array<Point, 3>& triangle, const std::array<Point, kRays>& directions) {
  Point normal = Cross(triangle[1] - triangle[0], triangle[2] - triangle[0]), middle;
  if (!Normalize(&normal)) return 1;
  for (int k = 0; k < 3; ++k) middle[k] = (triangle[0][k] + triangle[1][k] + triangle[2][k]) / 3;
  return OpenShare(solid, middle, normal, directions);
}

// The number of faces that may be sampled.
std::size_t MostPlaces(const RayScene& scene) {
  return static_cast<std::size_t>((kFirstRays + kRaysPerFace * static_cast<double>(scene.faces.size())) /
                                  static_cast<double>(kRays));
}

constexpr std::int64_t kSamples = 64;  // sampled faces per chunk

// Spreads the values of the sampled faces to the others, over shared vertices.
void Spread(const Mesh& mesh, std::vector<std::int32_t> reached, std::vector<float>* value) {
  const std::vector<Face>& faces = mesh.faces;
  const Groups at = GroupByKey(static_cast<std::int32_t>(3 * faces.size()), mesh.num_vertices(),
                               [&](std::int32_t c) { return mesh.IsInRange(faces[c / 3]) ? faces[c / 3][c % 3] : -1; });
  std::vector<char> is_known(faces.size(), 0), is_spread(mesh.positions.size(), 0);
  for (const std::int32_t f : reached) is_known[f] = 1;
  for (std::size_t i = 0; i < reached.size(); ++i) {
    for (const std::int32_t v : faces[reached[i]]) {
      if (std::exchange(is_spread[v], 1)) continue;
      for (const std::int32_t c : at[v]) {
        if (std::exchange(is_known[c / 3], 1)) continue;
        (*value)[c / 3] = (*value)[reached[i]];
        reached.push_back(c / 3);
      }
    }
  }
  std::vector<float> mean(mesh.positions.size());
  for (std::int32_t v = 0; v < std::ssize(mean); ++v) {
    for (const std::int32_t c : at[v]) mean[v] += (*value)[c / 3];
    mean[v] /= static_cast<float>(at[v].size());
  }
  for (const std::int32_t f : reached) {
    const auto& [a, b, c] = faces[f];
    (*value)[f] = ((*value)[f] + (mean[a] + mean[b] + mean[c]) / 3) / 2;
  }
}

}  // namespace

std::vector<float> FaceVisibility(const Mesh& mesh, const Execution& execution) {
  std::vector<float> visibility(mesh.faces.size(), 1.0F);
  const std::optional<RayScene> scene = MakeRayScene(mesh, execution);
  if (!scene) return visibility;
  const std::vector<std::int32_t>& faces = scene->faces;
  const std::size_t most = MostPlaces(*scene), stride = (faces.size() + most - 1) / most;
  std::vector<std::int32_t> sampled;
  for (std::size_t i = 0; i < faces.size(); i += stride) sampled.push_back(faces[i]);
  const std::array<Point, kRays> directions = Directions();
  execution.For(
      std::ssize(sampled),
      [&](std::int64_t begin, std::int64_t end) {
        for (std::int64_t i = begin; i < end; ++i) {
          visibility[sampled[i]] =
              OpenShare(*scene->solid, TriangleOf(scene->points, mesh.faces[sampled[i]]), directions);
        }
      },
      kSamples);
  // Gives each face the value of the sampled face before it in spatial order. Spread() replaces it wherever shared
  // vertices lead from a sampled face to this face, directly or through other faces.
  for (std::size_t i = 0; i < faces.size(); ++i) visibility[faces[i]] = visibility[faces[i - i % stride]];
  Spread(mesh, std::move(sampled), &visibility);
  return visibility;
}

std::vector<float> VisibilityFrom(const Mesh& mesh, const std::vector<Vec3>& places, const std::vector<Vec3>& normals,
                                  const Execution& execution) {
  std::vector<float> visibility(places.size(), 1.0F);
  if (places.empty()) return visibility;
  const std::optional<RayScene> scene = MakeRayScene(mesh, execution);
  if (!scene) return visibility;
  const std::size_t most = MostPlaces(*scene), stride = (places.size() + most - 1) / most;
  const std::array<Point, kRays> directions = Directions();
  execution.For(
      static_cast<std::int64_t>((places.size() + stride - 1) / stride),
      [&](std::int64_t begin, std::int64_t end) {
        for (std::int64_t i = begin; i < end; ++i) {
          const std::size_t at = static_cast<std::size_t>(i) * stride;
          Point normal = {static_cast<float>(normals[at].x()), static_cast<float>(normals[at].y()),
                          static_cast<float>(normals[at].z())};
          visibility[at] =
              Normalize(&normal) ? OpenShare(*scene->solid, scene->PointAt(places[at]), normal, directions) : 0;
        }
      },
      kSamples);
  for (std::size_t i = 0; i < places.size(); ++i) visibility[i] = visibility[i - i % stride];
  return visibility;
}

}  // namespace planish
