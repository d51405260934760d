// Rays against the triangles of a mesh: a bounding-volume tree in space.
#pragma once

#include <algorithm>
#include <array>
#include <bit>
#include <cmath>
#include <cstddef>
#include <cstdint>
#include <limits>
#include <optional>
#include <utility>
#include <vector>

#include "core/base/execution.h"
#include "core/mesh/mesh.h"

namespace planish {
namespace rays {

using Point = std::array<float, 3>;

inline Point operator-(const Point& a, const Point& b) {
  return {a[0] - b[0], a[1] - b[1], a[2] - b[2]};
}
inline float Dot(const Point& a, const Point& b) {
  return a[0] * b[0] + a[1] * b[1] + a[2] * b[2];
}
inline Point Cross(const Point& a, const Point& b) {
  return {a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0]};
}

// Minimum and maximum, compiled to one instruction each.
inline float Less(float a, float b) {
  return a < b ? a : b;
}
inline float Greater(float a, float b) {
  return a > b ? a : b;
}

// Scales `p` to length 1. False, and `p` is then not finite, if its length is 0.
inline bool Normalize(Point* p) {
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
  // Whether a ray meets the box, up to rounding, within `most` times its direction. `inverse`: 1 / direction, by
  // coordinate.
  bool IsMet(const Point& origin, const Point& inverse, float most = kFar) const {
    const float ax = (low[0] - origin[0]) * inverse[0], bx = (high[0] - origin[0]) * inverse[0];
    const float ay = (low[1] - origin[1]) * inverse[1], by = (high[1] - origin[1]) * inverse[1];
    const float az = (low[2] - origin[2]) * inverse[2], bz = (high[2] - origin[2]) * inverse[2];
    const float enter = Greater(Greater(Less(ax, bx), Less(ay, by)), Less(az, bz));
    const float leave = Less(Less(Greater(ax, bx), Greater(ay, by)), Greater(az, bz));
    return leave >= 0 && enter <= leave && enter <= most;
  }

  float SquaredDistance(const Point& p) const {
    float sum = 0;
    for (int k = 0; k < 3; ++k) {
      const float away = Greater(Greater(low[k] - p[k], p[k] - high[k]), 0);
      sum += away * away;
    }
    return sum;
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

  // Whether the ray meets a triangle within `most` times `direction`.
  bool IsMet(const Point& origin, const Point& direction, float most = SolidBox::kFar) const {
    const Point inverse = {1 / direction[0], 1 / direction[1], 1 / direction[2]};
    std::array<std::size_t, 64> stack = {0};
    for (int top = 1; top > 0;) {
      const std::size_t node = stack[--top];
      if (node < leaves_ - 1) {
        for (const std::size_t child : {2 * node + 2, 2 * node + 1}) {
          stack[top] = child;
          top += nodes_[child].IsMet(origin, inverse, most) ? 1 : 0;
        }
        continue;
      }
      const std::size_t leaf = node - (leaves_ - 1), end = Begin(leaf + 1);
      for (std::size_t i = Begin(leaf); i < end; ++i) {
        float t = 0, u = 0, v = 0;
        if (Meets(triangles_[i], origin, direction, &t, &u, &v) && t <= most) return true;
      }
    }
    return false;
  }

  // Calls visit(i, t, u, v) for every triangle i that the ray meets at origin + t * direction, t in (0, most], which is
  // corner 0 + u * (corner 1 - corner 0) + v * (corner 2 - corner 0).
  template <typename Visit>
  void ForEachHit(const Point& origin, const Point& direction, float most, const Visit& visit) const {
    const Point inverse = {1 / direction[0], 1 / direction[1], 1 / direction[2]};
    std::array<std::size_t, 64> stack = {0};
    for (int top = 1; top > 0;) {
      const std::size_t node = stack[--top];
      if (node < leaves_ - 1) {
        for (const std::size_t child : {2 * node + 2, 2 * node + 1}) {
          stack[top] = child;
          top += nodes_[child].IsMet(origin, inverse, most) ? 1 : 0;
        }
        continue;
      }
      const std::size_t leaf = node - (leaves_ - 1), end = Begin(leaf + 1);
      for (std::size_t i = Begin(leaf); i < end; ++i) {
        float t = 0, u = 0, v = 0;
        if (Meets(triangles_[i], origin, direction, &t, &u, &v) && t <= most) visit(i, t, u, v);
      }
    }
  }

  // Calls visit(i, &reach) for every triangle i that may be within `reach` of a point. `visit` may make `reach`
  // smaller.
  template <typename Visit>
  void ForEachNear(const Point& point, float reach, const Visit& visit) const {
    std::array<std::pair<std::size_t, float>, 64> stack = {{{0, nodes_[0].SquaredDistance(point)}}};
    for (int top = 1; top > 0;) {
      const auto [node, squared] = stack[--top];
      if (squared > reach * reach) continue;
      if (node < leaves_ - 1) {
        const std::size_t one = 2 * node + 1, other = 2 * node + 2;
        const float to_one = nodes_[one].SquaredDistance(point), to_other = nodes_[other].SquaredDistance(point);
        const bool is_one_first = to_one <= to_other;
        stack[top++] = is_one_first ? std::pair(other, to_other) : std::pair(one, to_one);
        stack[top++] = is_one_first ? std::pair(one, to_one) : std::pair(other, to_other);
        continue;
      }
      const std::size_t leaf = node - (leaves_ - 1), end = Begin(leaf + 1);
      for (std::size_t i = Begin(leaf); i < end; ++i) visit(i, &reach);
    }
  }

  const std::array<Point, 3>& triangle(std::size_t i) const { return triangles_[i]; }

 private:
  static constexpr std::size_t kLeafSize = 3;  // a leaf holds between this and twice this number of triangles

  // The first triangle of a leaf.
  std::size_t Begin(std::size_t leaf) const { return leaf * triangles_.size() / leaves_; }

  // Whether a ray meets a triangle (Moeller and Trumbore 1997).
  static bool Meets(const std::array<Point, 3>& triangle, const Point& origin, const Point& direction, float* t_out,
                    float* u_out, float* v_out) {
    const Point one = triangle[1] - triangle[0], two = triangle[2] - triangle[0];
    const Point p = Cross(direction, two);
    const float inverse = 1 / Dot(one, p);
    const Point s = origin - triangle[0];
    const float u = Dot(s, p) * inverse;
    if (!(u >= 0 && u <= 1)) return false;
    const Point q = Cross(s, one);
    const float v = Dot(direction, q) * inverse;
    const float t = Dot(two, q) * inverse;
    *t_out = t;
    *u_out = u;
    *v_out = v;
    return v >= 0 && u + v <= 1 && t > 0;
  }

  // As in BoxTree (box_tree.h): node i has the children 2 i + 1 and 2 i + 2, and the last `leaves_` nodes are leaves.
  // No leaf is empty.
  std::vector<std::array<Point, 3>> triangles_;
  std::vector<SolidBox> nodes_;
  std::size_t leaves_ = 1;
};

}  // namespace rays

// A mesh for rays, its diagonal scaled to 1.
struct RayScene {
  Vec3 low;
  double half;                      // of the diagonal
  std::vector<rays::Point> points;  // per vertex
  std::vector<std::int32_t> faces;  // those whose vertices all exist, in spatial order
  std::optional<rays::Solid> solid;

  rays::Point PointAt(const Vec3& position) const {
    rays::Point point;
    for (int k = 0; k < 3; ++k) point[k] = static_cast<float>((position[k] / 2 - low[k] / 2) / half);
    return point;
  }

  // The nearest place of the surface on the line through `place` along `direction`, at most `reach` away, on a triangle
  // whose normal is less than a right angle from `direction`. Thread-safe.
  struct Hit {
    std::int32_t face = -1;                     // -1: none
    double distance = 0;                        // along `direction`
    std::array<double, 3> weights = {0, 0, 0};  // of the corners of `face`
  };
  Hit Nearest(const Vec3& place, const Vec3& direction, double reach) const;
};

// nullopt if the mesh has no extent, if the position of a face's vertex is not finite, or after a cancellation.
std::optional<RayScene> MakeRayScene(const Mesh& mesh, const Execution& execution = {});

}  // namespace planish
