#include "core/mesh/visibility.h"

#include <algorithm>
#include <array>
#include <bit>
#include <cmath>
#include <cstddef>
#include <cstdint>
#include <limits>
#include <numbers>
#include <optional>
#include <utility>
#include <vector>

#include "core/base/portable_math.h"
#include "core/base/radix_sort.h"
#include "core/mesh/spatial_order.h"

namespace planish {
namespace {

using Point = std::array<float, 3>;

constexpr std::size_t kRays = 16;                         // from each sampled face
constexpr double kFirstRays = 6000, kRaysPerFace = 0.22;  // upper bound of the total
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

Point operator-(const Point& a, const Point& b) {
  return {a[0] - b[0], a[1] - b[1], a[2] - b[2]};
}
float Dot(const Point& a, const Point& b) {
  return a[0] * b[0] + a[1] * b[1] + a[2] * b[2];
}
Point Cross(const Point& a, const Point& b) {
  return {a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0]};
}

// Compile to one instruction each.
float Less(float a, float b) {
  return a < b ? a : b;
}
float Greater(float a, float b) {
  return a > b ? a : b;
}

// Returns false if the vector has no direction.
bool Normalize(Point* p) {
  const float length = std::sqrt(Dot(*p, *p));
  for (float& coordinate : *p) coordinate /= length;
  return length > 0;
}

struct SolidBox {
  Point low = {kFar, kFar, kFar}, high = {-kFar, -kFar, -kFar};

  void Add(const Point& p) {
    for (int k = 0; k < 3; ++k) {
      low[k] = std::min(low[k], p[k]);
      high[k] = std::max(high[k], p[k]);
    }
  }
  // Whether a ray intersects the box, or nearly. `inverse`: 1 / direction, by component.
  bool IsMet(const Point& origin, const Point& inverse) const {
    const float ax = (low[0] - origin[0]) * inverse[0], bx = (high[0] - origin[0]) * inverse[0];
    const float ay = (low[1] - origin[1]) * inverse[1], by = (high[1] - origin[1]) * inverse[1];
    const float az = (low[2] - origin[2]) * inverse[2], bz = (high[2] - origin[2]) * inverse[2];
    const float enter = Greater(Greater(Less(ax, bx), Less(ay, by)), Less(az, bz));
    const float leave = Less(Less(Greater(ax, bx), Greater(ay, by)), Greater(az, bz));
    return leave >= 0 && enter <= leave;
  }

  static constexpr float kFar = std::numeric_limits<float>::max();
};

// A bounding-volume tree over triangles in space.
class Solid {
 public:
  Solid(std::vector<std::array<Point, 3>> triangles, const Execution& execution) : triangles_(std::move(triangles)) {
    leaves_ = std::bit_ceil(triangles_.size() / kLeafSize + 1) / 2;
    leaves_ = std::max<std::size_t>(leaves_, 1);
    nodes_.resize(2 * leaves_ - 1);
    execution.ForEach(static_cast<std::int64_t>(leaves_), [&](std::int64_t leaf) {
      SolidBox& box = nodes_[leaves_ - 1 + leaf];
      for (std::size_t i = Begin(leaf); i < Begin(leaf + 1); ++i) {
        for (const Point& p : triangles_[i]) box.Add(p);
      }
    });
    for (std::size_t i = leaves_ - 1; i-- > 0;) {
      for (const SolidBox& child : {nodes_[2 * i + 1], nodes_[2 * i + 2]}) {
        nodes_[i].Add(child.low);
        nodes_[i].Add(child.high);
      }
    }
  }

  bool IsMet(const Point& origin, const Point& direction) const {
    const Point inverse = {1 / direction[0], 1 / direction[1], 1 / direction[2]};
    std::array<std::size_t, 64> stack = {0};
    for (int top = 1; top > 0;) {
      const std::size_t node = stack[--top];
      if (node < leaves_ - 1) {
        for (const std::size_t child : {2 * node + 2, 2 * node + 1}) {
          stack[top] = child;
          top += nodes_[child].IsMet(origin, inverse) ? 1 : 0;
        }
        continue;
      }
      const std::size_t leaf = node - (leaves_ - 1), end = Begin(leaf + 1);
      for (std::size_t i = Begin(leaf); i < end; ++i) {
        if (Meets(triangles_[i], origin, direction)) return true;
      }
    }
    return false;
  }

 private:
  static constexpr std::size_t kLeafSize = 3;  // a leaf has this many triangles or up to twice as many

  // The first triangle of a leaf.
  std::size_t Begin(std::size_t leaf) const { return leaf * triangles_.size() / leaves_; }

  // Moeller and Trumbore 1997.
  static bool Meets(const std::array<Point, 3>& triangle, const Point& origin, const Point& direction) {
    const Point one = triangle[1] - triangle[0], two = triangle[2] - triangle[0];
    const Point p = Cross(direction, two);
    const float inverse = 1 / Dot(one, p);
    const Point s = origin - triangle[0];
    const float u = Dot(s, p) * inverse;
    if (!(u >= 0 && u <= 1)) return false;
    const Point q = Cross(s, one);
    const float v = Dot(direction, q) * inverse;
    return v >= 0 && u + v <= 1 && Dot(two, q) * inverse > 0;
  }

  // As in BoxTree (box_tree.h): node i has the children 2 i + 1 and 2 i + 2, and the last `leaves_` nodes are leaves.
  // No leaf is empty.
  std::vector<std::array<Point, 3>> triangles_;
  std::vector<SolidBox> nodes_;
  std::size_t leaves_ = 1;
};

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

// The same from the middle of a triangle; 1 if it has no area.
float OpenShare(const Solid& solid, const std::array<Point, 3>& triangle, const std::array<Point, kRays>& directions) {
  Point normal = Cross(triangle[1] - triangle[0], triangle[2] - triangle[0]), middle;
  if (!Normalize(&normal)) return 1;
  for (int k = 0; k < 3; ++k) middle[k] = (triangle[0][k] + triangle[1][k] + triangle[2][k]) / 3;
  return OpenShare(solid, middle, normal, directions);
}

// The mesh, scaled to a diagonal of 1.
struct Scene {
  Vec3 low;
  double half;                      // of the diagonal
  std::vector<Point> points;        // per vertex
  std::vector<std::int32_t> faces;  // those with three different vertices, in spatial order
  std::optional<Solid> solid;

  Point PointAt(const Vec3& position) const {
    Point point;
    for (int k = 0; k < 3; ++k) point[k] = static_cast<float>((position[k] / 2 - low[k] / 2) / half);
    return point;
  }
  // The maximal number of places to sample.
  std::size_t MostPlaces() const {
    return static_cast<std::size_t>((kFirstRays + kRaysPerFace * static_cast<double>(faces.size())) /
                                    static_cast<double>(kRays));
  }
};

// Nothing if there is no face to sample, a position is not finite, or after a cancellation.
std::optional<Scene> MakeScene(const Mesh& mesh, const Execution& execution) {
  std::vector<std::int32_t> vertices;
  std::vector<char> has_face(mesh.positions.size(), 0);
  Vec3 low = Vec3::Constant(std::numeric_limits<double>::infinity()), high = -low;
  for (const Face& face : mesh.faces) {
    if (!mesh.IsInRange(face)) continue;
    for (const std::int32_t v : face) {
      if (!mesh.positions[v].allFinite()) return std::nullopt;
      if (std::exchange(has_face[v], 1)) continue;
      vertices.push_back(v);
      low = low.cwiseMin(mesh.positions[v]);
      high = high.cwiseMax(mesh.positions[v]);
    }
  }
  const double half = (high / 2 - low / 2).norm();
  if (vertices.empty() || !(half > 0) || !std::isfinite(half)) return std::nullopt;
  Scene scene = {low, half, std::vector<Point>(mesh.positions.size()), {}, std::nullopt};
  execution.ForEach(std::ssize(vertices),
                    [&](std::int64_t i) { scene.points[vertices[i]] = scene.PointAt(mesh.positions[vertices[i]]); });
  vertices = InSpatialOrder(mesh.positions, vertices, execution);
  if (execution.IsCancelled()) return std::nullopt;
  std::vector<std::int32_t> rank(scene.points.size(), -1);
  for (std::size_t i = 0; i < vertices.size(); ++i) rank[vertices[i]] = static_cast<std::int32_t>(i);
  std::vector<std::array<Point, 3>> triangles;
  for (const std::int32_t f : FacesByFirstVertex(mesh.faces, rank)) {
    if (!mesh.IsInRange(mesh.faces[f])) continue;
    scene.faces.push_back(f);
    triangles.push_back(TriangleOf(scene.points, mesh.faces[f]));
  }
  scene.solid.emplace(std::move(triangles), execution);
  return scene;
}

constexpr std::int64_t kSamples = 64;  // of a chunk

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
  const std::optional<Scene> scene = MakeScene(mesh, execution);
  if (!scene) return visibility;
  const std::vector<std::int32_t>& faces = scene->faces;
  const std::size_t most = scene->MostPlaces(), stride = (faces.size() + most - 1) / most;
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
  // Faces that share no vertices with sampled ones take the value of a face near in space.
  for (std::size_t i = 0; i < faces.size(); ++i) visibility[faces[i]] = visibility[faces[i - i % stride]];
  Spread(mesh, std::move(sampled), &visibility);
  return visibility;
}

std::vector<float> VisibilityFrom(const Mesh& mesh, const std::vector<Vec3>& places, const std::vector<Vec3>& normals,
                                  const Execution& execution) {
  std::vector<float> visibility(places.size(), 1.0F);
  if (places.empty()) return visibility;
  const std::optional<Scene> scene = MakeScene(mesh, execution);
  if (!scene) return visibility;
  const std::size_t most = scene->MostPlaces(), stride = (places.size() + most - 1) / most;
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
