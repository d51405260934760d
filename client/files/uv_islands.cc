#include "client/files/uv_islands.h"

#include <algorithm>
#include <array>
#include <utility>

#include "core/mesh/half_edges.h"

namespace planish {
namespace {

// Position first. -0 becomes 0, so that comparing numbers and comparing places is the same.
using Place = std::array<double, 5>;

void FindPlaces(const Mesh& mesh, const std::vector<double>& uv, UvIslands* islands) {
  const std::size_t num_corners = 3 * mesh.faces.size();
  std::vector<std::pair<Place, std::int32_t>> places(num_corners);
  for (std::size_t c = 0; c < num_corners; ++c) {
    const Vec3& p = mesh.positions[mesh.faces[c / 3][c % 3]];
    places[c] = {{p.x() + 0.0, p.y() + 0.0, p.z() + 0.0, uv[2 * c] + 0.0, uv[2 * c + 1] + 0.0},
                 static_cast<std::int32_t>(c)};
  }
  std::sort(places.begin(), places.end());
  islands->place_of_corner.resize(num_corners);
  for (std::size_t i = 0; i < num_corners; ++i) {
    if (i > 0 && places[i].first != places[i - 1].first) ++islands->num_places;
    islands->place_of_corner[places[i].second] = islands->num_places;
  }
  if (num_corners > 0) ++islands->num_places;
}

// Faces that are one place have no edge: they go with the first face that has more than it, or else with each other.
void JoinPointFaces(const std::vector<std::int32_t>& place, std::int32_t num_places, UnionFind* sets) {
  const auto num_faces = static_cast<std::int32_t>(place.size() / 3);
  const auto is_point = [&](std::int32_t f) {
    return place[3 * f] == place[3 * f + 1] && place[3 * f] == place[3 * f + 2];
  };
  std::vector<std::int32_t> face_at(num_places, -1);
  for (const bool points : {false, true}) {
    for (std::int32_t f = 0; f < num_faces; ++f) {
      if (is_point(f) != points) continue;
      for (std::int32_t c = 3 * f; c < 3 * f + 3; ++c) {
        if (face_at[place[c]] < 0) face_at[place[c]] = f;
      }
      if (points) sets->Join(f, face_at[place[3 * f]]);
    }
  }
}

struct Edge {
  std::int32_t low, high, half_edge;
  auto operator<=>(const Edge&) const = default;
};

}  // namespace

UvIslands FindUvIslands(const Mesh& mesh, const std::vector<double>& uv, const std::vector<std::int64_t>& polygon) {
  UvIslands islands;
  FindPlaces(mesh, uv, &islands);
  std::vector<Edge> edges;
  edges.reserve(3 * mesh.faces.size());
  for (std::int32_t c = 0; c < static_cast<std::int32_t>(3 * mesh.faces.size()); ++c) {
    const std::int32_t f = c - c % 3;
    const auto [low, high] =
        std::minmax(islands.place_of_corner[f + Next(c % 3)], islands.place_of_corner[f + Prev(c % 3)]);
    if (low != high) edges.push_back({low, high, c});
  }
  std::sort(edges.begin(), edges.end());

  UnionFind sets(mesh.faces.size());
  islands.is_outline.assign(3 * mesh.faces.size(), 0);
  for (auto begin = edges.begin(), end = begin; begin != edges.end(); begin = end) {
    end = std::find_if(begin, edges.end(), [&](const Edge& e) { return e.low != begin->low || e.high != begin->high; });
    islands.is_outline[begin->half_edge] = end - begin == 1;
    for (auto other = begin + 1; other != end; ++other) sets.Join(begin->half_edge / 3, other->half_edge / 3);
  }
  JoinPointFaces(islands.place_of_corner, islands.num_places, &sets);
  for (std::size_t f = 1; f < polygon.size(); ++f) {
    if (polygon[f] == polygon[f - 1]) sets.Join(static_cast<std::int32_t>(f - 1), static_cast<std::int32_t>(f));
  }
  islands.island_of_face.resize(mesh.faces.size());
  for (std::int32_t f = 0; f < static_cast<std::int32_t>(mesh.faces.size()); ++f) {
    const std::int32_t root = sets.Find(f);
    islands.island_of_face[f] = root == f ? islands.count++ : islands.island_of_face[root];
  }
  return islands;
}

}  // namespace planish
