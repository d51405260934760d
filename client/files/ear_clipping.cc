#include "client/files/ear_clipping.h"

#include <algorithm>
#include <cmath>
#include <numeric>

#include "Eigen/Geometry"

namespace planish {
namespace {

constexpr std::size_t kMostPolygonCorners = 10000;
// A corner turns if the sine of its angle is above this: positions are float, so that corners in line are so only
// nearly.
constexpr double kFlat = 1e-6;

double Cross(const Vec2& a, const Vec2& b) {
  return a.x() * b.y() - a.y() * b.x();
}

// Whether a, b, c turn left, by more than rounding.
bool TurnsLeft(const Vec2& a, const Vec2& b, const Vec2& c) {
  const Vec2 ab = b - a;
  const Vec2 bc = c - b;
  return Cross(ab, bc) > kFlat * ab.norm() * bc.norm();
}

bool IsInside(const Vec2& p, const Vec2& a, const Vec2& b, const Vec2& c) {
  return Cross(b - a, p - a) >= 0 && Cross(c - b, p - b) >= 0 && Cross(a - c, p - c) >= 0;
}

// The polygon in its own plane, counter-clockwise; empty if it has none.
std::vector<Vec2> Flattened(const std::vector<Vec3>& outline) {
  Vec3 normal = Vec3::Zero();
  Vec3 longest = Vec3::Zero();
  for (std::size_t i = 0; i < outline.size(); ++i) {
    const Vec3& next = outline[(i + 1) % outline.size()];
    normal += (outline[i] - outline[0]).cross(next - outline[0]);
    if ((next - outline[i]).squaredNorm() > longest.squaredNorm()) longest = next - outline[i];
  }
  const double length = normal.norm();
  if (!(length > 0) || length > 1e300) return {};
  const Vec3 z = normal / length;
  const Vec3 along = longest - z * longest.dot(z);
  if (!(along.norm() > 0)) return {};
  const Vec3 x = along.normalized();
  const Vec3 y = z.cross(x);
  std::vector<Vec2> points;
  for (const Vec3& p : outline) points.emplace_back((p - outline[0]).dot(x), (p - outline[0]).dot(y));
  return points;
}

bool IsFan(const std::vector<Vec2>& points) {
  for (std::size_t i = 1; i + 1 < points.size(); ++i) {
    const Vec2 a = points[i] - points[0];
    const Vec2 b = points[i + 1] - points[0];
    if (!(Cross(a, b) > kFlat * a.norm() * b.norm())) return false;
  }
  return true;
}

// Whether a triangle of the fan round corner 0 is so steep on the others that the polygon lies in no plane.
bool IsFolded(const std::vector<Vec3>& outline) {
  constexpr double kLeastCosine = 0.7;  // of the angle to the polygon's normal, or to the opposite of that
  std::vector<Vec3> normals;
  Vec3 sum = Vec3::Zero();
  for (std::size_t i = 1; i + 1 < outline.size(); ++i) {
    normals.push_back((outline[i] - outline[0]).cross(outline[i + 1] - outline[0]));
    sum += normals.back();
  }
  return std::any_of(normals.begin(), normals.end(),
                     [&](const Vec3& n) { return std::abs(n.dot(sum)) < kLeastCosine * n.norm() * sum.norm(); });
}

// Whether the triangles of the fan round corner 0 all have an area.
bool FanHasArea(const std::vector<Vec3>& outline) {
  for (std::size_t i = 1; i + 1 < outline.size(); ++i) {
    const Vec3 a = outline[i] - outline[0], b = outline[i + 1] - outline[0];
    // The triangle may be flat with its middle corner at any of its three vertices.
    const double longest = std::max({a.squaredNorm(), b.squaredNorm(), (a - b).squaredNorm()});
    if (!(a.cross(b).norm() > kFlat * longest)) return false;
  }
  return true;
}

// Whether corner `at` of the polygon that `left` still has can be cut off.
bool IsEar(const std::vector<Vec2>& points, const std::vector<std::int32_t>& left, std::size_t at) {
  const std::size_t n = left.size();
  const Vec2& a = points[left[(at + n - 1) % n]];
  const Vec2& b = points[left[at]];
  const Vec2& c = points[left[(at + 1) % n]];
  if (!TurnsLeft(a, b, c)) return false;
  for (std::size_t i = 2; i + 1 < n; ++i) {
    const Vec2& p = points[left[(at + i) % n]];
    // Polygons with holes touch themselves at the bridge.
    if (p == a || p == b || p == c) continue;
    if (IsInside(p, a, b, c)) return false;
  }
  return true;
}

}  // namespace

std::vector<Face> TrianglesOfPolygon(const std::vector<Vec3>& outline) {
  std::vector<Face> triangles;
  std::vector<std::int32_t> left(outline.size());
  std::iota(left.begin(), left.end(), 0);
  const bool is_fan = (outline.size() == 4 || IsFolded(outline)) && FanHasArea(outline);
  if (outline.size() > 3 && outline.size() <= kMostPolygonCorners && !is_fan) {
    const std::vector<Vec2> points = Flattened(outline);
    std::size_t at = 1;
    // Corners without an ear since the last one; to begin with all, where there is nothing to cut off.
    std::size_t tried = points.empty() || IsFan(points) ? left.size() : 0;
    while (left.size() > 3 && tried < left.size()) {
      at %= left.size();
      ++tried;
      if (IsEar(points, left, at)) {
        const std::size_t n = left.size();
        triangles.push_back({left[(at + n - 1) % n], left[at], left[(at + 1) % n]});
        left.erase(left.begin() + static_cast<std::ptrdiff_t>(at));
        tried = 0;
      } else {
        ++at;
      }
    }
  }
  for (std::size_t i = 1; i + 1 < left.size(); ++i) triangles.push_back({left[0], left[i], left[i + 1]});
  return triangles;
}

}  // namespace planish
