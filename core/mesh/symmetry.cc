#include "core/mesh/symmetry.h"

#include <algorithm>
#include <array>
#include <bit>
#include <cmath>
#include <limits>
#include <optional>
#include <span>
#include <utility>
#include <vector>

#include "Eigen/Geometry"
#include "core/base/radix_sort.h"

namespace planish {
namespace {

constexpr double kTolerance = 1e-3;  // how far a vertex may be from an image, in diagonals of the mesh
constexpr double kLeastShare = 0.9;  // least share of the area with an image
constexpr double kLeastFound = 0.6;  // least share of sampled vertices with an image, for a plane that is examined

// The vertices of a mesh in a grid of cells.
class Cells {
 public:
  Cells(const Mesh& mesh, double reach)
      : mesh_(mesh),
        reach_(reach),
        slots_(std::bit_ceil(mesh.positions.size() + mesh.positions.size() / 2 + 2)),
        next_(mesh.positions.size(), -1) {
    for (std::int32_t v = 0; v < std::ssize(next_); ++v) {
      Slot& slot = slots_[PlaceOf(KeyOf(CellOf(mesh.positions[v])))];
      slot.key = KeyOf(CellOf(mesh.positions[v]));
      next_[v] = std::exchange(slot.first, v);
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
          for (std::int32_t v = slots_[PlaceOf(KeyOf({x, y, z}))].first; v >= 0; v = next_[v]) {
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

  // The slot with this key, or the free one where it belongs: a hash table with linear probing.
  std::size_t PlaceOf(std::uint64_t key) const {
    const std::size_t mask = slots_.size() - 1;
    std::size_t place = (key * 0x9E3779B97F4A7C15U) >> 32 & mask;
    while (slots_[place].first >= 0 && slots_[place].key != key) place = (place + 1) & mask;
    return place;
  }

  struct Slot {
    std::uint64_t key = 0;
    std::int32_t first = -1;  // the last vertex of the cell; free if there is none
  };

  const Mesh& mesh_;
  double reach_;
  std::vector<Slot> slots_;
  std::vector<std::int32_t> next_;  // per vertex: another one of its cell, or -1
};

// Which half-edges run between which places: vertices in the same place count as one.
class Links {
 public:
  Links(const Mesh& mesh, const Cells& cells, const Execution& execution)
      : mesh_(mesh), same_(mesh.positions.size()), opposite_(3 * mesh.faces.size()) {
    execution.ForEach(std::ssize(same_), [&](std::int64_t v) { same_[v] = cells.Nearest(mesh.positions[v]); });
    const auto corners = static_cast<std::int32_t>(opposite_.size());
    const Groups by_end = GroupByKey(corners, std::ssize(same_), [&](std::int32_t c) { return same_[To(c)]; });
    by_start_ = GroupByKey(corners, std::ssize(same_), [&](std::int32_t i) { return same_[From(by_end.item[i])]; });
    for (std::int32_t& i : by_start_.item) i = by_end.item[i];
    execution.ForEach(corners, [&](std::int64_t c) {
      opposite_[c] = Facing(same_[To(static_cast<std::int32_t>(c))], same_[From(static_cast<std::int32_t>(c))]);
    });
  }

  std::int32_t From(std::int32_t c) const { return mesh_.faces[c / 3][Next(c % 3)]; }
  std::int32_t To(std::int32_t c) const { return mesh_.faces[c / 3][Prev(c % 3)]; }
  // The lowest vertex in the place of this one.
  std::int32_t same(std::int32_t v) const { return same_[v]; }
  // The lowest corner that faces the half-edge from v to w; -1 if there is none, or v or w is -1.
  std::int32_t Facing(std::int32_t v, std::int32_t w) const {
    if (v < 0 || w < 0) return -1;
    const std::span<const std::int32_t> from = by_start_[v];
    const auto found = std::lower_bound(from.begin(), from.end(), w,
                                        [&](std::int32_t c, std::int32_t to) { return same_[To(c)] < to; });
    return found != from.end() && same_[To(*found)] == w ? *found : -1;
  }
  // The lowest corner that faces the same edge from the other side, or -1.
  std::int32_t Opposite(std::int32_t c) const { return opposite_[c]; }

 private:
  const Mesh& mesh_;
  std::vector<std::int32_t> same_;      // per vertex
  std::vector<std::int32_t> opposite_;  // per corner
  Groups by_start_;                     // corners by where their half-edges start, and then by where they end
};

// Finds the images of faces for one plane.
class Matching {
 public:
  template <class Image>
  Matching(const Mesh& mesh, const std::vector<std::int32_t>& polygon, const std::vector<double>& area,
           const Cells& cells, const Links& links, const Image& image, const Execution& execution)
      : mesh_(mesh),
        area_(area),
        links_(links),
        execution_(execution),
        num_faces_(static_cast<std::int32_t>(mesh.faces.size())),
        image_(mesh.positions.size()),
        image_position_(mesh.positions.size()) {
    execution.ForEach(std::ssize(image_), [&](std::int64_t v) {
      image_position_[v] = image(mesh.positions[v]);
      image_[v] = cells.Nearest(image_position_[v]);
    });
    mirror_.polygon = polygon;
    for (std::int32_t f = 0; polygon.empty() && f < num_faces_; ++f) mirror_.polygon.push_back(f);
  }

  Mirror Run(int axis, double place) {
    MatchEdges();
    MatchPolygons();
    MatchPairs();
    TellSides(axis, place);
    double matched = 0, total = 0;
    for (std::int32_t f = 0; f < num_faces_; ++f) {
      total += area_[f];
      if (image_of_[polygon(f)] >= 0) matched += area_[f];
    }
    mirror_.share = matched / total;
    if (mirror_.share >= kLeastShare) {
      for (std::int32_t c = 0; c < 3 * num_faces_; ++c) {
        if (image_of_[polygon(c / 3)] < 0) mirror_.corner[c] = -1;
      }
      FindFaces();
    }
    return std::move(mirror_);
  }

 private:
  std::int32_t polygon(std::int32_t f) const { return mirror_.polygon[f]; }
  std::int32_t Opposite(std::int32_t c) const { return links_.Opposite(c); }
  bool IsInner(std::int32_t c) const {
    const std::int32_t across = Opposite(c);
    return across >= 0 && polygon(across / 3) == polygon(c / 3);
  }

  void MatchEdges() {
    std::vector<std::int32_t>& corner = mirror_.corner;
    corner.resize(3 * mesh_.faces.size());
    execution_.ForEach(std::ssize(corner), [&](std::int64_t at) {
      const auto c = static_cast<std::int32_t>(at);
      corner[c] = links_.Facing(image_[links_.To(c)], image_[links_.From(c)]);
    });
    const std::vector<std::int32_t> found = corner;
    for (std::int32_t c = 0; c < 3 * num_faces_; ++c) {
      if (found[c] >= 0 && found[found[c]] != c) corner[c] = -1;
    }
  }

  // Two polygons match if the outer edges of each are the images of the outer edges of the other.
  void MatchPolygons() {
    constexpr std::int32_t kNone = -1, kUnknown = -2;
    image_of_.assign(num_faces_, kUnknown);
    std::vector<std::int32_t> outer(num_faces_, 0);
    size_.assign(num_faces_, 0);
    for (std::int32_t c = 0; c < 3 * num_faces_; ++c) {
      const std::int32_t p = polygon(c / 3);
      if (c % 3 == 0) ++size_[p];
      if (IsInner(c)) continue;
      ++outer[p];
      const std::int32_t q = mirror_.corner[c] < 0 ? kNone : polygon(mirror_.corner[c] / 3);
      image_of_[p] = image_of_[p] == kUnknown || image_of_[p] == q ? q : kNone;
    }
    const std::vector<std::int32_t> found = image_of_;
    for (std::int32_t p = 0; p < num_faces_; ++p) {
      const std::int32_t q = found[p];
      if (q < 0 || found[q] != p || outer[q] != outer[p]) image_of_[p] = kNone;
    }
  }

  // Whether this face is a polygon of its own, without an image.
  bool IsAlone(std::int32_t f) const { return size_[polygon(f)] == 1 && image_of_[polygon(f)] < 0; }

  // Matches two triangles with two others that divide the mirrored quad along its other diagonal. Each of the two pairs
  // becomes a polygon.
  void MatchPairs() {
    for (std::int32_t c = 0; c < 3 * num_faces_; ++c) {
      const std::int32_t across = Opposite(c);
      if (across < 0 || across / 3 == c / 3 || !IsAlone(c / 3) || !IsAlone(across / 3)) continue;
      const std::array<std::int32_t, 2> faces = {c / 3, across / 3};
      std::array<std::int32_t, 2> images = {-1, -1}, hits = {0, 0};
      for (const std::int32_t d : {c, across}) {
        for (const int k : {Next(d % 3), Prev(d % 3)}) {
          const std::int32_t image = mirror_.corner[3 * (d / 3) + k];
          for (int i = 0; image >= 0 && i < 2; ++i) {
            if (images[i] < 0) images[i] = image / 3;
            if (images[i] != image / 3) continue;
            ++hits[i];
            break;
          }
        }
      }
      if (hits[0] != 2 || hits[1] != 2 || !IsAlone(images[0]) || !IsAlone(images[1])) continue;
      const bool is_same = std::is_permutation(faces.begin(), faces.end(), images.begin());
      const auto has = [&](std::int32_t f) { return f == faces[0] || f == faces[1]; };
      if (!is_same && (has(images[0]) || has(images[1]))) continue;
      const std::int32_t p = polygon(faces[0]), q = is_same ? p : polygon(images[0]);
      for (const std::array<std::int32_t, 2>& pair : {faces, images}) {
        for (const std::int32_t f : pair) {
          for (int k = 0; k < 3; ++k) {
            const std::int32_t other = Opposite(3 * f + k);
            if (other >= 0 && other / 3 != f && (other / 3 == pair[0] || other / 3 == pair[1])) {
              mirror_.corner[3 * f + k] = -1;
            }
          }
        }
      }
      mirror_.polygon[faces[1]] = p;
      mirror_.polygon[images[0]] = mirror_.polygon[images[1]] = q;
      if (is_same) mirror_.polygon[faces[0]] = mirror_.polygon[faces[1]] = p;
      size_[p] = size_[q] = 2;
      image_of_[p] = q;
      image_of_[q] = p;
    }
  }

  // Sets the side of each polygon, which is the side of its first face.
  void TellSides(int axis, double place) {
    using Side = Mirror::Side;
    std::vector<Side> side(num_faces_, Side::kAcross);  // per polygon
    std::vector<char> is_known(num_faces_, 0);
    for (std::int32_t f = 0; f < num_faces_; ++f) {
      const std::int32_t p = polygon(f), q = image_of_[p];
      if (std::exchange(is_known[p], 1) == 0 && q != p) {
        const auto [a, b, c] = TriangleOf(mesh_.positions, mesh_.faces[f]);
        const bool is_second = (a[axis] + b[axis] + c[axis]) / 3 > place;
        side[p] = is_second ? Side::kSecond : Side::kFirst;
        if (q >= 0) {
          side[q] = is_second ? Side::kFirst : Side::kSecond;
          is_known[q] = 1;
        }
      }
      mirror_.side.push_back(side[p]);
    }
  }

  Vec3 Centre(std::int32_t f, const std::vector<Vec3>& positions) const {
    const auto [a, b, c] = TriangleOf(positions, mesh_.faces[f]);
    return (a + b + c) / 3;
  }

  void FindFaces() {
    using Side = Mirror::Side;
    std::vector<std::int32_t> first(num_faces_, -1);  // of each polygon
    for (std::int32_t f = num_faces_; f-- > 0;) first[polygon(f)] = f;
    for (std::int32_t f = 0; f < num_faces_; ++f) {
      const std::int32_t q = image_of_[polygon(f)];
      mirror_.face.push_back(q < 0 ? -1 : first[q]);
    }
    const Groups at = GroupByKey(3 * num_faces_, std::ssize(image_),
                                 [&](std::int32_t c) { return links_.same(mesh_.faces[c / 3][c % 3]); });
    const auto is_lost = [&](std::int32_t f) { return mirror_.side[f] == Side::kSecond && mirror_.face[f] < 0; };
    std::vector<std::int32_t> queue;
    for (std::int32_t f = 0; f < num_faces_; ++f) {
      if (mirror_.side[f] != Side::kSecond || image_of_[polygon(f)] >= 0) continue;
      const Vec3 centre = Centre(f, image_position_);
      double least = std::numeric_limits<double>::infinity();
      for (const std::int32_t v : mesh_.faces[f]) {
        if (image_[v] < 0) continue;
        for (const std::int32_t c : at[image_[v]]) {
          const std::int32_t g = c / 3;
          const double distance = (Centre(g, mesh_.positions) - centre).squaredNorm();
          if (mirror_.side[g] != Side::kFirst || !(distance < least)) continue;
          least = distance;
          mirror_.face[f] = g;
        }
      }
    }
    // Faces for which no mirror image was found take the image of a neighbour.
    for (std::int32_t f = 0; f < num_faces_; ++f) {
      if (mirror_.side[f] == Side::kSecond && mirror_.face[f] >= 0) queue.push_back(f);
    }
    for (std::size_t i = 0; i < queue.size(); ++i) {
      for (int k = 0; k < 3; ++k) {
        const std::int32_t across = Opposite(3 * queue[i] + k);
        if (across < 0 || !is_lost(across / 3)) continue;
        mirror_.face[across / 3] = mirror_.face[queue[i]];
        queue.push_back(across / 3);
      }
    }
    // All faces of a polygon take the image of its first face.
    for (std::int32_t f = 0; f < num_faces_; ++f) mirror_.face[f] = mirror_.face[first[polygon(f)]];
  }

  const Mesh& mesh_;
  const std::vector<double>& area_;
  const Links& links_;
  const Execution& execution_;
  const std::int32_t num_faces_;
  // Per vertex: the lowest vertex where its mirror image is, or -1; the image's position.
  std::vector<std::int32_t> image_;
  std::vector<Vec3> image_position_;
  // Per polygon: its image or -1; its number of faces.
  std::vector<std::int32_t> image_of_, size_;
  Mirror mirror_;
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
    // Cells are numbered from the origin, so that their numbers are too large for a mesh far from it.
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
    std::optional<Links> links;
    std::optional<Mirror> best;
    for (int axis = 0; axis < 3; ++axis) {
      for (const double place : {middle[axis], centre[axis]}) {
        if (execution.IsCancelled()) return std::nullopt;
        if (place == centre[axis] && std::abs(middle[axis] - place) < reach_ / 4 && place != middle[axis]) continue;
        if (!IsLikely(cells, axis, place)) continue;
        if (!links) links.emplace(mesh_, cells, execution);
        Mirror mirror = Across(cells, *links, axis, place, execution);
        if (mirror.share < kLeastShare || (best && mirror.share <= best->share)) continue;
        best = std::move(mirror);
      }
    }
    if (execution.IsCancelled()) return std::nullopt;
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
    return static_cast<double>(hits) >= kLeastFound * static_cast<double>(count);
  }

  Mirror Across(const Cells& cells, const Links& links, int axis, double place, const Execution& execution) const {
    const auto image = [&](const Vec3& p) { return Image(p, axis, place); };
    return Matching(mesh_, polygon_, area_, cells, links, image, execution).Run(axis, place);
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
