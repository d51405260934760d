#include <algorithm>
#include <cmath>
#include <compare>

#include "core/charts/steps.h"
#include "core/mesh/import.h"

namespace planish {
namespace {

constexpr double kTurnUnit = 1e-6;  // cosines are rounded to this, so that rigid motion changes nothing

// Pairs are joined in ascending order.
struct NewPair {
  std::int32_t faces;  // of the smaller of the two charts
  std::int64_t bend;   // 0: flat, growing up to folded
  std::int32_t first, second;

  auto operator<=>(const NewPair&) const = default;
};

}  // namespace

std::vector<std::array<std::int32_t, 2>> PairsToRejoin(const Gluing& gluing, const std::vector<std::int32_t>& chart) {
  const Surface& surface = gluing.surface();
  const TriMesh& mesh = *surface.mesh;
  std::vector<std::int32_t> chart_faces;
  for (const std::int32_t i : chart) {
    if (i >= std::ssize(chart_faces)) chart_faces.resize(i + 1, 0);
    if (i >= 0) ++chart_faces[i];
  }
  // Compares vertices by `source`, the caller's vertex: the import has one vertex for each fan of faces at it.
  const auto source = [&](VertexHandle v) { return mesh.data(v).source; };
  const auto may_pair = [&](std::int32_t c, std::int32_t d) {
    const HalfedgeHandle h = HalfEdgeOf(mesh, c), g = HalfEdgeOf(mesh, d);
    return chart[c / 3] != chart[d / 3] && mesh.opposite_halfedge_handle(h) != g &&
           source(mesh.from_vertex_handle(h)) == source(mesh.to_vertex_handle(g)) && surface.MayJoin(c / 3, d / 3);
  };
  std::vector<std::array<std::int32_t, 2>> pairs;
  for (const std::vector<std::int32_t>& at : surface.crowded_edges) {
    std::vector<std::int32_t> loose;
    for (const std::int32_t c : at) {
      if (chart[c / 3] >= 0 && gluing.IsOutline(HalfEdgeOf(mesh, c))) loose.push_back(c);
    }
    if (loose.size() > kMostFacesAtAnEdge) continue;
    std::vector<NewPair> candidates;
    for (std::size_t i = 0; i < loose.size(); ++i) {
      for (std::size_t j = i + 1; j < loose.size(); ++j) {
        const std::int32_t c = loose[i], d = loose[j];
        if (!may_pair(c, d)) continue;
        candidates.push_back({std::min(chart_faces[chart[c / 3]], chart_faces[chart[d / 3]]),
                              std::llround((1 - surface.bend_cosine(c / 3, d / 3)) / kTurnUnit), c, d});
      }
    }
    std::sort(candidates.begin(), candidates.end());
    const auto is_loose = [&](std::int32_t c) { return std::find(loose.begin(), loose.end(), c) != loose.end(); };
    for (const NewPair& pair : candidates) {
      if (!is_loose(pair.first) || !is_loose(pair.second)) continue;
      std::erase_if(loose, [&](std::int32_t c) { return c == pair.first || c == pair.second; });
      pairs.push_back({pair.first, pair.second});
    }
  }
  return pairs;
}

}  // namespace planish
