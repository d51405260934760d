#include "core/charts/patches.h"

#include <algorithm>
#include <cmath>
#include <cstddef>
#include <functional>
#include <numeric>
#include <queue>
#include <utility>

namespace planish {
namespace {

constexpr double kMaxDeviation = 0.08;  // 1 - length of the mean normal
constexpr double kMinCosine = 0.7;      // between the mean normals of two patches that are joined
constexpr double kCostUnit = 1e-7;

class Joining {
 public:
  explicit Joining(const Surface& surface)
      : parent_(surface.num_faces()), area_(surface.area), normal_(surface.area_normal) {
    std::iota(parent_.begin(), parent_.end(), 0);
  }

  std::int32_t Root(std::int32_t f) {
    while (parent_[f] != f) f = parent_[f] = parent_[parent_[f]];
    return f;
  }

  // What it costs to join two patches, in units of kCostUnit; more than MaxCost() if they should stay apart.
  std::int64_t Cost(std::int32_t a, std::int32_t b) const {
    const double area = area_[a] + area_[b];
    if (!(area > 0)) return 0;
    const double along = normal_[a].dot(normal_[b]), lengths = normal_[a].norm() * normal_[b].norm();
    if (along < kMinCosine * lengths) return MaxCost() + 1;
    return std::llround(std::max(0.0, 1 - (normal_[a] + normal_[b]).norm() / area) / kCostUnit);
  }
  static std::int64_t MaxCost() { return std::llround(kMaxDeviation / kCostUnit); }

  void Join(std::int32_t a, std::int32_t b) {
    if (b < a) std::swap(a, b);
    parent_[b] = a;
    area_[a] += area_[b];
    normal_[a] += normal_[b];
  }

 private:
  std::vector<std::int32_t> parent_;
  std::vector<double> area_;  // of roots: of their patch
  std::vector<Vec3> normal_;
};

}  // namespace

std::vector<std::int32_t> MakePatches(const Surface& surface, const Execution& execution) {
  const std::int32_t num_faces = surface.num_faces();
  Joining joining(surface);
  using Entry = std::pair<std::int64_t, std::int32_t>;  // cost, half-edge
  std::vector<Entry> entries;
  for (std::int32_t c = 0; c < 3 * num_faces; ++c) {
    const std::int32_t o = surface.across[c];
    if (o < c) continue;
    if (surface.is_uncut(c)) {
      const std::int32_t a = joining.Root(c / 3), b = joining.Root(o / 3);
      if (a != b) joining.Join(a, b);
      continue;
    }
    const std::int64_t cost = joining.Cost(c / 3, o / 3);
    if (cost <= Joining::MaxCost()) entries.emplace_back(cost, c);
  }
  std::priority_queue<Entry, std::vector<Entry>, std::greater<>> queue(std::greater<>(), std::move(entries));
  for (std::int64_t step = 0; !queue.empty() && !execution.IsStoppedAt(step); ++step) {
    const auto [cost, c] = queue.top();
    queue.pop();
    const std::int32_t a = joining.Root(c / 3), b = joining.Root(surface.across[c] / 3);
    if (a == b) continue;
    // The patches may have grown since.
    const std::int64_t present = joining.Cost(a, b);
    if (present <= cost) {
      joining.Join(a, b);
    } else if (present <= Joining::MaxCost()) {
      queue.emplace(present, c);
    }
  }
  std::vector<std::int32_t> patch(num_faces, -1), number(num_faces, -1);
  std::int32_t count = 0;
  for (std::int32_t f = 0; f < num_faces; ++f) {
    if (!surface.takes_part[f]) continue;
    std::int32_t& of_root = number[joining.Root(f)];
    if (of_root < 0) of_root = count++;
    patch[f] = of_root;
  }
  return patch;
}

}  // namespace planish
