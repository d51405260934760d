#include <algorithm>
#include <cmath>
#include <functional>
#include <queue>
#include <utility>

#include "core/charts/steps.h"
#include "core/mesh/half_edges.h"

namespace planish {
namespace {

constexpr double kCostUnit = 1e-7;
constexpr std::int64_t kLeastBucket = 1 << 5;  // of these units
constexpr std::int64_t kEdgesOfBucket = 16;    // about, in the mean, at least

// An edge between two patches, which have faces f and g.
struct BorderEdge {
  std::int32_t cost, edge, f, g;

  bool operator>(const BorderEdge& o) const { return cost != o.cost ? cost > o.cost : edge > o.edge; }
};

struct Patch {
  Vec3 normal;  // times the area
  double area;
  double length;  // of `normal`
};

// What it costs to join two patches, in units of kCostUnit; more than `most` if they should stay apart.
std::int64_t Cost(const Patch& one, const Patch& other, std::int64_t most, const AtlasTuning& tuning) {
  const double area = one.area + other.area;
  if (!(area > 0)) return 0;
  const double along = one.normal.dot(other.normal);
  if (along < tuning.patch_cosine * one.length * other.length) return most + 1;
  const double length = std::sqrt(one.length * one.length + other.length * other.length + 2 * along);  // of the sum
  return static_cast<std::int64_t>(std::max(0.0, 1 - length / area) / kCostUnit + 0.5);
}

}  // namespace

std::vector<std::int32_t> MakePatches(const Surface& surface, const AtlasTuning& tuning, const Execution& execution) {
  const std::int32_t num_faces = surface.num_faces();
  UnionFind patches(num_faces);
  std::vector<Patch> shape;  // of roots
  shape.reserve(num_faces);
  for (std::int32_t f = 0; f < num_faces; ++f) {
    const Vec3& normal = surface.area_normal[f];
    shape.push_back({normal, surface.area[f], normal.norm()});
  }
  const auto join = [&](std::int32_t a, std::int32_t b) {
    patches.Join(a, b);
    if (b < a) std::swap(a, b);
    shape[a].area += shape[b].area;
    shape[a].normal += shape[b].normal;
    shape[a].length = shape[a].normal.norm();
  };
  const std::int64_t most = std::llround(tuning.patch_deviation / kCostUnit);
  // Buckets of costs, since one heap of all edges, or of those of a smooth surface, would not stay in the cache. How
  // wide they are changes no order.
  const std::int64_t width =
      std::max(kLeastBucket, most * kEdgesOfBucket / std::max<std::int64_t>(1, surface.mesh->n_edges()));
  using Queue = std::priority_queue<BorderEdge, std::vector<BorderEdge>, std::greater<>>;
  std::vector<std::vector<BorderEdge>> entries(most / width + 1);
  for (const EdgeHandle e : surface.mesh->edges()) {
    const HalfedgeHandle h = surface.mesh->halfedge_handle(e, 0);
    const std::int32_t f = surface.mesh->face_handle(h).idx(), g = surface.face_across(h);
    if (g < 0) continue;
    if (surface.mesh->data(e).is_uncut) {
      const std::int32_t a = patches.Find(f), b = patches.Find(g);
      if (a != b) join(a, b);
      continue;
    }
    const std::int64_t cost = Cost(shape[f], shape[g], most, tuning);
    if (cost <= most) entries[cost / width].push_back({static_cast<std::int32_t>(cost), e.idx(), f, g});
  }
  for (std::int64_t bucket = 0, step = 0; bucket < std::ssize(entries); ++bucket) {
    Queue queue(std::greater<>(), std::move(entries[bucket]));
    for (; !queue.empty() && !execution.IsCancelledAt(step); ++step) {
      const auto [cost, e, f, g] = queue.top();
      queue.pop();
      const std::int32_t a = patches.Find(f), b = patches.Find(g);
      if (a == b) continue;
      // The patches may have grown since.
      const std::int64_t present = Cost(shape[a], shape[b], most, tuning);
      const BorderEdge entry = {static_cast<std::int32_t>(present), e, a, b};
      if (present <= cost) {
        join(a, b);
      } else if (present > most) {
        continue;
      } else if (present / width == bucket) {
        queue.push(entry);
      } else {
        entries[present / width].push_back(entry);
      }
    }
  }
  std::vector<std::int32_t> patch(num_faces, -1);
  for (std::int32_t f = 0; f < num_faces; ++f) {
    if (surface.takes_part[f]) patch[f] = patches.Find(f);
  }
  NumberByFirst(num_faces, &patch);
  return patch;
}

}  // namespace planish
