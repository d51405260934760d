#include "core/mesh/import.h"

#include <algorithm>
#include <cmath>
#include <compare>
#include <limits>
#include <span>
#include <utility>

#include "Eigen/Geometry"
#include "core/base/radix_sort.h"
#include "core/mesh/angles.h"
#include "core/mesh/half_edges.h"
#include "core/mesh/tri_mesh.h"

namespace planish {
namespace {

FaceKind KindOf(const Mesh& mesh, const Face& face) {
  const auto& [a, b, c] = face;
  if (!mesh.IsInRange(face)) return FaceKind::kOutOfRange;
  if (a == b || b == c || c == a) return FaceKind::kRepeatingAVertex;
  const Vec3 &p = mesh.positions[a], &q = mesh.positions[b], &r = mesh.positions[c];
  if (!p.allFinite() || !q.allFinite() || !r.allFinite()) return FaceKind::kNotFinite;
  if (p == q && q == r) return FaceKind::kInOnePoint;
  return IsDegenerateTriangle(p, q, r) ? FaceKind::kWithoutArea : FaceKind::kWithArea;
}

// Per face, the number of earlier faces with the same three vertices.
std::vector<std::int32_t> Layers(const std::vector<Face>& faces) {
  std::vector<std::int32_t> layer(faces.size(), 0);
  std::vector<Face> keys = faces;
  for (Face& key : keys) std::sort(key.begin(), key.end());
  const std::vector<std::int32_t> order =
      SortedIndices(faces.size(), [&](std::int32_t f, std::int32_t g) { return keys[f] < keys[g]; });
  for (std::size_t i = 1; i < order.size(); ++i) {
    if (keys[order[i]] == keys[order[i - 1]]) layer[order[i]] = layer[order[i - 1]] + 1;
  }
  return layer;
}

// Whether some face may be a copy: two faces at one edge have the same third vertex.
bool MayHaveCopies(const std::vector<Face>& faces, const EdgeGroups& edges, const Execution& execution) {
  return execution.Count(edges.count(), [&](std::int64_t e) {
    const std::span<const std::int32_t> at = edges[static_cast<std::int32_t>(e)];
    return at.size() > 2 || (at.size() == 2 && faces[at[0] / 3][at[0] % 3] == faces[at[1] / 3][at[1] % 3]);
  }) > 0;
}

// The unit normal of the face at half-edge c; zero if the face has no area.
Vec3 UnitNormal(const Mesh& mesh, std::int32_t c) {
  const auto& [i, j, k] = mesh.faces[c / 3];
  const Vec3 u = (mesh.positions[j] - mesh.positions[i]).stableNormalized();
  const Vec3 v = (mesh.positions[k] - mesh.positions[i]).stableNormalized();
  const Vec3 normal = u.cross(v).stableNormalized();
  return normal.allFinite() && normal.squaredNorm() > 0.5 ? normal : Vec3(Vec3::Zero());
}

void Join(std::int32_t c, std::int32_t d, Pairing* pairing) {
  pairing->opposite[c] = d;
  pairing->opposite[d] = c;
}

// Two half-edges in opposite directions, at an edge of more than two faces, that might be joined. Pairs are joined in
// ascending order.
struct Pair {
  std::int64_t bend;  // 0: flat, growing up to folded; larger if one face has no area
  bool is_reflex;     // whether the faces turn towards each other on the side of their normals
  int neighbours;     // of the two faces: 6 minus the number of edges without another face
  std::int32_t forth, back;

  auto operator<=>(const Pair&) const = default;
};

// Joins pairs of half-edges where more than two faces meet, those that bend least first. If bends are equal, as where
// two boxes touch along an edge, pairs that enclose a solid come first, then pairs of faces with fewer neighbours: a
// flap that lies on another face has nothing else to be joined to. Remaining ties are broken by number. So a sheet
// continues through an edge where others meet it, and boxes stay boxes. Bends are rounded, so that rigid motion and
// scale change nothing. Faces without area have no direction and are joined last. `open_edges`: per face.
void JoinFlattest(const Mesh& mesh, std::span<const std::int32_t> at, const std::vector<char>& open_edges,
                  Pairing* pairing) {
  constexpr double kBendUnit = 1e-6;
  constexpr std::int64_t kUnknownBend = 4'000'000;  // beyond 2 / kBendUnit
  std::vector<Vec3> normal;
  for (const std::int32_t c : at) normal.push_back(UnitNormal(mesh, c));
  const std::int32_t from = Origin(mesh.faces, at[0]), to = Target(mesh.faces, at[0]);
  const Vec3 along = (mesh.positions[to] - mesh.positions[from]).stableNormalized();
  std::vector<Pair> pairs;
  for (std::size_t i = 0; i < at.size(); ++i) {
    if (Origin(mesh.faces, at[i]) != from) continue;
    for (std::size_t j = 0; j < at.size(); ++j) {
      if (Origin(mesh.faces, at[j]) == from) continue;
      const bool is_known = !normal[i].isZero(0) && !normal[j].isZero(0);
      const double cosine = normal[i].dot(normal[j]), sine = normal[i].cross(normal[j]).dot(along);
      pairs.push_back({is_known ? std::llround((1 - cosine) / kBendUnit) : kUnknownBend,
                       is_known && std::llround(sine / kBendUnit) < 0,
                       6 - open_edges[at[i] / 3] - open_edges[at[j] / 3], at[i], at[j]});
    }
  }
  std::sort(pairs.begin(), pairs.end());
  for (const Pair& pair : pairs) {
    if (pairing->opposite[pair.forth] >= 0 || pairing->opposite[pair.back] >= 0) continue;
    Join(pair.forth, pair.back, pairing);
  }
}

// Joins the half-edges of `at`, all on one edge, that are the two sides of a diagonal of a polygon, and removes them
// from `at`.
void JoinDiagonals(const Mesh& mesh, std::span<const std::int32_t> polygon, std::vector<std::int32_t>* at,
                   Pairing* pairing) {
  if (at->size() == 2) {
    const std::int32_t c = at->front(), d = at->back();
    if (polygon[c / 3] != polygon[d / 3] || Origin(mesh.faces, c) == Origin(mesh.faces, d)) return;
    Join(c, d, pairing);
    at->clear();
    return;
  }
  // Sorts by polygon, since thousands of faces may share an edge. Half-edges of a polygon stay ascending.
  std::vector<std::int32_t> sorted = *at;
  std::stable_sort(sorted.begin(), sorted.end(),
                   [&](std::int32_t c, std::int32_t d) { return polygon[c / 3] < polygon[d / 3]; });
  bool any = false;
  for (std::size_t begin = 0, end; begin < sorted.size(); begin = end) {
    end = begin + 1;
    while (end < sorted.size() && polygon[sorted[end] / 3] == polygon[sorted[begin] / 3]) ++end;
    std::vector<std::int32_t> waiting;  // all run along the edge in the same direction
    for (std::size_t i = begin; i < end && end - begin > 1; ++i) {
      const std::int32_t c = sorted[i];
      if (waiting.empty() || Origin(mesh.faces, waiting.back()) == Origin(mesh.faces, c)) {
        waiting.push_back(c);
        continue;
      }
      Join(waiting.back(), c, pairing);
      waiting.pop_back();
      any = true;
    }
  }
  if (any) std::erase_if(*at, [&](std::int32_t c) { return pairing->opposite[c] >= 0; });
}

// Decides which of the half-edges at one edge, all of one layer, are joined: only those that run along the edge in
// opposite directions, since charts end where orientations disagree. Leaves edges of more than two half-edges to
// JoinFlattest().
void JoinAtEdge(const Mesh& mesh, std::span<const std::int32_t> at, Pairing* pairing) {
  if (at.size() < 2) return;
  if (at.size() > 2) {
    pairing->non_manifold.emplace_back(at.begin(), at.end());
  } else if (Origin(mesh.faces, at[0]) != Target(mesh.faces, at[1])) {
    pairing->inconsistent.push_back({at[0], at[1]});
  } else {
    Join(at[0], at[1], pairing);
  }
}

}  // namespace

Pairing PairHalfEdges(const Mesh& mesh, JoinFor purpose, const Execution& execution,
                      std::span<const std::int32_t> polygon) {
  Pairing pairing;
  pairing.kind.resize(mesh.faces.size());
  std::vector<char> is_joined(mesh.faces.size());
  execution.ForEach(mesh.num_faces(), [&](std::int64_t f) {
    const FaceKind kind = pairing.kind[f] = KindOf(mesh, mesh.faces[f]);
    is_joined[f] = kind == FaceKind::kWithArea || kind == FaceKind::kNotFinite ||
                   (kind == FaceKind::kWithoutArea && purpose == JoinFor::kCharts);
  });
  pairing.opposite.assign(3 * mesh.faces.size(), -1);
  const EdgeGroups edges = GroupHalfEdges(mesh.faces, mesh.num_vertices(), execution, is_joined);
  if (execution.IsCancelled()) return pairing;
  const bool all_joined = std::find(is_joined.begin(), is_joined.end(), 0) == is_joined.end();
  if (!all_joined || MayHaveCopies(mesh.faces, edges, execution)) pairing.layer = Layers(mesh.faces);
  const auto layer = [&](std::int32_t c) { return pairing.layer.empty() ? 0 : pairing.layer[c / 3]; };
  std::vector<std::int32_t> at;
  std::vector<char> open_edges(mesh.faces.size(), 0);
  for (std::int32_t e = 0; e < edges.count() && !execution.IsCancelledAt(e); ++e) {
    at.assign(edges[e].begin(), edges[e].end());
    if (!polygon.empty() && at.size() > 1) {
      JoinDiagonals(mesh, polygon, &at, &pairing);
      for (const std::int32_t c : edges[e]) pairing.edges += pairing.opposite[c] > c && layer(c) == 0;
    }
    if (at.size() > 2) std::stable_sort(at.begin(), at.end(), [&](auto c, auto d) { return layer(c) < layer(d); });
    for (std::size_t begin = 0, end; begin < at.size(); begin = end) {
      end = begin + 1;
      while (end < at.size() && layer(at[end]) == layer(at[begin])) ++end;
      if (layer(at[begin]) == 0) {
        ++pairing.edges;
        pairing.boundary_edges += end - begin == 1;
      }
      if (end - begin == 1) ++open_edges[at[begin] / 3];
      JoinAtEdge(mesh, std::span(at).subspan(begin, end - begin), &pairing);
    }
  }
  if (purpose == JoinFor::kDiagnosis) return pairing;
  // At an edge of more than two half-edges, as many pairs as possible are joined, unless there are too many for a
  // surface.
  for (std::int64_t e = 0; e < std::ssize(pairing.non_manifold) && !execution.IsCancelledAt(e); ++e) {
    const std::vector<std::int32_t>& many = pairing.non_manifold[e];
    if (many.size() <= kMostFacesAtAnEdge) JoinFlattest(mesh, many, open_edges, &pairing);
  }
  return pairing;
}

namespace {

// Renumbers vertices in the order of their sources.
void SortBySource(std::int64_t num_sources, FlatImport* flat) {
  const auto bucket = [&](std::int32_t v) {
    const std::int32_t source = flat->source[v];
    return static_cast<std::int32_t>(source < 0 || source >= num_sources ? num_sources : source);
  };
  const auto n = static_cast<std::int32_t>(flat->source.size());
  const std::vector<std::int32_t> order = GroupByKey(n, num_sources + 1, bucket).item;
  std::vector<std::int32_t> number(n), sorted(n);
  for (std::int32_t v = 0; v < n; ++v) {
    number[order[v]] = v;
    sorted[v] = flat->source[order[v]];
  }
  for (Face& face : flat->mesh.faces) {
    for (std::int32_t& v : face) v = number[v];
  }
  flat->source = std::move(sorted);
}

Vec3 PositionOf(std::int32_t source, const std::vector<Vec3>& positions) {
  const bool exists = source >= 0 && source < std::ssize(positions);
  return exists ? positions[source] : Vec3(Vec3::Constant(std::numeric_limits<double>::quiet_NaN()));
}

}  // namespace

FlatImport ImportFlat(const Mesh& mesh, std::vector<std::int32_t> opposite) {
  FlatImport flat;
  flat.mesh.faces = FacesOfFans(opposite, [&](std::int32_t c) { flat.source.push_back(mesh.faces[c / 3][c % 3]); });
  SortBySource(mesh.num_vertices(), &flat);
  flat.mesh.positions.reserve(flat.source.size());
  for (const std::int32_t source : flat.source) flat.mesh.positions.push_back(PositionOf(source, mesh.positions));
  flat.mesh.opposite = std::move(opposite);
  return flat;
}

// Sets all handles directly, since add_face() would search for edges that are known here.
TriMesh ImportMesh(const Mesh& mesh, const std::vector<std::int32_t>& opposite) {
  const auto [flat, source] = ImportFlat(mesh, opposite);
  const auto num_corners = static_cast<std::int32_t>(opposite.size());
  std::vector<std::int32_t> half_edge(num_corners);
  std::int32_t num_edges = 0;
  for (std::int32_t c = 0; c < num_corners; ++c) {
    const std::int32_t o = opposite[c];
    half_edge[c] = o >= 0 && o < c ? half_edge[o] + 1 : 2 * num_edges++;
  }
  // OpenMesh would report on stderr what callers detect themselves.
  [[maybe_unused]] static const bool is_silent = (omerr().disable(), true);
  TriMesh linked;
  linked.resize(source.size(), num_edges, num_corners / 3);
  for (std::int32_t v = 0; v < static_cast<std::int32_t>(source.size()); ++v) {
    linked.set_point(VertexHandle(v), flat.positions[v]);
    linked.data(VertexHandle(v)).source = source[v];
  }
  for (std::int32_t f = 0; f < num_corners / 3; ++f) {
    linked.set_halfedge_handle(FaceHandle(f), HalfedgeHandle(half_edge[3 * f]));
  }
  for (std::int32_t c = 0; c < num_corners; ++c) {
    const HalfedgeHandle h(half_edge[c]), next(half_edge[FlatLinks::Next(c)]);
    const VertexHandle from(Origin(flat.faces, c)), to(Target(flat.faces, c));
    linked.set_face_handle(h, FaceHandle(c / 3));
    linked.set_vertex_handle(h, to);
    linked.set_next_halfedge_handle(h, next);
    if (!linked.halfedge_handle(from).is_valid()) linked.set_halfedge_handle(from, h);
    if (opposite[c] >= 0) continue;
    const HalfedgeHandle outside = linked.opposite_halfedge_handle(h);
    linked.set_boundary(outside);
    linked.set_vertex_handle(outside, from);
    linked.set_halfedge_handle(to, outside);
  }
  for (std::int32_t c = 0; c < num_corners; ++c) {
    if (opposite[c] >= 0) continue;
    const HalfedgeHandle outside = linked.opposite_halfedge_handle(HalfedgeHandle(half_edge[c]));
    linked.set_next_halfedge_handle(outside, linked.halfedge_handle(linked.to_vertex_handle(outside)));
  }
  return linked;
}

}  // namespace planish
