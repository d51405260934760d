#include "core/mesh/symmetry.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <limits>
#include <unordered_map>
#include <utility>

#include "Eigen/Geometry"

namespace planish {
namespace {

constexpr double kTolerance = 1e-3;   // of the diagonal
constexpr double kLeastShare = 0.99;  // of the area

// The vertices of a mesh in a grid of cells.
class Cells {
 public:
  Cells(const Mesh& mesh, double reach) : mesh_(mesh), reach_(reach), next_(mesh.positions.size(), -1) {
    for (std::int32_t v = 0; v < std::ssize(next_); ++v) {
      const auto [it, is_new] = first_.try_emplace(KeyOf(CellOf(mesh.positions[v])), v);
      if (!is_new) next_[v] = std::exchange(it->second, v);
    }
  }

  // The vertex nearest to a point, the lowest of several; -1 if none is within reach.
  std::int32_t Nearest(const Vec3& p) const {
    std::int32_t nearest = -1;
    double least = reach_ * reach_;
    const std::array<std::int64_t, 3> low = CellOf(p - Vec3::Constant(reach_)),
                                      high = CellOf(p + Vec3::Constant(reach_));
    for (std::int64_t x = low[0]; x <= high[0]; ++x) {
      for (std::int64_t y = low[1]; y <= high[1]; ++y) {
        for (std::int64_t z = low[2]; z <= high[2]; ++z) {
          const auto it = first_.find(KeyOf({x, y, z}));
          for (std::int32_t v = it == first_.end() ? -1 : it->second; v >= 0; v = next_[v]) {
            const double distance = (mesh_.positions[v] - p).squaredNorm();
            if (distance > least || (distance == least && nearest >= 0 && v > nearest)) continue;
            least = distance;
            nearest = v;
          }
        }
      }
    }
    return nearest;
  }

 private:
  // Cells are wider than twice the reach, so that at most eight are searched.
  std::array<std::int64_t, 3> CellOf(const Vec3& p) const {
    const Vec3 cell = (p / (2.5 * reach_)).array().floor();
    return {static_cast<std::int64_t>(cell.x()), static_cast<std::int64_t>(cell.y()),
            static_cast<std::int64_t>(cell.z())};
  }
  static std::uint64_t KeyOf(const std::array<std::int64_t, 3>& cell) {
    std::uint64_t key = 0;
    for (const std::int64_t c : cell) key = (key << 21) ^ (key >> 43) ^ static_cast<std::uint64_t>(c & 0x1FFFFF);
    return key;
  }

  const Mesh& mesh_;
  double reach_;
  std::unordered_map<std::uint64_t, std::int32_t> first_;
  std::vector<std::int32_t> next_;
};

class Finder {
 public:
  Finder(const Mesh& mesh, const std::vector<std::int32_t>& polygon) : mesh_(mesh), polygon_(polygon) {}

  std::optional<Mirror> Find(const Execution& execution) {
    Vec3 low = Vec3::Constant(std::numeric_limits<double>::infinity()), high = -low, centre = Vec3::Zero();
    for (const Face& face : mesh_.faces) {
      for (const Vec3& p : TriangleOf(mesh_.positions, face)) {
        low = low.cwiseMin(p);
        high = high.cwiseMax(p);
      }
    }
    const double diagonal = (high - low).norm();
    const bool are_finite =
        std::all_of(mesh_.positions.begin(), mesh_.positions.end(), [](const Vec3& p) { return p.allFinite(); });
    // Cells are counted from the origin, so a mesh far from it has too many.
    constexpr double kFarthest = 1e3;
    if (!are_finite || !(diagonal > 0) || !std::isfinite(diagonal) ||
        std::max(low.cwiseAbs().maxCoeff(), high.cwiseAbs().maxCoeff()) > kFarthest * diagonal) {
      return std::nullopt;
    }
    for (const Face& face : mesh_.faces) {
      const auto [a, b, c] = TriangleOf(mesh_.positions, face);
      area_.push_back((b - a).cross(c - a).norm());
      total_ += area_.back();
      centre += area_.back() * (a + b + c) / 3;
    }
    if (!(total_ > 0) || !std::isfinite(total_)) return std::nullopt;
    centre /= total_;
    reach_ = kTolerance * diagonal;
    const Cells cells(mesh_, reach_);
    const Vec3 middle = (low + high) / 2;
    std::optional<Mirror> best;
    double most = 0;
    for (int axis = 0; axis < 3; ++axis) {
      for (const double place : {middle[axis], centre[axis]}) {
        if (execution.IsCancelled()) return std::nullopt;
        if (place == centre[axis] && std::abs(middle[axis] - place) < reach_ / 4 && place != middle[axis]) continue;
        if (!IsLikely(cells, axis, place)) continue;
        double share = 0;
        Mirror mirror = Across(cells, axis, place, &share);
        if (share < kLeastShare || share <= most) continue;
        most = share;
        best = std::move(mirror);
      }
    }
    return best;
  }

 private:
  static Vec3 Image(Vec3 p, int axis, double place) {
    p[axis] = 2 * place - p[axis];
    return p;
  }

  // A quick check of the plane on some of the vertices.
  bool IsLikely(const Cells& cells, int axis, double place) const {
    constexpr std::size_t kSome = 256;
    std::size_t hits = 0, count = 0;
    const std::size_t stride = std::max<std::size_t>(1, mesh_.positions.size() / kSome);
    for (std::size_t v = 0; v < mesh_.positions.size(); v += stride, ++count) {
      hits += cells.Nearest(Image(mesh_.positions[v], axis, place)) >= 0 ? 1 : 0;
    }
    return static_cast<double>(hits) >= kLeastShare * static_cast<double>(count);
  }

  Mirror Across(const Cells& cells, int axis, double place, double* share) const {
    const auto num_faces = static_cast<std::int32_t>(mesh_.faces.size());
    std::vector<std::int32_t> image(mesh_.positions.size(), -1);
    for (std::size_t v = 0; v < image.size(); ++v) image[v] = cells.Nearest(Image(mesh_.positions[v], axis, place));
    std::unordered_map<std::uint64_t, std::int32_t> by_edge;  // corners, by the directed edge that they face
    const auto key = [&](std::int32_t v, std::int32_t w) {
      return (static_cast<std::uint64_t>(v) << 32) | static_cast<std::uint32_t>(w);
    };
    for (std::int32_t c = 0; c < 3 * num_faces; ++c) {
      const Face& face = mesh_.faces[c / 3];
      by_edge.try_emplace(key(face[Next(c % 3)], face[Prev(c % 3)]), c);
    }
    Mirror mirror;
    mirror.corner.assign(3 * mesh_.faces.size(), -1);
    mirror.is_second.assign(mesh_.faces.size(), 0);
    for (std::int32_t c = 0; c < 3 * num_faces; ++c) {
      const Face& face = mesh_.faces[c / 3];
      const std::int32_t a = image[face[c % 3]], b = image[face[Next(c % 3)]], d = image[face[Prev(c % 3)]];
      if (a < 0 || b < 0 || d < 0) continue;
      const auto it = by_edge.find(key(d, b));
      if (it == by_edge.end() || it->second / 3 == c / 3) continue;
      if (mesh_.faces[it->second / 3][it->second % 3] == a) mirror.corner[c] = it->second;
    }
    const auto drop = [&](std::int32_t f) {
      for (int k = 0; k < 3; ++k) mirror.corner[3 * f + k] = -1;
    };
    // Removes images that are not mutual, and images of a polygon that lie in several polygons or in the polygon
    // itself.
    std::vector<char> is_wrong(mesh_.faces.size(), 0);
    std::vector<std::int32_t> polygon_image(mesh_.faces.size(), -1);
    for (bool goes_on = true; goes_on;) {
      goes_on = false;
      std::vector<char> polygon_is_wrong(mesh_.faces.size(), 0);
      std::fill(polygon_image.begin(), polygon_image.end(), -1);
      for (std::int32_t f = 0; f < num_faces; ++f) {
        const std::int32_t p = polygon_.empty() ? f : polygon_[f];
        bool is_right = true;
        for (int k = 0; k < 3; ++k) {
          const std::int32_t c = mirror.corner[3 * f + k];
          is_right = is_right && c >= 0 && c / 3 == mirror.corner[3 * f] / 3 && mirror.corner[c] == 3 * f + k;
        }
        if (is_right && !polygon_.empty()) {
          const std::int32_t q = polygon_[mirror.corner[3 * f] / 3];
          is_right = q != p && (polygon_image[p] < 0 || polygon_image[p] == q);
          polygon_image[p] = q;
        }
        if (!is_right) polygon_is_wrong[p] = 1;
      }
      for (std::int32_t f = 0; f < num_faces; ++f) {
        if (!polygon_is_wrong[polygon_.empty() ? f : polygon_[f]] || is_wrong[f]) continue;
        is_wrong[f] = 1;
        drop(f);
        goes_on = true;
      }
    }
    double matched = 0;
    std::vector<char> is_decided(mesh_.faces.size(), 0);  // per polygon
    for (std::int32_t f = 0; f < num_faces; ++f) {
      if (!mirror.has_image(f)) continue;
      matched += area_[f];
      const std::int32_t g = mirror.corner[3 * f] / 3;
      const std::int32_t p = polygon_.empty() ? f : polygon_[f], q = polygon_.empty() ? g : polygon_[g];
      // The first triangle of a polygon decides for all of its triangles.
      if (is_decided[p] == 0) {
        const auto [a, b, c] = TriangleOf(mesh_.positions, mesh_.faces[f]);
        const double side = (a[axis] + b[axis] + c[axis]) / 3 - place;
        is_decided[p] = side > 0 ? 2 : 1;
        is_decided[q] = side > 0 ? 1 : 2;
      }
      mirror.is_second[f] = is_decided[p] == 2;
    }
    *share = matched / total_;
    return mirror;
  }

  const Mesh& mesh_;
  const std::vector<std::int32_t>& polygon_;
  std::vector<double> area_;
  double total_ = 0, reach_ = 0;
};

}  // namespace

std::optional<Mirror> FindMirror(const Mesh& mesh, const std::vector<std::int32_t>& polygon,
                                 const Execution& execution) {
  if (!std::all_of(mesh.faces.begin(), mesh.faces.end(), [&](const Face& face) { return mesh.IsInRange(face); })) {
    return std::nullopt;
  }
  return Finder(mesh, polygon).Find(execution);
}

}  // namespace planish
