#include <algorithm>
#include <map>

#include "client/files/ear_clipping.h"
#include "client/files/polygon_mesh.h"
#include "core/mesh/half_edges.h"

namespace planish {
namespace {

using TriangleCorners = std::vector<std::int32_t>;  // corner k of triangle f is 3 f + k

// The triangles of a file with their UV in a map.
class MappedTriangles {
 public:
  MappedTriangles(const PolygonMesh& polygons, const Triangulation& triangles, const double* uv)
      : polygons_(polygons), triangles_(triangles), uv_(uv) {}

  std::int64_t PolygonCorner(std::int32_t c) const {
    return triangles_.corner_of_triangle[static_cast<std::size_t>(c)];
  }
  const double* Uv(std::int32_t c) const { return uv_ + 2 * static_cast<std::ptrdiff_t>(c); }

  // Whether the triangle is in no chart, because it repeats a vertex or its corners coincide.
  bool IsVoid(std::int32_t f) const {
    std::array<std::int32_t, 3> v;
    for (int k = 0; k < 3; ++k) v[k] = polygons_.corner_vertex[PolygonCorner(3 * f + k)];
    if (v[0] == v[1] || v[1] == v[2] || v[2] == v[0]) return true;
    const Vec3& p = polygons_.positions[v[0]];
    return p == polygons_.positions[v[1]] && p == polygons_.positions[v[2]];
  }

  // The faces that replace the torn polygon of triangles [begin, end).
  std::vector<TriangleCorners> PartsOf(std::int32_t begin, std::int32_t end) const {
    UnionFind groups(static_cast<std::size_t>(end - begin));
    const std::vector<std::array<std::int32_t, 2>> diagonals = Diagonals(triangles_, begin, end);
    for (const auto& [c, d] : diagonals) {
      if (!IsVoid(c / 3) && !IsVoid(d / 3) && IsWhole(c, d)) groups.Join(c / 3 - begin, d / 3 - begin);
    }
    std::map<std::int32_t, std::vector<std::int32_t>> members;
    for (std::int32_t f = begin; f < end; ++f) members[groups.Find(f - begin)].push_back(f);
    std::vector<TriangleCorners> parts;
    for (const auto& [root, faces] : members) AppendParts(faces, &parts);
    return parts;
  }

 private:
  bool SameUv(std::int32_t c, std::int32_t d) const { return Uv(c)[0] == Uv(d)[0] && Uv(c)[1] == Uv(d)[1]; }

  bool IsWhole(std::int32_t c, std::int32_t d) const {
    return SameUv(FlatLinks::Next(c), FlatLinks::Prev(d)) && SameUv(FlatLinks::Prev(c), FlatLinks::Next(d));
  }

  // Appends one face if readers will cut it into the same triangles; otherwise one face for each triangle.
  void AppendParts(const std::vector<std::int32_t>& faces, std::vector<TriangleCorners>* parts) const {
    if (TriangleCorners outline = OutlineOf(faces); IsCutInto(outline, faces)) {
      parts->push_back(std::move(outline));
      return;
    }
    for (const std::int32_t f : faces) parts->push_back({3 * f, 3 * f + 1, 3 * f + 2});
  }

  // The outline of triangles connected over diagonals, from the lowest corner of the polygon on. Empty if it passes
  // through a corner twice.
  TriangleCorners OutlineOf(const std::vector<std::int32_t>& faces) const {
    std::map<std::pair<std::int64_t, std::int64_t>, int> sides;
    const auto edge = [&](std::int32_t c) {
      const std::int64_t from = PolygonCorner(FlatLinks::Next(c)), to = PolygonCorner(FlatLinks::Prev(c));
      return std::pair(std::min(from, to), std::max(from, to));
    };
    const auto for_each = [&](const auto& visit) {
      for (const std::int32_t f : faces) {
        for (std::int32_t c = 3 * f; c < 3 * f + 3; ++c) visit(c);
      }
    };
    for_each([&](std::int32_t c) { ++sides[edge(c)]; });
    std::map<std::int64_t, std::int32_t> leaving;  // by corner of the polygon: the half-edge that starts there
    std::size_t open = 0;
    for_each([&](std::int32_t c) {
      if (sides[edge(c)] > 1) return;
      leaving[PolygonCorner(FlatLinks::Next(c))] = c;
      ++open;
    });
    TriangleCorners outline;
    for (auto at = leaving.begin(); at != leaving.end() && outline.size() < open;) {
      const std::int32_t c = at->second;
      outline.push_back(FlatLinks::Next(c));
      at = leaving.find(PolygonCorner(FlatLinks::Prev(c)));
    }
    if (leaving.size() != open || outline.size() != open) outline.clear();
    return outline;
  }

  bool IsCutInto(const TriangleCorners& outline, const std::vector<std::int32_t>& faces) const {
    if (outline.size() < 3 || outline.size() != faces.size() + 2) return false;
    using Triangle = std::array<std::int64_t, 3>;
    const auto sorted = [&](std::int32_t c, std::int32_t d, std::int32_t e) {
      Triangle triangle = {PolygonCorner(c), PolygonCorner(d), PolygonCorner(e)};
      std::sort(triangle.begin(), triangle.end());
      return triangle;
    };
    std::vector<Vec3> points;
    for (const std::int32_t c : outline)
      points.push_back(polygons_.positions[polygons_.corner_vertex[PolygonCorner(c)]]);
    std::vector<Triangle> made, wanted;
    for (const auto& [i, j, k] : TrianglesOfPolygon(points)) made.push_back(sorted(outline[i], outline[j], outline[k]));
    for (const std::int32_t f : faces) wanted.push_back(sorted(3 * f, 3 * f + 1, 3 * f + 2));
    std::sort(made.begin(), made.end());
    std::sort(wanted.begin(), wanted.end());
    return made == wanted;
  }

  const PolygonMesh& polygons_;
  const Triangulation& triangles_;
  const double* uv_;
};

}  // namespace

PolygonUv UvOfPolygons(const PolygonMesh& polygons, const Triangulation& triangles, const double* uv) {
  const MappedTriangles mapped(polygons, triangles, uv);
  const auto num_faces = static_cast<std::int32_t>(triangles.source_polygon.size());
  PolygonUv result;
  result.corner_uv.assign(2 * polygons.corner_vertex.size(), 0.0);
  const auto at_corner = [&](std::int64_t corner) { return result.corner_uv.begin() + 2 * corner; };
  std::map<std::int64_t, std::vector<double>> torn_uv;  // by polygon, for the corners of its parts
  for (std::int32_t begin = 0, end; begin < num_faces; begin = end) {
    const std::int64_t polygon = triangles.source_polygon[static_cast<std::size_t>(begin)];
    end = begin + 1;
    while (end < num_faces && triangles.source_polygon[static_cast<std::size_t>(end)] == polygon) ++end;
    bool is_torn = false;
    for (const bool is_void : {true, false}) {  // triangles in no chart come first, and are overwritten
      for (std::int32_t f = begin; f < end; ++f) {
        if (end - begin > 1 && mapped.IsVoid(f) != is_void) continue;
        for (std::int32_t c = 3 * f; c < 3 * f + 3; ++c)
          std::copy_n(mapped.Uv(c), 2, at_corner(mapped.PolygonCorner(c)));
      }
    }
    if (end - begin == 1) continue;
    for (std::int32_t c = 3 * begin; c < 3 * end && !is_torn; ++c) {
      is_torn =
          !std::equal(mapped.Uv(c), mapped.Uv(c) + 2, at_corner(mapped.PolygonCorner(c))) && !mapped.IsVoid(c / 3);
    }
    if (!is_torn) continue;
    TornPolygon torn = {polygon, {}};
    std::vector<double>& own_uv = torn_uv[polygon];
    for (const TriangleCorners& part : mapped.PartsOf(begin, end)) {
      std::vector<std::int64_t>& face = torn.faces.emplace_back();
      for (const std::int32_t c : part) {
        face.push_back(mapped.PolygonCorner(c));
        own_uv.insert(own_uv.end(), mapped.Uv(c), mapped.Uv(c) + 2);
      }
    }
    result.torn.push_back(std::move(torn));
  }
  for (const auto& [corner, kept] : triangles.repeated_corners) std::copy_n(at_corner(kept), 2, at_corner(corner));
  if (result.torn.empty()) return result;
  std::vector<double> written;
  std::int64_t copied = 0;  // corners before it are in `written`, or belong to torn polygons
  const auto copy_until = [&](std::int64_t corner) {
    written.insert(written.end(), at_corner(copied), at_corner(corner));
  };
  for (const auto& [polygon, own_uv] : torn_uv) {
    copy_until(polygons.polygon_begin[polygon]);
    written.insert(written.end(), own_uv.begin(), own_uv.end());
    copied = polygons.polygon_begin[polygon + 1];
  }
  copy_until(polygons.polygon_begin.back());
  result.corner_uv = std::move(written);
  return result;
}

PolygonMesh WithTornPolygons(const PolygonMesh& polygons, const std::vector<TornPolygon>& torn) {
  PolygonMesh result = polygons;
  if (torn.empty()) return result;
  result.polygon_begin = {0};
  result.corner_vertex.clear();
  result.corner_file_vertex.clear();
  result.corner_texcoord.clear();
  for (auto* list : {&result.polygon_material, &result.polygon_group, &result.polygon_object}) list->clear();
  result.polygon_line.clear();
  const auto add = [](const auto& from, std::int64_t at, auto* to) {
    if (!from.empty()) to->push_back(from[static_cast<std::size_t>(at)]);
  };
  auto next = torn.begin();
  std::vector<std::int64_t> corners;
  for (std::int64_t p = 0; p < polygons.num_polygons(); ++p) {
    const bool is_torn = next != torn.end() && next->polygon == p;
    const std::size_t faces = is_torn ? next->faces.size() : 1;
    for (std::size_t f = 0; f < faces; ++f) {
      corners.clear();
      if (is_torn) corners = next->faces[f];
      for (std::int64_t c = polygons.polygon_begin[p]; !is_torn && c < polygons.polygon_begin[p + 1]; ++c)
        corners.push_back(c);
      for (const std::int64_t c : corners) {
        result.corner_vertex.push_back(polygons.corner_vertex[c]);
        add(polygons.corner_file_vertex, c, &result.corner_file_vertex);
        add(polygons.corner_texcoord, c, &result.corner_texcoord);
      }
      result.polygon_begin.push_back(static_cast<std::int64_t>(result.corner_vertex.size()));
      add(polygons.polygon_material, p, &result.polygon_material);
      add(polygons.polygon_group, p, &result.polygon_group);
      add(polygons.polygon_object, p, &result.polygon_object);
      add(polygons.polygon_line, p, &result.polygon_line);
    }
    next += is_torn;
  }
  return result;
}

}  // namespace planish
