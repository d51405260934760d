#include "core/charts/rejoining.h"

#include <algorithm>
#include <cmath>
#include <compare>

namespace planish {
namespace {

constexpr std::size_t kMostAtAnEdge = 64;  // bounds the work, which grows with the square
constexpr double kTurnUnit = 1e-6;         // of cosines, so that rigid motion changes nothing

// Those that come first are joined first.
struct NewPair {
  std::int32_t faces;  // of the smaller one of the two charts
  std::int64_t bend;   // 0: flat, growing up to folded
  std::int32_t first, second;

  auto operator<=>(const NewPair&) const = default;
};

class Rejoining {
 public:
  Rejoining(const Gluing& gluing, const std::vector<std::int32_t>& chart)
      : gluing_(gluing), surface_(gluing.surface()), chart_(chart) {
    for (const std::int32_t i : chart) {
      if (i >= std::ssize(faces_)) faces_.resize(i + 1, 0);
      if (i >= 0) ++faces_[i];
    }
  }

  std::vector<std::array<std::int32_t, 2>> Run() const {
    std::vector<std::array<std::int32_t, 2>> pairs;
    for (const std::vector<std::int32_t>& at : surface_.crowded_edges) {
      std::vector<std::int32_t> loose;
      for (const std::int32_t c : at) {
        if (chart_[c / 3] >= 0 && gluing_.IsOutline(HalfEdgeOf(surface_.mesh, c))) loose.push_back(c);
      }
      if (loose.size() > 1 && loose.size() <= kMostAtAnEdge) PairUp(loose, &pairs);
    }
    return pairs;
  }

 private:
  // Vertices of the surface are those of fans: the same vertex of the mesh has several.
  std::int32_t Source(VertexHandle v) const { return surface_.mesh.data(v).source; }

  bool MayPair(std::int32_t c, std::int32_t d) const {
    const TriMesh& mesh = surface_.mesh;
    const HalfedgeHandle h = HalfEdgeOf(mesh, c), g = HalfEdgeOf(mesh, d);
    return chart_[c / 3] != chart_[d / 3] && mesh.opposite_halfedge_handle(h) != g &&
           Source(mesh.from_vertex_handle(h)) == Source(mesh.to_vertex_handle(g)) && surface_.MayJoin(c / 3, d / 3);
  }

  std::int64_t Bend(std::int32_t f, std::int32_t g) const {
    const double lengths = surface_.area[f] * surface_.area[g];
    const double cosine = lengths > 0 ? surface_.area_normal[f].dot(surface_.area_normal[g]) / lengths : 1;
    return std::llround((1 - cosine) / kTurnUnit);
  }

  void PairUp(const std::vector<std::int32_t>& loose, std::vector<std::array<std::int32_t, 2>>* pairs) const {
    std::vector<NewPair> candidates;
    for (std::size_t i = 0; i < loose.size(); ++i) {
      for (std::size_t j = i + 1; j < loose.size(); ++j) {
        const std::int32_t c = loose[i], d = loose[j];
        if (!MayPair(c, d)) continue;
        const std::int32_t faces = std::min(faces_[chart_[c / 3]], faces_[chart_[d / 3]]);
        candidates.push_back({faces, Bend(c / 3, d / 3), c, d});
      }
    }
    std::sort(candidates.begin(), candidates.end());
    std::vector<std::int32_t> taken;
    for (const NewPair& pair : candidates) {
      const auto is_taken = [&](std::int32_t c) { return std::find(taken.begin(), taken.end(), c) != taken.end(); };
      if (is_taken(pair.first) || is_taken(pair.second)) continue;
      taken.insert(taken.end(), {pair.first, pair.second});
      pairs->push_back({pair.first, pair.second});
    }
  }

  const Gluing& gluing_;
  const Surface& surface_;
  const std::vector<std::int32_t>& chart_;
  std::vector<std::int32_t> faces_;  // per chart
};

}  // namespace

std::vector<std::array<std::int32_t, 2>> PairsToRejoin(const Gluing& gluing, const std::vector<std::int32_t>& chart) {
  return Rejoining(gluing, chart).Run();
}

}  // namespace planish
