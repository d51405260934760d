#include "core/unwrap/seam_figures.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <cstdint>
#include <limits>
#include <numbers>
#include <utility>

#include "Eigen/Geometry"
#include "core/base/portable_math.h"
#include "core/base/radix_sort.h"
#include "core/mesh/half_edges.h"
#include "core/mesh/visibility.h"

namespace planish {
namespace {

struct SeamEdge {
  std::int32_t from, to;
  double length;
};

std::uint64_t KeyOf(std::int32_t v, std::int32_t w) {
  const auto [low, high] = std::minmax(v, w);
  return std::uint64_t(low) << 32 | std::uint64_t(high);
}

// Finds vertices at mirror images.
class MirrorSearch {
 public:
  MirrorSearch(const Mesh& mesh, std::vector<std::int32_t> vertices)
      : positions_(mesh.positions), vertices_(std::move(vertices)) {
    for (const std::int32_t v : vertices_) box_.extend(positions_[v]);
    near_ = kNear * box_.diagonal().norm();
    if (!(near_ > 0)) return;
    for (const std::int32_t v : vertices_) cells_.push_back({Key(CellOf(positions_[v])), v});
    SortByKey(&cells_);
  }

  // SeamFigures::symmetry.
  std::optional<double> Run(const std::vector<SeamEdge>& seams) {
    if (!(near_ > 0)) return std::nullopt;
    std::vector<std::uint64_t> keys;
    for (const SeamEdge& seam : seams) keys.push_back(KeyOf(seam.from, seam.to));
    std::sort(keys.begin(), keys.end());
    std::optional<double> symmetry;
    double best = 0;
    for (int axis = 0; axis < 3; ++axis) {
      for (const double at : {0.0, box_.center()[axis]}) {
        const double matched = ShareMatched(axis, at);
        if (!(matched > kLeastMatched)) continue;
        const double share = ShareMirrored(axis, at, seams, keys);
        const double score = matched + kShareInScore * share;
        if (tests_left_ <= 0 || score <= best) continue;
        best = score;
        symmetry = share;
      }
    }
    return symmetry;
  }

 private:
  static constexpr double kNear = 1e-3;          // in diagonals of the bounding box
  static constexpr double kLeastMatched = 0.95;  // share of the vertices
  static constexpr double kShareInScore = 1e-3;
  static constexpr std::size_t kMostLookedAt = 20'000;
  static constexpr std::int64_t kMostTests = 20'000'000;

  // Cells are twice as wide as the search distance: eight of them hold all vertices near a place.
  std::array<std::int64_t, 3> CellOf(const Vec3& p) const {
    std::array<std::int64_t, 3> cell;
    for (int k = 0; k < 3; ++k) cell[k] = std::llround(std::floor((p[k] - box_.min()[k]) / (2 * near_)));
    return cell;
  }
  static std::uint64_t Key(const std::array<std::int64_t, 3>& cell) {
    std::uint64_t key = 0;  // at most 500 cells fit along the diagonal
    for (const std::int64_t k : cell) key = key << 20 | std::uint64_t(k + 2);
    return key;
  }

  // The vertex nearest to the mirror image; -1 if none is near.
  std::int32_t ImageOf(std::int32_t v, int axis, double at) {
    Vec3 p = positions_[v];
    p[axis] = 2 * at - p[axis];
    const Vec3 margin = Vec3::Constant(near_);
    if (!(p.array() >= (box_.min() - margin).array()).all() || !(p.array() <= (box_.max() + margin).array()).all()) {
      return -1;
    }
    const std::array<std::int64_t, 3> low = CellOf(p - margin), high = CellOf(p + margin);
    std::int32_t nearest = -1;
    double least = near_ * near_;
    for (std::int64_t x = low[0]; x <= high[0]; ++x) {
      for (std::int64_t y = low[1]; y <= high[1]; ++y) {
        for (std::int64_t z = low[2]; z <= high[2]; ++z) {
          const std::uint64_t key = Key({x, y, z});
          auto entry = std::lower_bound(cells_.begin(), cells_.end(), key,
                                        [](const KeyedIndex& e, std::uint64_t k) { return e.key < k; });
          for (; entry != cells_.end() && entry->key == key && --tests_left_ > 0; ++entry) {
            const double square = (positions_[entry->index] - p).squaredNorm();
            if (square < least || (square == least && nearest >= 0 && entry->index < nearest)) {
              least = square;
              nearest = entry->index;
            }
          }
        }
      }
    }
    return nearest;
  }

  // The share of the vertices (or of a sample) that have a mirror image. Ends early with 0 if too many vertices lack
  // one.
  double ShareMatched(int axis, double at) {
    const std::size_t step = (vertices_.size() + kMostLookedAt - 1) / kMostLookedAt;
    const std::size_t all = (vertices_.size() + step - 1) / step;
    std::size_t missed = 0;
    for (std::size_t i = 0; i < vertices_.size(); i += step) {
      missed += ImageOf(vertices_[i], axis, at) < 0;
      if (tests_left_ <= 0 || static_cast<double>(missed) > (1 - kLeastMatched) * static_cast<double>(all)) return 0;
    }
    return 1 - static_cast<double>(missed) / static_cast<double>(all);
  }

  double ShareMirrored(int axis, double at, const std::vector<SeamEdge>& seams,
                       const std::vector<std::uint64_t>& keys) {
    const auto is_in_plane = [&](std::int32_t v) { return std::abs(positions_[v][axis] - at) < near_; };
    double all = 0, mirrored = 0;
    for (const auto& [from, to, length] : seams) {
      if (is_in_plane(from) && is_in_plane(to)) continue;
      const std::int32_t a = ImageOf(from, axis, at), b = ImageOf(to, axis, at);
      if (a < 0 || b < 0) continue;
      all += length;
      if (std::binary_search(keys.begin(), keys.end(), KeyOf(a, b))) mirrored += length;
    }
    return all > 0 ? mirrored / all : 1;
  }

  const std::vector<Vec3>& positions_;
  const std::vector<std::int32_t> vertices_;
  Eigen::AlignedBox3d box_;
  double near_ = 0;
  std::vector<KeyedIndex> cells_;
  std::int64_t tests_left_ = kMostTests;
};

// SeamFigures::turn_deg. `is_boundary`: per vertex.
double MeanTurn(const Mesh& mesh, const std::vector<SeamEdge>& seams, const std::vector<char>& is_boundary) {
  struct Ends {
    int count = 0;
    std::array<std::int32_t, 2> other = {};
  };
  std::vector<Ends> ends(mesh.positions.size());
  const auto add = [&](std::int32_t v, std::int32_t other) {
    if (ends[v].count < 2) ends[v].other[ends[v].count] = other;
    ++ends[v].count;
  };
  for (const SeamEdge& seam : seams) add(seam.from, seam.to), add(seam.to, seam.from);
  double sum = 0, weights = 0;
  for (std::size_t v = 0; v < ends.size(); ++v) {
    if (ends[v].count != 2 || is_boundary[v]) continue;
    const Vec3 in = mesh.positions[v] - mesh.positions[ends[v].other[0]];
    const Vec3 out = mesh.positions[ends[v].other[1]] - mesh.positions[v];
    const double before = in.norm(), after = out.norm();
    if (!(before > 0) || !(after > 0)) continue;
    const Vec3 from = in / before, to = out / after;
    sum += portable::Atan2(from.cross(to).norm(), from.dot(to)) * (before + after) / 2;
    weights += (before + after) / 2;
  }
  return weights > 0 ? sum / weights * 180 / std::numbers::pi : 0;
}

}  // namespace

SeamFigures MeasureSeams(const Mesh& mesh, const CornerUv& uv, const Execution& execution) {
  SeamFigures figures;
  std::vector<char> takes_part(mesh.faces.size(), 0), is_used(mesh.positions.size(), 0);
  std::vector<char> is_boundary(mesh.positions.size(), 0);
  const auto area_normal = [&](std::int64_t f) {
    const auto [a, b, c] = TriangleOf(mesh.positions, mesh.faces[f]);
    return Vec3((b - a).cross(c - a) / 2);
  };
  double area = 0;
  for (std::size_t f = 0; f < mesh.faces.size(); ++f) {
    const auto& [a, b, c] = mesh.faces[f];
    takes_part[f] = a != b && b != c && c != a;
    if (!takes_part[f]) continue;
    is_used[a] = is_used[b] = is_used[c] = 1;
    area += area_normal(static_cast<std::int64_t>(f)).norm();
  }
  if (!(area > 0)) return figures;
  const EdgeGroups edges = GroupHalfEdges(mesh.faces, mesh.num_vertices(), execution, takes_part);
  std::vector<SeamEdge> seams;
  std::vector<Vec3> middles, normals;
  for (std::int32_t e = 0; e < edges.count(); ++e) {
    const std::int32_t c = edges[e][0];
    const std::int32_t from = Origin(mesh.faces, c), to = Target(mesh.faces, c);
    if (edges[e].size() == 1) is_boundary[from] = is_boundary[to] = 1;
    if (edges[e].size() != 2) continue;
    const std::int32_t d = edges[e][1];
    const bool runs_back = Origin(mesh.faces, d) == to;
    const bool is_seam =
        UvOf(uv, FlatLinks::Next(c)) != UvOf(uv, runs_back ? FlatLinks::Prev(d) : FlatLinks::Next(d)) ||
        UvOf(uv, FlatLinks::Prev(c)) != UvOf(uv, runs_back ? FlatLinks::Next(d) : FlatLinks::Prev(d));
    if (!is_seam) continue;
    seams.push_back({from, to, (mesh.positions[to] - mesh.positions[from]).norm()});
    middles.push_back((mesh.positions[from] + mesh.positions[to]) / 2);
    normals.push_back(area_normal(c / 3).stableNormalized() + area_normal(d / 3).stableNormalized());
  }
  const std::vector<float> visibility = VisibilityFrom(mesh, middles, normals, execution);
  for (std::size_t i = 0; i < seams.size(); ++i) {
    figures.visible_length += seams[i].length * static_cast<double>(visibility[i]) / std::sqrt(area);
  }
  figures.turn_deg = MeanTurn(mesh, seams, is_boundary);
  std::vector<std::int32_t> vertices;
  for (std::int32_t v = 0; v < std::ssize(is_used); ++v) {
    if (is_used[v]) vertices.push_back(v);
  }
  figures.symmetry = MirrorSearch(mesh, std::move(vertices)).Run(seams);
  return figures;
}

}  // namespace planish
