#include "client/cli/check_map.h"

#include <algorithm>
#include <cmath>
#include <cstddef>
#include <utility>

#include "client/files/uv_islands.h"

namespace planish::cli {
namespace {

bool AreFinite(const Mesh& mesh, const CornerUv& uv, std::size_t t) {
  return std::all_of(uv.begin() + 6 * static_cast<std::ptrdiff_t>(t),
                     uv.begin() + 6 * static_cast<std::ptrdiff_t>(t + 1), [](double x) { return std::isfinite(x); }) &&
         std::all_of(mesh.faces[t].begin(), mesh.faces[t].end(),
                     [&](std::int32_t v) { return mesh.positions[v].allFinite(); });
}

// `has_uv(t)`: whether triangle t has UV at all.
template <typename HasUv>
CheckedMap CheckTriangles(const MeshInput& input, const CornerUv& uv, MapCheckOptions options,
                          const Execution& execution, const HasUv& has_uv) {
  CheckedMap map;
  const Mesh& all = input.mesh();
  map.triangles = all.num_faces();
  const std::vector<std::int32_t> materials = input.FaceMaterials();
  std::vector<std::int64_t> polygons;
  for (std::size_t t = 0; t < all.faces.size(); ++t) {
    const auto id = static_cast<std::int32_t>(t);
    if (!has_uv(t)) {
      map.without_uv.push_back(id);
    } else if (!AreFinite(all, uv, t)) {
      map.not_finite.push_back(id);
    } else {
      map.mesh.faces.push_back(all.faces[t]);
      map.triangle_of_face.push_back(id);
      map.uv.insert(map.uv.end(), uv.begin() + 6 * static_cast<std::ptrdiff_t>(t),
                    uv.begin() + 6 * static_cast<std::ptrdiff_t>(t + 1));
      polygons.push_back(input.PolygonOf(id));
      if (!materials.empty()) map.material_of_face.push_back(materials[t]);
    }
  }
  if (map.mesh.faces.empty()) return map;
  map.mesh.positions = all.positions;
  UvIslands islands = FindUvIslands(map.mesh, map.uv, polygons);
  map.topology = {std::move(islands.place_of_corner), islands.num_places, std::move(islands.island_of_face),
                  islands.count, std::move(islands.is_outline)};
  map.first_face_of_chart.assign(static_cast<std::size_t>(map.topology.num_charts), -1);
  for (std::size_t f = 0; f < map.mesh.faces.size(); ++f) {
    std::int32_t& first = map.first_face_of_chart[static_cast<std::size_t>(map.topology.chart_of_face[f])];
    if (first < 0) first = static_cast<std::int32_t>(f);
  }
  options.material_of_face = map.material_of_face;
  options.num_materials = materials.empty() ? 0 : *std::max_element(materials.begin(), materials.end()) + 1;
  map.check = CheckMap(map.mesh, map.uv, map.topology, options, execution);
  return map;
}

}  // namespace

CheckedMap CheckMapOf(const MeshInput& input, const MapCheckOptions& options, const Execution& execution) {
  const std::vector<std::int32_t> ids = input.CornerTexcoords();
  return CheckTriangles(input, input.CornerUv(), options, execution, [&](std::size_t t) {
    return !ids.empty() && std::min({ids[3 * t], ids[3 * t + 1], ids[3 * t + 2]}) >= 0;
  });
}

CheckedMap CheckMapOf(const MeshInput& input, const CornerUv& uv, const MapCheckOptions& options,
                      const Execution& execution) {
  return CheckTriangles(input, uv, options, execution, [](std::size_t) { return true; });
}

}  // namespace planish::cli
