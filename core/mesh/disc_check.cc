#include "core/mesh/disc_check.h"

#include <algorithm>
#include <cmath>
#include <map>
#include <numeric>
#include <set>
#include <string>
#include <utility>

#include "Eigen/Geometry"
#include "absl/strings/str_cat.h"
#include "absl/strings/str_join.h"
#include "core/base/error.h"
#include "core/base/status_macros.h"
#include "core/mesh/half_edges.h"
#include "core/mesh/rows.h"

namespace planish {
namespace {

constexpr std::size_t kMaxNamed = 16;     // elements in metadata
constexpr std::size_t kMaxInMessage = 4;  // elements in the message

template <typename T>
std::vector<T> FirstFew(const std::vector<T>& ids, std::size_t limit) {
  return {ids.begin(), ids.begin() + static_cast<std::ptrdiff_t>(std::min(limit, ids.size()))};
}

// "vertex 4", "vertices 4, 7", "vertices 4, 7, 9, 12 and 80 more".
template <typename T>
std::string Elements(const std::string& one, const std::string& many, const std::vector<T>& ids) {
  std::string text = absl::StrCat(ids.size() == 1 ? one : many, " ", absl::StrJoin(FirstFew(ids, kMaxInMessage), ", "));
  if (ids.size() > kMaxInMessage) absl::StrAppend(&text, " and ", ids.size() - kMaxInMessage, " more");
  return text;
}

using Metadata = std::map<std::string, std::string>;

template <typename T>
std::string IdList(const std::vector<T>& ids) {
  return absl::StrJoin(FirstFew(ids, kMaxNamed), ",");
}

absl::Status MeshFault(const std::string& reason, const std::string& message, std::size_t count, Metadata metadata) {
  metadata["count"] = std::to_string(count);
  return MakeError(absl::StatusCode::kInvalidArgument, reason, message, metadata);
}

// Those of [0, n) that fulfil `predicate`, ascending.
template <typename Index, typename Predicate>
std::vector<Index> Find(std::int64_t n, const Execution& execution, const Predicate& predicate) {
  std::vector<Index> found;
  for (const std::vector<Index>&part :
       execution.Collect<std::vector<Index>>(n, [&](std::int64_t begin, std::int64_t end) {
         std::vector<Index> chunk;
         for (auto i = static_cast<Index>(begin); i < static_cast<Index>(end); ++i) {
           if (predicate(i)) chunk.push_back(i);
         }
         return chunk;
       })) {
    found.insert(found.end(), part.begin(), part.end());
  }
  return found;
}

std::string EdgeName(const std::vector<Face>& faces, std::int32_t half_edge) {
  const auto [low, high] = std::minmax({Origin(faces, half_edge), Target(faces, half_edge)});
  return absl::StrCat(low, "-", high);
}

absl::Status CheckIndices(const Mesh& mesh, const Execution& execution) {
  if (mesh.faces.empty()) {
    return MeshFault("MESH_EMPTY", "the mesh has no faces; there is nothing to flatten", 0, {});
  }
  const std::vector<std::int64_t> faces = Find<std::int64_t>(mesh.num_faces(), execution, [&](std::int64_t f) {
    const Face& face = mesh.faces[f];
    return std::any_of(face.begin(), face.end(), [&](auto v) { return v < 0 || v >= mesh.num_vertices(); });
  });
  if (faces.empty()) return absl::OkStatus();
  return MeshFault("MESH_INDEX_OUT_OF_RANGE",
                   absl::StrCat(Elements("face", "faces", faces), faces.size() == 1 ? " refers" : " refer",
                                " to vertices that do not exist (the mesh has ", mesh.num_vertices(), ")"),
                   faces.size(), {{"faces", IdList(faces)}});
}

absl::Status CheckPositions(const Mesh& mesh, const Execution& execution) {
  const std::vector<std::int64_t> faces = Find<std::int64_t>(mesh.num_faces(), execution, [&](std::int64_t f) {
    const Face& face = mesh.faces[f];
    return !std::all_of(face.begin(), face.end(), [&](auto v) { return mesh.positions[v].allFinite(); });
  });
  if (faces.empty()) return absl::OkStatus();
  std::set<std::int32_t> bad;
  for (const std::int64_t f : faces) {
    for (const std::int32_t v : mesh.faces[f]) {
      if (!mesh.positions[v].allFinite()) bad.insert(v);
    }
  }
  const std::vector<std::int32_t> vertices(bad.begin(), bad.end());
  return MeshFault("MESH_POSITION_NOT_FINITE",
                   absl::StrCat("the position of ", Elements("vertex", "vertices", vertices),
                                " is NaN or infinite; give every vertex finite coordinates"),
                   vertices.size(), {{"vertices", IdList(vertices)}});
}

absl::Status CheckFaces(const Mesh& mesh, const Execution& execution) {
  const std::vector<std::int64_t> degenerate = Find<std::int64_t>(mesh.num_faces(), execution, [&](std::int64_t f) {
    const auto& [a, b, c] = mesh.faces[f];
    return a == b || b == c || c == a || IsDegenerateTriangle(mesh.positions[a], mesh.positions[b], mesh.positions[c]);
  });
  if (degenerate.empty()) return absl::OkStatus();
  return MeshFault(
      "MESH_FACE_DEGENERATE",
      absl::StrCat(Elements("face", "faces", degenerate), degenerate.size() == 1 ? " has" : " have",
                   " no area, so no angles to keep; remove or collapse ", degenerate.size() == 1 ? "it" : "them"),
      degenerate.size(), {{"faces", IdList(degenerate)}});
}

bool SameVertices(Face a, Face b) {
  std::sort(a.begin(), a.end());
  std::sort(b.begin(), b.end());
  return a == b;
}

// Two faces on one edge whose third vertices agree are the same face twice.
absl::Status CheckDuplicates(const std::vector<Face>& faces, const EdgeGroups& edges, const Execution& execution) {
  // Those at edge e that are the same as an earlier one there, to `visit`.
  const auto for_each_duplicate = [&](std::int32_t e, const auto& visit) {
    for (std::int32_t i = edges.begin[e]; i < edges.begin[e + 1]; ++i) {
      for (std::int32_t j = i + 1; j < edges.begin[e + 1]; ++j) {
        const std::int32_t f = edges.half_edge[i] / 3, g = edges.half_edge[j] / 3;
        if (SameVertices(faces[f], faces[g])) visit(std::max(f, g));
      }
      // A fan of thousands of faces on one edge is reported as non-manifold; comparing it pairwise would take hours.
      if (edges.begin[e + 1] - edges.begin[e] > 64) break;
    }
  };
  const std::vector<std::int32_t> at = Find<std::int32_t>(edges.num_edges(), execution, [&](std::int32_t e) {
    bool found = false;
    for_each_duplicate(e, [&](std::int32_t) { found = true; });
    return found;
  });
  if (at.empty()) return absl::OkStatus();
  std::set<std::int32_t> duplicates;
  for (const std::int32_t e : at) for_each_duplicate(e, [&](std::int32_t f) { duplicates.insert(f); });
  const std::vector<std::int32_t> ids(duplicates.begin(), duplicates.end());
  return MeshFault("MESH_FACE_DUPLICATE",
                   absl::StrCat(Elements("face", "faces", ids), ids.size() == 1 ? " has" : " have",
                                " the same three vertices as an earlier face; remove the copies"),
                   ids.size(), {{"faces", IdList(ids)}});
}

absl::Status CheckEdges(const std::vector<Face>& faces, const EdgeGroups& edges, const Execution& execution) {
  std::vector<std::string> names;
  std::vector<std::int32_t> at_faces;
  for (const std::int32_t e : Find<std::int32_t>(
           edges.num_edges(), execution, [&](std::int32_t e) { return edges.begin[e + 1] - edges.begin[e] > 2; })) {
    names.push_back(EdgeName(faces, edges.half_edge[edges.begin[e]]));
    for (std::int32_t i = edges.begin[e]; i < edges.begin[e + 1]; ++i) at_faces.push_back(edges.half_edge[i] / 3);
  }
  if (names.empty()) return absl::OkStatus();
  return MeshFault("MESH_EDGE_NON_MANIFOLD",
                   absl::StrCat("more than two faces meet at ", Elements("edge", "edges", names), " (",
                                Elements("face", "faces", at_faces), "); split the surface there"),
                   names.size(), {{"edges", IdList(names)}, {"faces", IdList(at_faces)}});
}

// Whether turning some faces over would make all orientations agree.
bool IsOrientable(const std::vector<Face>& faces, const EdgeGroups& edges, const Execution& execution) {
  struct Neighbour {
    std::int32_t face;
    bool agrees;
  };
  std::vector<std::vector<Neighbour>> neighbours(faces.size());
  for (std::int32_t e = 0; e < edges.num_edges() && !execution.IsStoppedAt(e); ++e) {
    if (edges.begin[e + 1] - edges.begin[e] != 2) continue;
    const std::int32_t c = edges.half_edge[edges.begin[e]], d = edges.half_edge[edges.begin[e] + 1];
    const bool agrees = Origin(faces, c) == Target(faces, d);
    neighbours[c / 3].push_back({d / 3, agrees});
    neighbours[d / 3].push_back({c / 3, agrees});
  }
  std::vector<signed char> side(faces.size(), 0);
  std::vector<std::int32_t> stack;
  std::int64_t steps = 0;
  for (std::size_t start = 0; start < faces.size(); ++start) {
    if (side[start] != 0) continue;
    side[start] = 1;
    stack.push_back(static_cast<std::int32_t>(start));
    while (!stack.empty()) {
      if (execution.IsStoppedAt(++steps)) return true;
      const std::int32_t f = stack.back();
      stack.pop_back();
      for (const Neighbour& n : neighbours[f]) {
        const auto wanted = static_cast<signed char>(n.agrees ? side[f] : -side[f]);
        if (side[n.face] == 0) {
          side[n.face] = wanted;
          stack.push_back(n.face);
        } else if (side[n.face] != wanted) {
          return false;
        }
      }
    }
  }
  return true;
}

absl::Status CheckOrientation(const std::vector<Face>& faces, const EdgeGroups& edges, const Execution& execution) {
  std::vector<std::string> names;
  std::vector<std::int32_t> at_faces;
  for (const std::int32_t e : Find<std::int32_t>(edges.num_edges(), execution, [&](std::int32_t e) {
         return edges.begin[e + 1] - edges.begin[e] == 2 &&
                Origin(faces, edges.half_edge[edges.begin[e]]) != Target(faces, edges.half_edge[edges.begin[e] + 1]);
       })) {
    const std::int32_t c = edges.half_edge[edges.begin[e]], d = edges.half_edge[edges.begin[e] + 1];
    names.push_back(EdgeName(faces, c));
    at_faces.push_back(c / 3);
    at_faces.push_back(d / 3);
  }
  if (names.empty()) return absl::OkStatus();
  const Metadata metadata = {{"edges", IdList(names)}, {"faces", IdList(at_faces)}};
  const std::string where =
      absl::StrCat(Elements("edge", "edges", names), " (", Elements("face", "faces", at_faces), ")");
  if (!IsOrientable(faces, edges, execution)) {
    return MeshFault("MESH_NOT_ORIENTABLE",
                     absl::StrCat("the surface has one side only, like a Moebius strip: orientations clash at ", where,
                                  " and turning faces over cannot help; cut it open"),
                     names.size(), metadata);
  }
  return MeshFault(
      "MESH_ORIENTATION_INCONSISTENT",
      absl::StrCat("the faces at ", where, " run round in opposite senses; turn faces over so that all agree"),
      names.size(), metadata);
}

std::vector<std::int32_t> OppositeCorners(const std::vector<Face>& faces, const EdgeGroups& edges,
                                          const Execution& execution) {
  std::vector<std::int32_t> opposite(3 * faces.size(), -1);
  execution.For(edges.num_edges(), [&](std::int64_t begin, std::int64_t end) {
    for (std::int64_t e = begin; e < end; ++e) {
      if (edges.begin[e + 1] - edges.begin[e] != 2) continue;
      const std::int32_t c = edges.half_edge[edges.begin[e]], d = edges.half_edge[edges.begin[e] + 1];
      opposite[c] = d;
      opposite[d] = c;
    }
  });
  return opposite;
}

// The corner at the same vertex in the next face counter-clockwise (across the edge to v_{k-1}) or clockwise
// (across the edge to v_{k+1}); -1 at the boundary.
std::int32_t Turn(const std::vector<std::int32_t>& opposite, std::int32_t corner, bool counter_clockwise) {
  const std::int32_t f = corner / 3, k = corner % 3;
  const std::int32_t o = opposite[3 * f + (counter_clockwise ? Next(k) : Prev(k))];
  if (o < 0) return -1;
  return 3 * (o / 3) + (counter_clockwise ? Next(o % 3) : Prev(o % 3));
}

absl::Status CheckVertices(const Mesh& mesh, const std::vector<std::int32_t>& opposite, const Execution& execution) {
  std::vector<char> seen(opposite.size(), 0);
  std::vector<std::int32_t> fans(mesh.num_vertices(), 0);
  for (std::int32_t start = 0; start < static_cast<std::int32_t>(opposite.size()); ++start) {
    if (execution.IsStoppedAt(start)) break;
    if (seen[start]) continue;
    ++fans[mesh.faces[start / 3][start % 3]];
    seen[start] = 1;
    for (const bool counter_clockwise : {true, false}) {
      for (std::int32_t c = Turn(opposite, start, counter_clockwise); c >= 0 && !seen[c];
           c = Turn(opposite, c, counter_clockwise)) {
        seen[c] = 1;
      }
    }
  }
  std::vector<std::int32_t> vertices;
  for (std::int32_t v = 0; v < mesh.num_vertices(); ++v) {
    if (fans[v] > 1) vertices.push_back(v);
  }
  if (vertices.empty()) return absl::OkStatus();
  return MeshFault("MESH_VERTEX_NON_MANIFOLD",
                   absl::StrCat("parts of the surface that share no edge touch at ",
                                Elements("vertex", "vertices", vertices), "; give each part a vertex of its own"),
                   vertices.size(), {{"vertices", IdList(vertices)}});
}

absl::Status CheckComponents(const std::vector<Face>& faces, const std::vector<std::int32_t>& opposite,
                             const Execution& execution) {
  std::vector<std::int32_t> first_faces, sizes, stack;
  std::vector<char> seen(faces.size(), 0);
  std::int64_t steps = 0;
  for (std::int32_t start = 0; start < static_cast<std::int32_t>(faces.size()); ++start) {
    if (seen[start]) continue;
    first_faces.push_back(start);
    sizes.push_back(0);
    seen[start] = 1;
    stack.push_back(start);
    while (!stack.empty()) {
      const std::int32_t f = stack.back();
      stack.pop_back();
      if (execution.IsStoppedAt(++steps)) return absl::OkStatus();
      ++sizes.back();
      for (int k = 0; k < 3; ++k) {
        const std::int32_t o = opposite[3 * f + k];
        if (o >= 0 && !seen[o / 3]) {
          seen[o / 3] = 1;
          stack.push_back(o / 3);
        }
      }
    }
  }
  if (first_faces.size() == 1) return absl::OkStatus();
  return MeshFault("MESH_SEVERAL_COMPONENTS",
                   absl::StrCat("the mesh has ", first_faces.size(), " separate components (of ",
                                absl::StrJoin(FirstFew(sizes, kMaxInMessage), ", "),
                                sizes.size() > kMaxInMessage ? ", ... faces" : " faces", "; they begin at ",
                                Elements("face", "faces", first_faces), "); a disc is one: send them one by one"),
                   first_faces.size(), {{"faces", IdList(first_faces)}});
}

struct BoundaryLoop {
  std::int32_t edges;
  std::int32_t vertex;  // one on the loop
};

// Longest first. Every vertex must be manifold, so that it starts one boundary half-edge at most.
std::vector<BoundaryLoop> BoundaryLoops(const Mesh& mesh, const std::vector<std::int32_t>& opposite) {
  std::vector<std::int32_t> next(mesh.num_vertices(), -1);
  for (std::int32_t c = 0; c < static_cast<std::int32_t>(opposite.size()); ++c) {
    if (opposite[c] < 0) next[Origin(mesh.faces, c)] = Target(mesh.faces, c);
  }
  std::vector<BoundaryLoop> loops;
  for (std::int32_t start = 0; start < mesh.num_vertices(); ++start) {
    if (next[start] < 0) continue;
    BoundaryLoop loop = {0, start};
    for (std::int32_t v = start; next[v] >= 0; ++loop.edges) v = std::exchange(next[v], -1);
    loops.push_back(loop);
  }
  std::stable_sort(loops.begin(), loops.end(), [](const auto& a, const auto& b) { return a.edges > b.edges; });
  return loops;
}

absl::Status CheckLoopsAndHandles(const Mesh& mesh, const EdgeGroups& edges, const std::vector<BoundaryLoop>& loops) {
  const std::int64_t num_used = mesh.num_vertices() - CountIsolatedVertices(mesh);
  const std::int64_t characteristic = num_used - edges.num_edges() + mesh.num_faces();
  const std::int64_t handles = (2 - static_cast<std::int64_t>(loops.size()) - characteristic) / 2;
  const std::string with_handles =
      handles == 0 ? "" : absl::StrCat(" and ", handles, handles == 1 ? " handle" : " handles");
  if (loops.empty()) {
    return MeshFault("MESH_CLOSED",
                     absl::StrCat("the mesh is closed: no boundary edge among ", edges.num_edges(), " edges",
                                  handles == 0 ? "" : absl::StrCat(" (genus ", handles, ")"),
                                  "; a disc has one boundary loop: cut the surface open along a seam"),
                     0, {{"genus", std::to_string(handles)}});
  }
  if (loops.size() > 1) {
    std::vector<std::string> names;
    std::vector<std::int32_t> vertices;
    for (const BoundaryLoop& loop : loops) {
      names.push_back(absl::StrCat(loop.edges, " edges through vertex ", loop.vertex));
      vertices.push_back(loop.vertex);
    }
    return MeshFault(
        "MESH_SEVERAL_LOOPS",
        absl::StrCat("the mesh has ", loops.size(), " boundary loops", with_handles, " (",
                     absl::StrJoin(FirstFew(names, kMaxInMessage), ", "), names.size() > kMaxInMessage ? ", ..." : "",
                     "); a disc has one: fill the holes, or cut from one loop to the next"),
        loops.size(), {{"vertices", IdList(vertices)}, {"genus", std::to_string(handles)}});
  }
  if (handles != 0) {
    return MeshFault("MESH_HAS_HANDLES",
                     absl::StrCat("the mesh has ", handles, handles == 1 ? " handle" : " handles", " (genus ", handles,
                                  ", one boundary loop of ", loops[0].edges, " edges through vertex ", loops[0].vertex,
                                  "); a disc has none: cut it open along a seam"),
                     static_cast<std::size_t>(handles),
                     {{"vertices", std::to_string(loops[0].vertex)}, {"genus", std::to_string(handles)}});
  }
  return absl::OkStatus();
}

// Everything there is to check; the opposite corners on the way.
absl::Status CheckConnectivity(const Mesh& mesh, const Execution& execution, std::vector<std::int32_t>* opposite) {
  PLANISH_RETURN_IF_ERROR(CheckElements(mesh, execution));
  PLANISH_RETURN_IF_ERROR(CheckFaces(mesh, execution));
  if (execution.IsStopped()) return absl::OkStatus();
  const EdgeGroups edges = GroupHalfEdges(mesh.faces, mesh.num_vertices(), execution);
  PLANISH_RETURN_IF_ERROR(CheckDuplicates(mesh.faces, edges, execution));
  PLANISH_RETURN_IF_ERROR(CheckEdges(mesh.faces, edges, execution));
  PLANISH_RETURN_IF_ERROR(CheckOrientation(mesh.faces, edges, execution));

  *opposite = OppositeCorners(mesh.faces, edges, execution);
  if (execution.IsStopped()) return absl::OkStatus();
  PLANISH_RETURN_IF_ERROR(CheckVertices(mesh, *opposite, execution));
  PLANISH_RETURN_IF_ERROR(CheckComponents(mesh.faces, *opposite, execution));
  if (execution.IsStopped()) return absl::OkStatus();
  return CheckLoopsAndHandles(mesh, edges, BoundaryLoops(mesh, *opposite));
}

}  // namespace

bool IsDegenerateTriangle(const Vec3& a, const Vec3& b, const Vec3& c) {
  const double twice_area = (b - a).cross(c - a).norm();
  const double longest = std::max({(b - a).squaredNorm(), (c - b).squaredNorm(), (a - c).squaredNorm()});
  return !(twice_area > 1e-14 * longest);
}

absl::Status CheckElements(const Mesh& mesh, const Execution& execution) {
  PLANISH_RETURN_IF_ERROR(CheckIndices(mesh, execution));
  return CheckPositions(mesh, execution);
}

std::int64_t CountIsolatedVertices(const Mesh& mesh) {
  std::vector<char> used(mesh.num_vertices(), 0);
  for (const Face& face : mesh.faces) {
    for (const std::int32_t v : face) used[v] = 1;
  }
  return std::count(used.begin(), used.end(), 0);
}

absl::StatusOr<Topology> CheckDisc(const Mesh& mesh, const Execution& execution) {
  Topology topology;
  const absl::Status status = CheckConnectivity(mesh, execution, &topology.opposite);
  // What was found after an interrupt may be wrong.
  if (execution.IsStopped()) return absl::CancelledError("cancelled");
  PLANISH_RETURN_IF_ERROR(status);

  topology.num_vertices = static_cast<std::int32_t>(mesh.num_vertices());
  topology.faces = mesh.faces;
  std::vector<char> interior(mesh.num_vertices(), 0);
  for (const Face& face : mesh.faces) {
    for (const std::int32_t v : face) interior[v] = 1;
  }
  for (std::int32_t c = 0; c < topology.num_corners(); ++c) {
    if (topology.opposite[c] < 0) interior[Origin(mesh.faces, c)] = interior[Target(mesh.faces, c)] = 0;
  }
  std::vector<std::int32_t> vertices;
  for (std::int32_t v = 0; v < topology.num_vertices; ++v) {
    if (interior[v]) vertices.push_back(v);
  }
  topology.num_interior = static_cast<std::int32_t>(vertices.size());
  AssignRows(InSpatialOrder(mesh.positions, vertices, execution), &topology);
  if (execution.IsStopped()) return absl::CancelledError("cancelled");
  return topology;
}

}  // namespace planish
