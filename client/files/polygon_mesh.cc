#include "client/files/polygon_mesh.h"

#include <algorithm>
#include <bit>
#include <iterator>
#include <numeric>
#include <set>
#include <tuple>

#include "client/files/ear_clipping.h"
#include "core/mesh/half_edges.h"

namespace planish {

namespace {

// The corners of a polygon whose vertex differs from that of the corner before; all corners if fewer than three would
// remain.
std::vector<std::int64_t> DifferentCorners(const PolygonMesh& polygons, std::int64_t begin, std::int64_t end) {
  const auto& vertex = polygons.corner_vertex;
  std::vector<std::int64_t> corners;
  for (std::int64_t c = begin; c < end; ++c) {
    if (corners.empty() || vertex[c] != vertex[corners.back()]) corners.push_back(c);
  }
  while (corners.size() > 1 && vertex[corners.front()] == vertex[corners.back()]) corners.pop_back();
  if (corners.size() >= 3) return corners;
  corners.resize(static_cast<std::size_t>(end - begin));
  std::iota(corners.begin(), corners.end(), begin);
  return corners;
}

// Appends the corners of [begin, end) that are not in `corners`, each with the neighbour that has the same vertex.
void AppendRepeated(const PolygonMesh& polygons, std::int64_t begin, std::int64_t end,
                    const std::vector<std::int64_t>& corners, std::vector<std::array<std::int64_t, 2>>* repeated) {
  std::size_t next = 0;
  for (std::int64_t c = begin; c < end; ++c) {
    if (next < corners.size() && corners[next] == c) {
      ++next;
    } else {
      const std::int64_t before = corners[next == 0 ? corners.size() - 1 : next - 1];
      const bool is_before = polygons.corner_vertex[c] == polygons.corner_vertex[before];
      repeated->push_back({c, is_before ? before : corners[next % corners.size()]});
    }
  }
}

bool Revisits(const PolygonMesh& polygons, const std::vector<std::int64_t>& corners) {
  std::vector<std::int32_t> vertices;
  for (const std::int64_t c : corners) vertices.push_back(polygons.corner_vertex[c]);
  std::sort(vertices.begin(), vertices.end());
  return std::adjacent_find(vertices.begin(), vertices.end()) != vertices.end();
}

// Per face of [begin, end), its group, which is named by the number of one of its faces minus `begin`. Joins faces over
// diagonals as long as no two corners of a group have the same vertex.
std::vector<std::int32_t> GroupsThatVisitOnce(const Triangulation& triangles, std::int64_t begin, std::int64_t end) {
  const auto count = static_cast<std::size_t>(end - begin);
  UnionFind groups(count);
  std::vector<std::set<std::int32_t>> vertices(count);
  for (std::size_t f = 0; f < count; ++f) {
    const Face& face = triangles.mesh.faces[static_cast<std::size_t>(begin) + f];
    vertices[f] = {face.begin(), face.end()};
  }
  const auto first = static_cast<std::int32_t>(3 * begin);
  for (const auto& [c, d] : Diagonals(triangles, begin, end)) {
    const std::int32_t a = groups.Find((c - first) / 3), b = groups.Find((d - first) / 3);
    if (a == b) continue;
    std::set<std::int32_t>*larger = &vertices[a], *smaller = &vertices[b];
    if (larger->size() < smaller->size()) std::swap(larger, smaller);
    const auto is_common = [&](std::int32_t v) { return larger->count(v) > 0; };
    if (std::count_if(smaller->begin(), smaller->end(), is_common) != 2) continue;  // more than the diagonal's ends
    larger->merge(*smaller);
    groups.Join(a, b);
    if (larger != &vertices[std::min(a, b)]) std::swap(vertices[a], vertices[b]);
  }
  std::vector<std::int32_t> group(count);
  for (std::size_t f = 0; f < count; ++f) group[f] = groups.Find(static_cast<std::int32_t>(f));
  return group;
}

}  // namespace

std::vector<std::array<std::int32_t, 2>> Diagonals(const Triangulation& triangles, std::int64_t begin,
                                                   std::int64_t end) {
  struct Side {
    std::int64_t low, high;  // corners of the polygon
    std::int32_t half_edge;
  };
  std::vector<Side> sides;
  std::vector<std::array<std::int32_t, 2>> diagonals;
  if (end - begin < 2) return diagonals;
  for (std::int64_t c = 3 * begin; c < 3 * end; ++c) {
    const std::int64_t a = triangles.corner_of_triangle[FlatLinks::Next(static_cast<std::int32_t>(c))];
    const std::int64_t b = triangles.corner_of_triangle[FlatLinks::Prev(static_cast<std::int32_t>(c))];
    sides.push_back({std::min(a, b), std::max(a, b), static_cast<std::int32_t>(c)});
  }
  std::sort(sides.begin(), sides.end(), [](const Side& a, const Side& b) {
    return std::tie(a.low, a.high, a.half_edge) < std::tie(b.low, b.high, b.half_edge);
  });
  for (std::size_t i = 1; i < sides.size(); ++i) {
    if (sides[i].low != sides[i - 1].low || sides[i].high != sides[i - 1].high) continue;
    diagonals.push_back({sides[i - 1].half_edge, sides[i].half_edge});
  }
  return diagonals;
}

Triangulation Triangulate(const PolygonMesh& polygons) {
  constexpr std::int32_t kUnused = -1;
  Triangulation result;
  std::vector<std::int32_t> new_vertex(polygons.positions.size(), kUnused);
  for (const std::int32_t vertex : polygons.corner_vertex) new_vertex[vertex] = 0;
  for (std::size_t vertex = 0; vertex < new_vertex.size(); ++vertex) {
    if (new_vertex[vertex] == kUnused) continue;
    new_vertex[vertex] = static_cast<std::int32_t>(result.mesh.num_vertices());
    result.mesh.positions.push_back(polygons.positions[vertex]);
    result.source_vertex.push_back(static_cast<std::int32_t>(vertex));
  }

  std::int32_t pieces = 0;
  std::vector<Vec3> outline;
  std::vector<std::int64_t> corners;
  for (std::int64_t polygon = 0; polygon < polygons.num_polygons(); ++polygon) {
    const std::int64_t first = polygons.polygon_begin[polygon];
    const std::int64_t end = polygons.polygon_begin[polygon + 1];
    const auto first_face = static_cast<std::int64_t>(result.mesh.faces.size());
    corners = DifferentCorners(polygons, first, end);
    AppendRepeated(polygons, first, end, corners, &result.repeated_corners);
    outline.clear();
    for (const std::int64_t c : corners) outline.push_back(polygons.positions[polygons.corner_vertex[c]]);
    for (const Face& triangle : TrianglesOfPolygon(outline)) {
      Face face;
      for (int k = 0; k < 3; ++k) {
        const std::int64_t source = corners[triangle[k]];
        face[k] = new_vertex[polygons.corner_vertex[source]];
        result.corner_of_triangle.push_back(source);
      }
      result.mesh.faces.push_back(face);
      result.source_polygon.push_back(polygon);
    }
    const auto end_face = static_cast<std::int64_t>(result.mesh.faces.size());
    if (corners.size() > 3 && Revisits(polygons, corners)) {
      result.faulty.emplace_back(polygon, PolygonFault::kRevisits);
      const std::vector<std::int32_t> group = GroupsThatVisitOnce(result, first_face, end_face);
      std::vector<std::int32_t> number = group;
      const std::int32_t count = NumberByFirst(group.size(), &number);
      for (const std::int32_t n : number) result.piece.push_back(pieces + n);
      pieces += count;
    } else if (CrossesItself(outline)) {
      result.faulty.emplace_back(polygon, PolygonFault::kCrossesItself);
      for (std::int64_t f = first_face; f < end_face; ++f) result.piece.push_back(pieces++);
    } else {
      result.piece.insert(result.piece.end(), static_cast<std::size_t>(end_face - first_face), pieces);
      ++pieces;
    }
  }
  return result;
}

std::size_t ValueIndex::Hash::operator()(const Key& key) const {
  std::uint64_t hash = 0;
  for (const std::uint64_t word : key) {
    hash = (hash ^ word) * 0x9E3779B97F4A7C15u;
    hash ^= hash >> 32;
  }
  return hash;
}

std::int32_t ValueIndex::Add(const Vec3& value) {
  Key key;
  for (int axis = 0; axis < 3; ++axis) key[axis] = std::bit_cast<std::uint64_t>(value[axis] + 0.0);
  return ids_.emplace(key, size()).first->second;
}

std::int32_t TexcoordTable::Add(double u, double v) {
  const std::int32_t id = ids_.Add(Vec3(u, v, 0));
  if (id == static_cast<std::int32_t>(values_.size())) values_.emplace_back(u, v);
  return id;
}

}  // namespace planish
