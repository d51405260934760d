#include "client/files/uv_islands.h"

#include <algorithm>
#include <array>
#include <compare>
#include <numeric>
#include <span>
#include <utility>

#include "core/mesh/diagnosis.h"

namespace planish {
namespace {

// Per vertex the number of its position, in [0, num_vertices); equal positions have the same. -1: unused vertex.
std::vector<std::int32_t> NumberPositions(const Mesh& mesh) {
  const std::vector<char> is_used = UsedVertices(mesh);
  // Adding 0 turns -0 into 0, so that equal numbers have equal bits.
  std::vector<std::pair<std::array<double, 3>, std::int32_t>> positions;
  for (std::size_t v = 0; v < mesh.positions.size(); ++v) {
    const Vec3& p = mesh.positions[v];
    if (is_used[v]) positions.push_back({{p.x() + 0.0, p.y() + 0.0, p.z() + 0.0}, static_cast<std::int32_t>(v)});
  }
  std::sort(positions.begin(), positions.end());
  std::vector<std::int32_t> number(mesh.positions.size(), -1);
  std::int32_t last = -1;
  for (std::size_t i = 0; i < positions.size(); ++i) {
    if (i == 0 || positions[i].first != positions[i - 1].first) ++last;
    number[positions[i].second] = last;
  }
  return number;
}

// Fills place_of_corner: groups corners by the number of their position (counting sort), and sorts each group by UV.
void FindPlaces(const Mesh& mesh, const std::vector<double>& uv, UvIslands* islands) {
  struct At {
    double u, v;
    std::int32_t corner;
    auto operator<=>(const At&) const = default;
  };
  const std::size_t num_corners = 3 * mesh.faces.size();
  const std::vector<std::int32_t> position = NumberPositions(mesh);
  const auto position_of = [&](std::size_t c) { return position[mesh.faces[c / 3][c % 3]]; };
  std::vector<std::int32_t> begin(mesh.positions.size() + 1, 0);
  for (std::size_t c = 0; c < num_corners; ++c) ++begin[position_of(c) + 1];
  std::partial_sum(begin.begin(), begin.end(), begin.begin());
  std::vector<At> corners(num_corners);
  std::vector<std::int32_t> next(begin.begin(), begin.end() - 1);
  for (std::size_t c = 0; c < num_corners; ++c) {
    corners[next[position_of(c)]++] = {uv[2 * c] + 0.0, uv[2 * c + 1] + 0.0, static_cast<std::int32_t>(c)};
  }
  islands->place_of_corner.resize(num_corners);
  for (std::size_t p = 0; p + 1 < begin.size(); ++p) {
    std::sort(corners.begin() + begin[p], corners.begin() + begin[p + 1]);
    for (std::int32_t i = begin[p]; i < begin[p + 1]; ++i) {
      const At& at = corners[i];
      if (i == begin[p] || at.u != corners[i - 1].u || at.v != corners[i - 1].v) ++islands->num_places;
      islands->place_of_corner[at.corner] = islands->num_places - 1;
    }
  }
}

// Faces whose corners coincide have no edges: joins them with the first larger face at that place, or else with each
// other.
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

}  // namespace

UvIslands FindUvIslands(const Mesh& mesh, const std::vector<double>& uv, const std::vector<std::int64_t>& polygon) {
  UvIslands islands;
  FindPlaces(mesh, uv, &islands);
  std::vector<Face> faces(mesh.faces.size());
  for (std::size_t c = 0; c < 3 * faces.size(); ++c) faces[c / 3][c % 3] = islands.place_of_corner[c];
  islands.edges = GroupHalfEdges(faces, islands.num_places);

  UnionFind sets(mesh.faces.size());
  islands.is_outline.assign(3 * mesh.faces.size(), 0);
  for (std::int32_t e = 0; e < islands.edges.count(); ++e) {
    const std::span<const std::int32_t> at = islands.edges[e];
    if (Origin(faces, at[0]) == Target(faces, at[0])) continue;
    islands.is_outline[at[0]] = at.size() == 1;
    for (const std::int32_t other : at.subspan(1)) sets.Join(at[0] / 3, other / 3);
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
