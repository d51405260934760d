#include "core/mesh/diagnosis.h"

#include <algorithm>
#include <iterator>
#include <limits>
#include <numbers>
#include <span>
#include <tuple>
#include <utility>

#include "absl/strings/str_cat.h"
#include "absl/strings/str_join.h"
#include "core/base/element_ids.h"
#include "core/base/error.h"
#include "core/base/status_macros.h"
#include "core/mesh/angles.h"
#include "core/mesh/half_edges.h"
#include "core/mesh/import.h"

namespace planish {
namespace {

constexpr double kNeedleDegrees = 1;

void Add(std::int64_t id, ElementList* list) {
  if (++list->count <= static_cast<std::int64_t>(kMaxDiagnosed)) list->first.push_back(id);
}

void AddEdge(const std::vector<Face>& faces, std::span<const std::int32_t> at, EdgeList* list) {
  if (++list->count > static_cast<std::int64_t>(kMaxDiagnosed)) return;
  const auto [low, high] = std::minmax({Origin(faces, at[0]), Target(faces, at[0])});
  list->first.push_back({low, high});
  for (std::size_t i = 0; i < at.size() && list->faces.size() < kMaxDiagnosed; ++i) list->faces.push_back(at[i] / 3);
}

bool IsOfSurface(const Pairing& pairing, std::int64_t f) {
  const bool has_place = pairing.kind[f] == FaceKind::kWithArea || pairing.kind[f] == FaceKind::kNotFinite;
  return has_place && !pairing.is_copy(f);
}

// Joins the pieces of the imported surface over the edges where orientations disagree, and describes the boundaries of
// the resulting components.
void ListComponents(const Pairing& pairing, const FlatImport& imported, const Execution& execution, Diagnosis* result) {
  const std::vector<Face>& faces = imported.mesh.faces;
  const std::vector<std::int32_t>& opposite = imported.mesh.opposite;
  const std::size_t num_vertices = imported.source.size();
  const auto num_faces = static_cast<std::int32_t>(faces.size());
  const auto of_surface = [&](std::int32_t f) { return IsOfSurface(pairing, f); };
  std::int32_t num_pieces = 0;
  const std::vector<std::int32_t> piece =
      ConnectedPieces(num_faces, &num_pieces, of_surface,
                      [&](std::int32_t f, int k) { return opposite[3 * f + k] < 0 ? -1 : opposite[3 * f + k] / 3; });
  if (execution.IsCancelled()) return;
  // A component is a set of pieces, a fan a set of vertices. `sides` has each piece twice, as it is and reversed. Over
  // every inconsistent edge, each piece is joined with its neighbour reversed. If a piece is joined with its own
  // reverse, the component is not orientable.
  UnionFind components(num_pieces), sides(2 * num_pieces), fans(num_vertices);
  std::vector<char> is_inner(opposite.size(), 0);  // per half-edge
  for (const auto& [c, d] : pairing.inconsistent) {
    if (piece[c / 3] < 0) continue;  // copies
    is_inner[c] = is_inner[d] = 1;
    components.Join(piece[c / 3], piece[d / 3]);
    sides.Join(2 * piece[c / 3], 2 * piece[d / 3] + 1);
    sides.Join(2 * piece[c / 3] + 1, 2 * piece[d / 3]);
    fans.Join(Origin(faces, c), Origin(faces, d));
    fans.Join(Target(faces, c), Target(faces, d));
  }
  result->oriented_pieces = num_pieces;
  std::vector<std::int32_t> number(num_pieces, -1);
  std::vector<std::int32_t> face_at(num_vertices, -1);  // per vertex, one of its faces
  for (std::int32_t f = 0; f < num_faces; ++f) {
    for (const std::int32_t v : faces[f]) face_at[v] = f;
    if (!of_surface(f)) continue;
    const std::int32_t first = components.Find(piece[f]);  // the lowest piece of the component, seen before
    if (number[first] < 0) {
      number[first] = static_cast<std::int32_t>(result->components.size());
      Component& component = result->components.emplace_back();
      component.first_face = f;
      component.orientable = sides.Find(2 * first) != sides.Find(2 * first + 1);
    }
    number[piece[f]] = number[first];
    Component& component = result->components[number[first]];
    ++component.faces;
    ++component.euler_characteristic;
  }
  const auto component_of = [&](std::int32_t f) -> Component& { return result->components[number[piece[f]]]; };
  for (const auto& [c, d] : pairing.inconsistent) {
    if (is_inner[c]) --component_of(c / 3).euler_characteristic;
  }
  UnionFind loops(num_vertices);
  std::vector<char> on_boundary(num_vertices, 0);  // per fan
  for (std::int32_t c = 0; c < 3 * num_faces; ++c) {
    const std::int32_t o = opposite[c];
    if ((o >= 0 && o < c) || is_inner[c] || !of_surface(c / 3)) continue;
    Component& component = component_of(c / 3);
    --component.euler_characteristic;
    if (o >= 0) continue;
    ++component.boundary_edges;
    // The number of loops is the number of fans on the boundary, minus one for each edge that joins two of them.
    const std::int32_t from = fans.Find(Origin(faces, c)), to = fans.Find(Target(faces, c));
    on_boundary[from] = on_boundary[to] = 1;
    if (loops.Join(from, to)) --component.boundary_loops;
  }
  std::int32_t last_source = -1;  // vertices are in the order of their sources
  std::int64_t fans_there = 0;
  for (std::int32_t v = 0; v < std::ssize(face_at); ++v) {
    const std::int32_t f = face_at[v];
    if (!of_surface(f) || fans.Find(v) != v) continue;
    ++component_of(f).euler_characteristic;
    if (on_boundary[v]) ++component_of(f).boundary_loops;
    const std::int32_t source = imported.source[v];
    fans_there = source == last_source ? fans_there + 1 : 1;
    last_source = source;
    if (fans_there == 2) Add(source, &result->non_manifold_vertices);
  }
  for (Component& component : result->components) {
    const std::int64_t missing = 2 - component.boundary_loops - component.euler_characteristic;
    (component.orientable ? component.handles : component.crosscaps) = component.orientable ? missing / 2 : missing;
  }
}

void ListCoincidentVertices(const Mesh& mesh, Diagnosis* result) {
  std::vector<std::int32_t> finite;
  for (std::int64_t v = 0; v < mesh.num_vertices(); ++v) {
    if (mesh.positions[v].allFinite()) finite.push_back(static_cast<std::int32_t>(v));
  }
  const auto coordinates = [&](std::int32_t v) {
    const Vec3& p = mesh.positions[v];
    return std::tuple(p.x(), p.y(), p.z());
  };
  std::sort(finite.begin(), finite.end(), [&](std::int32_t a, std::int32_t b) {
    return std::pair(coordinates(a), a) < std::pair(coordinates(b), b);
  });
  std::vector<std::int32_t> coincident;
  for (std::size_t i = 1; i < finite.size(); ++i) {
    if (coordinates(finite[i]) == coordinates(finite[i - 1])) coincident.push_back(finite[i]);
  }
  std::sort(coincident.begin(), coincident.end());
  for (const std::int32_t v : coincident) Add(v, &result->coincident_vertices);
}

void Measure(const Mesh& mesh, const Pairing& pairing, const Execution& execution, Diagnosis* result) {
  bool any = false;
  const std::vector<char> used = UsedVertices(mesh);
  for (std::int64_t v = 0; v < mesh.num_vertices(); ++v) {
    const Vec3& p = mesh.positions[v];
    if (!used[v] || !p.allFinite()) continue;
    result->box_min = any ? result->box_min.cwiseMin(p).eval() : p;
    result->box_max = any ? result->box_max.cwiseMax(p).eval() : p;
    any = true;
  }
  std::vector<std::int32_t> finite;  // faces of the surface with finite positions
  for (std::int32_t f = 0; f < mesh.num_faces(); ++f) {
    if (pairing.kind[f] == FaceKind::kWithArea && !pairing.is_copy(f)) finite.push_back(f);
  }
  if (finite.empty()) return;
  const Eigen::VectorXd angles = MeasuredAngles(mesh, finite, execution) * (180 / std::numbers::pi);
  if (execution.IsCancelled()) return;
  result->angle_min_degrees = angles.minCoeff();
  result->angle_max_degrees = angles.maxCoeff();
  for (std::int64_t i = 0; i < std::ssize(finite); ++i) {
    result->area += DoubleArea(TriangleOf(mesh.positions, mesh.faces[finite[i]])) / 2;
    if (angles.segment<3>(3 * i).minCoeff() < kNeedleDegrees) Add(finite[i], &result->needles);
  }
}

std::string FirstIds(const std::vector<std::int64_t>& list) {
  return ids::IdList(std::span(list).first(std::min(kMaxDiagnosed, list.size())));
}

// The message is `before`, the number of edges, `after`.
absl::Status FaultAtEdges(const std::string& reason, const char* before, const EdgeList& list, const char* after) {
  const auto name = [](std::string* out, const auto& edge) { absl::StrAppend(out, edge[0], "-", edge[1]); };
  return MeshFault(reason, absl::StrCat(before, Counted(list.count, "edge", "edges"), after), list.count,
                   {{"edges", absl::StrJoin(list.first, ",", name)}, {"faces", FirstIds(list.faces)}});
}

// OK, or the error of CheckDisc().
absl::Status CheckDisc(const Diagnosis& d, const FlatImport& imported) {
  if (d.faces == 0 || d.faces_out_of_range.count > 0 || d.vertices_not_finite.count > 0) return d.Refusal();
  std::vector<std::int64_t> degenerate;
  std::merge(d.faces_repeating_a_vertex.first.begin(), d.faces_repeating_a_vertex.first.end(),
             d.faces_without_area.first.begin(), d.faces_without_area.first.end(), std::back_inserter(degenerate));
  if (const std::int64_t count = d.faces_repeating_a_vertex.count + d.faces_without_area.count; count > 0) {
    return MeshFault("MESH_FACE_DEGENERATE",
                     absl::StrCat(Counted(count, "face has", "faces have"),
                                  " no area, so no angles to keep; remove or collapse ", count == 1 ? "it" : "them"),
                     count, {{"faces", FirstIds(degenerate)}});
  }
  if (const auto& [count, first] = d.duplicate_faces; count > 0) {
    return MeshFault("MESH_FACE_DUPLICATE",
                     absl::StrCat(Counted(count, "face has", "faces have"),
                                  " the same three vertices as an earlier face; remove the copies"),
                     count, {{"faces", FirstIds(first)}});
  }
  if (d.non_manifold_edges.count > 0) {
    return FaultAtEdges("MESH_EDGE_NON_MANIFOLD", "more than two faces meet at ", d.non_manifold_edges,
                        "; split the surface there");
  }
  if (d.inconsistent_edges.count > 0) {
    if (!d.is_orientable()) {
      return FaultAtEdges("MESH_NOT_ORIENTABLE",
                          "the surface has one side only, like a Moebius strip: orientations clash at ",
                          d.inconsistent_edges, " and turning faces over cannot help; cut it open");
    }
    return FaultAtEdges("MESH_ORIENTATION_INCONSISTENT", "the faces at ", d.inconsistent_edges,
                        " run round in opposite senses; turn faces over so that all agree");
  }
  if (const auto& [count, first] = d.non_manifold_vertices; count > 0) {
    return MeshFault("MESH_VERTEX_NON_MANIFOLD",
                     absl::StrCat("parts of the surface that share no edge touch at ",
                                  Counted(count, "vertex", "vertices"), "; give each part a vertex of its own"),
                     count, {{"vertices", FirstIds(first)}});
  }
  if (const std::int64_t count = std::ssize(d.components); count != 1) {
    std::vector<std::int64_t> sizes, first_faces;
    for (const Component& component : d.components) {
      if (sizes.size() < 4) sizes.push_back(component.faces);
      first_faces.push_back(component.first_face);
    }
    return MeshFault("MESH_SEVERAL_COMPONENTS",
                     absl::StrCat("the mesh has ", count, " separate components (of ", absl::StrJoin(sizes, ", "),
                                  count > 4 ? ", ..." : "", " faces); a disc is one: send them one by one"),
                     count, {{"faces", FirstIds(first_faces)}});
  }
  const std::int64_t handles = d.handles();
  const std::string counted = Counted(handles, "handle", "handles");
  const std::string genus = absl::StrCat(handles);
  const Loops loops = BoundaryLoops(imported.mesh.opposite);
  if (loops.count() == 0) {
    return MeshFault("MESH_CLOSED",
                     absl::StrCat("the mesh is closed: no boundary edge among ", d.edges, " edges",
                                  handles == 0 ? "" : absl::StrCat(" (genus ", handles, ")"),
                                  "; a disc has one boundary loop: cut the surface open along a seam"),
                     0, {{"genus", genus}});
  }
  // Longest first, then by the lowest vertex of each.
  std::vector<std::pair<std::int64_t, std::int64_t>> longest;  // minus the number of edges, and the vertex
  for (std::int32_t i = 0; i < loops.count(); ++i) {
    std::int64_t lowest = std::numeric_limits<std::int64_t>::max();
    for (const std::int32_t c : loops[i]) {
      lowest = std::min<std::int64_t>(lowest, imported.source[Origin(imported.mesh.faces, c)]);
    }
    longest.emplace_back(-std::ssize(loops[i]), lowest);
  }
  std::sort(longest.begin(), longest.end());
  std::vector<std::int64_t> sizes, vertices;
  for (const auto& [minus_edges, vertex] : longest) {
    if (sizes.size() < 4) sizes.push_back(-minus_edges);
    vertices.push_back(vertex);
  }
  if (const std::int64_t count = loops.count(); count > 1) {
    return MeshFault("MESH_SEVERAL_LOOPS",
                     absl::StrCat("the mesh has ", count, " boundary loops", handles == 0 ? "" : " and " + counted,
                                  " (of ", absl::StrJoin(sizes, ", "), count > 4 ? ", ..." : "",
                                  " edges); a disc has one: fill the holes, or cut from one loop to the next"),
                     count, {{"vertices", FirstIds(vertices)}, {"genus", genus}});
  }
  if (handles == 0) return absl::OkStatus();
  return MeshFault("MESH_HAS_HANDLES",
                   absl::StrCat("the mesh has ", counted, " (genus ", handles, ", one boundary loop of ", sizes[0],
                                " edges); a disc has none: cut it open along a seam"),
                   handles, {{"vertices", FirstIds(vertices)}, {"genus", genus}});
}

}  // namespace

std::vector<char> UsedVertices(const Mesh& mesh) {
  std::vector<char> used(mesh.positions.size(), 0);
  for (const Face& face : mesh.faces) {
    if (!mesh.IsInRange(face)) continue;
    for (const std::int32_t v : face) used[v] = 1;
  }
  return used;
}

std::string Counted(std::int64_t count, const std::string& one, const std::string& many) {
  return absl::StrCat(count, " ", count == 1 ? one : many);
}

absl::Status MeshFault(const std::string& reason, const std::string& message, std::int64_t count,
                       std::map<std::string, std::string> metadata) {
  metadata["count"] = absl::StrCat(count);
  return MakeError(absl::StatusCode::kInvalidArgument, reason, message, metadata);
}

std::int64_t Diagnosis::Sum(std::int64_t Component::*number) const {
  std::int64_t sum = 0;
  for (const Component& component : components) sum += component.*number;
  return sum;
}

bool Diagnosis::is_orientable() const {
  return std::all_of(components.begin(), components.end(), [](const Component& c) { return c.orientable; });
}

bool Diagnosis::is_disc() const {
  return surface_faces == faces && faces_not_finite.count == 0 && non_manifold_edges.count == 0 &&
         inconsistent_edges.count == 0 && non_manifold_vertices.count == 0 && components.size() == 1 &&
         components[0].IsDisc();
}

absl::Status Diagnosis::Refusal() const {
  if (faces == 0) return MeshFault("MESH_EMPTY", "the mesh has no faces; there is nothing to flatten", 0, {});
  if (const auto& [count, first] = faces_out_of_range; count > 0) {
    return MeshFault("MESH_INDEX_OUT_OF_RANGE",
                     absl::StrCat(Counted(count, "face refers", "faces refer"),
                                  " to vertices that do not exist (the mesh has ", vertices, ")"),
                     count, {{"faces", ids::IdList(first)}});
  }
  if (const auto& [count, first] = vertices_not_finite; count > 0) {
    return MeshFault("MESH_POSITION_NOT_FINITE",
                     absl::StrCat("the position of ", Counted(count, "vertex", "vertices"),
                                  " is NaN or infinite; give every vertex finite coordinates"),
                     count, {{"vertices", ids::IdList(first)}});
  }
  if (surface_faces == 0) {
    return MeshFault("MESH_FACE_DEGENERATE", "no face of the mesh has any area, so there are no angles to keep", faces,
                     {});
  }
  return absl::OkStatus();
}

Diagnosis DescribeElements(const Mesh& mesh, const Pairing& pairing) {
  Diagnosis result;
  result.vertices = mesh.num_vertices();
  result.faces = mesh.num_faces();
  for (std::int64_t f = 0; f < result.faces; ++f) {
    const FaceKind kind = pairing.kind[f];
    if (kind == FaceKind::kOutOfRange) Add(f, &result.faces_out_of_range);
    if (kind == FaceKind::kRepeatingAVertex) Add(f, &result.faces_repeating_a_vertex);
    if (kind == FaceKind::kNotFinite) Add(f, &result.faces_not_finite);
    if (kind == FaceKind::kInOnePoint || kind == FaceKind::kWithoutArea) Add(f, &result.faces_without_area);
    if (kind != FaceKind::kOutOfRange && pairing.is_copy(f)) Add(f, &result.duplicate_faces);
    result.surface_faces += IsOfSurface(pairing, f);
  }
  const std::vector<char> used = UsedVertices(mesh);
  for (std::int64_t v = 0; v < result.vertices; ++v) {
    if (!used[v]) Add(v, &result.isolated_vertices);
    if (used[v] && !mesh.positions[v].allFinite()) Add(v, &result.vertices_not_finite);
  }
  return result;
}

Diagnosis DescribeImport(const Mesh& mesh, const Pairing& pairing, const FlatImport& imported,
                         const Execution& execution) {
  Diagnosis result = DescribeElements(mesh, pairing);
  result.edges = pairing.edges;
  result.boundary_edges = pairing.boundary_edges;
  for (const std::vector<std::int32_t>& at : pairing.non_manifold) {
    if (!pairing.is_copy(at[0] / 3)) AddEdge(mesh.faces, at, &result.non_manifold_edges);
  }
  for (const auto& at : pairing.inconsistent) {
    if (!pairing.is_copy(at[0] / 3)) AddEdge(mesh.faces, at, &result.inconsistent_edges);
  }
  ListComponents(pairing, imported, execution, &result);
  return result;
}

absl::StatusOr<Diagnosis> Diagnose(const Mesh& mesh, const Execution& execution) {
  constexpr std::int64_t kMax = std::numeric_limits<std::int32_t>::max();
  if (mesh.num_faces() > kMax / 3 || mesh.num_vertices() > kMax) {
    return MakeError(absl::StatusCode::kInvalidArgument, "MESH_TOO_LARGE",
                     "the mesh has more than 2^31 vertices or corners");
  }
  Pairing pairing = PairHalfEdges(mesh, JoinFor::kDiagnosis, execution);
  if (execution.IsCancelled()) return absl::CancelledError("cancelled");
  Diagnosis result = DescribeImport(mesh, pairing, ImportFlat(mesh, std::move(pairing.opposite)), execution);
  if (execution.IsCancelled()) return absl::CancelledError("cancelled");
  ListCoincidentVertices(mesh, &result);
  Measure(mesh, pairing, execution, &result);
  if (execution.IsCancelled()) return absl::CancelledError("cancelled");
  return result;
}

absl::StatusOr<FlatImport> ImportDisc(const Mesh& mesh, const Execution& execution) {
  Pairing pairing = PairHalfEdges(mesh, JoinFor::kDiagnosis, execution);
  if (execution.IsCancelled()) return absl::CancelledError("cancelled");
  FlatImport imported = ImportFlat(mesh, std::move(pairing.opposite));
  const Diagnosis diagnosis = DescribeImport(mesh, pairing, imported, execution);
  // After a cancellation the diagnosis may be wrong.
  if (execution.IsCancelled()) return absl::CancelledError("cancelled");
  PLANISH_RETURN_IF_ERROR(CheckDisc(diagnosis, imported));
  return imported;
}

absl::Status CheckDisc(const Mesh& mesh, const Execution& execution) {
  return ImportDisc(mesh, execution).status();
}

std::int64_t CountIsolatedVertices(const Mesh& mesh) {
  const std::vector<char> used = UsedVertices(mesh);
  return std::count(used.begin(), used.end(), 0);
}

}  // namespace planish
