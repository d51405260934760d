#include "client/files/ear_clipping.h"

#include <algorithm>
#include <cmath>
#include <numeric>

#include "Eigen/Eigenvalues"
#include "Eigen/Geometry"

namespace planish {
namespace {

constexpr std::size_t kMostPolygonCorners = 10000;
// A corner counts as a turn if the sine of its angle is above this. Positions are float, so collinear corners are only
// nearly collinear.
constexpr double kFlat = 1e-6;

double Cross(const Vec2& a, const Vec2& b) {
  return a.x() * b.y() - a.y() * b.x();
}

// Whether a, b, c turn left by more than rounding errors.
bool TurnsLeft(const Vec2& a, const Vec2& b, const Vec2& c) {
  const Vec2 ab = b - a;
  const Vec2 bc = c - b;
  return Cross(ab, bc) > kFlat * ab.norm() * bc.norm();
}

bool IsInside(const Vec2& p, const Vec2& a, const Vec2& b, const Vec2& c) {
  return Cross(b - a, p - a) >= 0 && Cross(c - b, p - b) >= 0 && Cross(a - c, p - c) >= 0;
}

// Newell's normal; its length is twice the polygon's area.
Vec3 NewellNormal(const std::vector<Vec3>& outline) {
  Vec3 normal = Vec3::Zero();
  for (std::size_t i = 0; i < outline.size(); ++i) {
    normal += (outline[i] - outline[0]).cross(outline[(i + 1) % outline.size()] - outline[0]);
  }
  return normal;
}

// The polygon projected onto the plane with this normal, seen from the tip of the normal. Empty if the normal is zero,
// longer than 1e300 or parallel to the longest side.
std::vector<Vec2> Projected(const std::vector<Vec3>& outline, const Vec3& normal) {
  Vec3 longest = Vec3::Zero();
  for (std::size_t i = 0; i < outline.size(); ++i) {
    const Vec3 side = outline[(i + 1) % outline.size()] - outline[i];
    if (side.squaredNorm() > longest.squaredNorm()) longest = side;
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

// The polygon in its own plane, counter-clockwise; empty if it has no plane.
std::vector<Vec2> Flattened(const std::vector<Vec3>& outline) {
  return Projected(outline, NewellNormal(outline));
}

bool IsFan(const std::vector<Vec2>& points) {
  for (std::size_t i = 1; i + 1 < points.size(); ++i) {
    const Vec2 a = points[i] - points[0];
    const Vec2 b = points[i + 1] - points[0];
    if (!(Cross(a, b) > kFlat * a.norm() * b.norm())) return false;
  }
  return true;
}

// Whether the fan round corner 0 has a triangle so steep that the polygon is not planar.
bool IsFolded(const std::vector<Vec3>& outline) {
  constexpr double kLeastCosine = 0.7;  // of the angle between the normals of a triangle and the polygon, up to sign
  std::vector<Vec3> normals;
  Vec3 sum = Vec3::Zero();
  for (std::size_t i = 1; i + 1 < outline.size(); ++i) {
    normals.push_back((outline[i] - outline[0]).cross(outline[i + 1] - outline[0]));
    sum += normals.back();
  }
  return std::any_of(normals.begin(), normals.end(),
                     [&](const Vec3& n) { return std::abs(n.dot(sum)) < kLeastCosine * n.norm() * sum.norm(); });
}

// Whether all triangles of the fan round corner 0 have area.
bool FanHasArea(const std::vector<Vec3>& outline) {
  for (std::size_t i = 1; i + 1 < outline.size(); ++i) {
    const Vec3 a = outline[i] - outline[0], b = outline[i + 1] - outline[0];
    // Compares with the longest side, since any vertex of a flat triangle may be the one between the other two.
    const double longest = std::max({a.squaredNorm(), b.squaredNorm(), (a - b).squaredNorm()});
    if (!(a.cross(b).norm() > kFlat * longest)) return false;
  }
  return true;
}

// Whether corner `at` of the remaining polygon can be cut off.
bool IsEar(const std::vector<Vec2>& points, const std::vector<std::int32_t>& left, std::size_t at) {
  const std::size_t n = left.size();
  const Vec2& a = points[left[(at + n - 1) % n]];
  const Vec2& b = points[left[at]];
  const Vec2& c = points[left[(at + 1) % n]];
  if (!TurnsLeft(a, b, c)) return false;
  for (std::size_t i = 2; i + 1 < n; ++i) {
    const Vec2& p = points[left[(at + i) % n]];
    // Such a point does not count: a polygon with a hole touches itself along the bridge to the hole.
    if (p == a || p == b || p == c) continue;
    if (IsInside(p, a, b, c)) return false;
  }
  return true;
}

// Cuts off ears while there are any. `left` becomes the remaining corners, in order: three for a simple polygon.
std::vector<Face> CutOffEars(const std::vector<Vec2>& points, std::vector<std::int32_t>* left) {
  std::vector<Face> triangles;
  std::size_t at = 1;
  std::size_t tried = 0;  // corners tried since the last ear
  while (left->size() > 3 && tried < left->size()) {
    at %= left->size();
    ++tried;
    if (IsEar(points, *left, at)) {
      const std::size_t n = left->size();
      triangles.push_back({(*left)[(at + n - 1) % n], (*left)[at], (*left)[(at + 1) % n]});
      left->erase(left->begin() + static_cast<std::ptrdiff_t>(at));
      tried = 0;
    } else {
      ++at;
    }
  }
  return triangles;
}

std::vector<std::int32_t> AllCorners(const std::vector<Vec3>& outline) {
  std::vector<std::int32_t> corners(outline.size());
  std::iota(corners.begin(), corners.end(), 0);
  return corners;
}

// Whether the segments from a to b and from c to d cross at an inner point of both.
bool SegmentsCross(const Vec2& a, const Vec2& b, const Vec2& c, const Vec2& d) {
  const auto sides_differ = [](const Vec2& p, const Vec2& q, const Vec2& r, const Vec2& s) {
    return Cross(q - p, r - p) * Cross(q - p, s - p) < 0;
  };
  return sides_differ(a, b, c, d) && sides_differ(c, d, a, b);
}

// Whether two sides of a nearly planar quad cross, so that its triangles overlap whichever diagonal cuts it. (The
// triangles of a bent quad may overlap too, which is not a fault.) Projects onto the least-squares plane and not along
// Newell's normal: the areas of a bow tie's triangles cancel out in that normal, so that it may have any direction.
bool IsBowTie(const std::vector<Vec3>& quad) {
  constexpr double kNearlyPlane = 0.1;  // greatest distance of a corner from the plane, divided by the longest side
  Vec3 center = Vec3::Zero();
  for (const Vec3& p : quad) center += p / 4;
  Eigen::Matrix3d covariance = Eigen::Matrix3d::Zero();
  double longest = 0;
  for (std::size_t i = 0; i < 4; ++i) {
    covariance += (quad[i] - center) * (quad[i] - center).transpose();
    longest = std::max(longest, (quad[(i + 1) % 4] - quad[i]).norm());
  }
  if (!(longest > 0) || !std::isfinite(covariance.sum())) return false;
  const Vec3 normal = Eigen::SelfAdjointEigenSolver<Eigen::Matrix3d>(covariance).eigenvectors().col(0);
  for (const Vec3& p : quad) {
    if (std::abs(normal.dot(p - center)) > kNearlyPlane * longest) return false;
  }
  const std::vector<Vec2> q = Projected(quad, normal);
  return !q.empty() && (SegmentsCross(q[0], q[1], q[2], q[3]) || SegmentsCross(q[1], q[2], q[3], q[0]));
}

}  // namespace

std::vector<Face> TrianglesOfPolygon(const std::vector<Vec3>& outline) {
  std::vector<Face> triangles;
  std::vector<std::int32_t> left = AllCorners(outline);
  const bool is_fan = (outline.size() == 4 || IsFolded(outline)) && FanHasArea(outline);
  if (outline.size() > 3 && outline.size() <= kMostPolygonCorners && !is_fan) {
    const std::vector<Vec2> points = Flattened(outline);
    if (!points.empty() && !IsFan(points)) triangles = CutOffEars(points, &left);
  }
  for (std::size_t i = 1; i + 1 < left.size(); ++i) triangles.push_back({left[0], left[i], left[i + 1]});
  return triangles;
}

bool CrossesItself(const std::vector<Vec3>& outline) {
  if (outline.size() < 4 || outline.size() > kMostPolygonCorners) return false;
  if (outline.size() == 4) return IsBowTie(outline);
  const std::vector<Vec2> points = Flattened(outline);
  // There is no normal: the areas of the triangles cancel out (the polygon crosses itself), or all are zero.
  if (points.empty()) return FanHasArea(outline);
  if (IsFan(points)) return false;
  if (IsFolded(outline) && FanHasArea(outline)) return false;  // not planar
  std::vector<std::int32_t> left = AllCorners(outline);
  CutOffEars(points, &left);
  if (left.size() == 3) return false;
  // The remaining polygon has no ear: it is collinear or crosses itself.
  bool turns = false;
  for (std::size_t i = 0; i < left.size(); ++i) {
    const Vec2 &a = points[left[i]], &b = points[left[(i + 1) % left.size()]], &c = points[left[(i + 2) % left.size()]];
    turns |= TurnsLeft(a, b, c) || TurnsLeft(c, b, a);
  }
  return turns;
}

}  // namespace planish
