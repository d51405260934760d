#include "core/mesh/diagnosis.h"

#include <algorithm>
#include <cmath>
#include <limits>
#include <numbers>
#include <tuple>
#include <utility>

#include "Eigen/Geometry"
#include "absl/strings/str_cat.h"
#include "core/base/element_ids.h"
#include "core/base/error.h"
#include "core/mesh/angles.h"
#include "core/mesh/half_edges.h"
#include "core/mesh/import.h"
#include "core/mesh/tri_mesh.h"

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

void ListFaces(const Pairing& pairing, Diagnosis* result) {
  for (std::int64_t f = 0; f < result->faces; ++f) {
    const FaceKind kind = pairing.kind[f];
    if (kind == FaceKind::kOutOfRange) Add(f, &result->faces_out_of_range);
    if (kind == FaceKind::kRepeatingAVertex) Add(f, &result->faces_repeating_a_vertex);
    if (kind == FaceKind::kNotFinite) Add(f, &result->faces_not_finite);
    if (kind == FaceKind::kInOnePoint || kind == FaceKind::kWithoutArea) Add(f, &result->faces_without_area);
    if (kind != FaceKind::kOutOfRange && pairing.is_copy(f)) Add(f, &result->duplicate_faces);
    result->surface_faces += IsOfSurface(pairing, f);
  }
}

// Per vertex: whether a face in range refers to it.
std::vector<char> UsedVertices(const Mesh& mesh, const Pairing& pairing) {
  std::vector<char> used(mesh.positions.size(), 0);
  for (std::int64_t f = 0; f < mesh.num_faces(); ++f) {
    if (pairing.kind[f] == FaceKind::kOutOfRange) continue;
    for (const std::int32_t v : mesh.faces[f]) used[v] = 1;
  }
  return used;
}

void ListVertices(const Mesh& mesh, const Pairing& pairing, Diagnosis* result) {
  const std::vector<char> used = UsedVertices(mesh, pairing);
  for (std::int64_t v = 0; v < mesh.num_vertices(); ++v) {
    if (!used[v]) Add(v, &result->isolated_vertices);
    if (used[v] && !mesh.positions[v].allFinite()) Add(v, &result->vertices_not_finite);
  }
}

// One of the faces round a vertex.
FaceHandle FaceAt(const TriMesh& mesh, VertexHandle v) {
  const HalfedgeHandle h = mesh.halfedge_handle(v);
  return mesh.face_handle(mesh.is_boundary(h) ? mesh.opposite_halfedge_handle(h) : h);
}

// The pieces of the imported surface, put together again over the edges at which faces are wound against each other,
// and what their boundaries are like.
void ListComponents(const Pairing& pairing, const TriMesh& imported, const Execution& execution, Diagnosis* result) {
  const auto of_surface = [&](FaceHandle f) { return IsOfSurface(pairing, f.idx()); };
  std::int32_t num_pieces = 0;
  const std::vector<std::int32_t> piece = ConnectedPieces(
      static_cast<std::int32_t>(imported.n_faces()), &num_pieces,
      [&](std::int32_t f) { return IsOfSurface(pairing, f); },
      [&](std::int32_t f, int k) {
        const HalfedgeHandle h = HalfEdgesOf(imported, FaceHandle(f))[k];
        return imported.face_handle(imported.opposite_halfedge_handle(h)).idx();
      });
  if (execution.IsCancelled()) return;
  // A component is a set of pieces, a fan one of vertices. Pieces come twice in `sides`, as they are and turned over.
  // Over every inconsistent edge a piece goes with the other side of its neighbour; where it goes with its own, the
  // component is not orientable.
  UnionFind components(num_pieces), sides(2 * num_pieces), fans(imported.n_vertices());
  std::vector<char> is_inner(imported.n_edges(), 0);
  for (const auto& [c, d] : pairing.inconsistent) {
    if (piece[c / 3] < 0) continue;  // copies
    const HalfedgeHandle g = HalfEdgeOf(imported, c), h = HalfEdgeOf(imported, d);
    is_inner[imported.edge_handle(g).idx()] = is_inner[imported.edge_handle(h).idx()] = 1;
    components.Join(piece[c / 3], piece[d / 3]);
    sides.Join(2 * piece[c / 3], 2 * piece[d / 3] + 1);
    sides.Join(2 * piece[c / 3] + 1, 2 * piece[d / 3]);
    fans.Join(imported.from_vertex_handle(g).idx(), imported.from_vertex_handle(h).idx());
    fans.Join(imported.to_vertex_handle(g).idx(), imported.to_vertex_handle(h).idx());
  }
  result->oriented_pieces = num_pieces;
  std::vector<std::int32_t> number(num_pieces, -1);
  for (const FaceHandle f : imported.faces()) {
    if (!of_surface(f)) continue;
    const std::int32_t first = components.Find(piece[f.idx()]);  // the lowest: seen before
    if (number[first] < 0) {
      number[first] = static_cast<std::int32_t>(result->components.size());
      Component& component = result->components.emplace_back();
      component.first_face = f.idx();
      component.orientable = sides.Find(2 * first) != sides.Find(2 * first + 1);
    }
    number[piece[f.idx()]] = number[first];
    Component& component = result->components[number[first]];
    ++component.faces;
    ++component.euler_characteristic;
  }
  const auto component_of = [&](FaceHandle f) -> Component& { return result->components[number[piece[f.idx()]]]; };
  UnionFind loops(imported.n_vertices());
  std::vector<std::int64_t> inner(result->components.size(), 0);
  for (const EdgeHandle e : imported.edges()) {
    const HalfedgeHandle h = imported.halfedge_handle(e, 0);
    if (!of_surface(imported.face_handle(h))) continue;
    Component& component = component_of(imported.face_handle(h));
    if (is_inner[e.idx()]) {
      ++inner[&component - result->components.data()];  // comes twice
      continue;
    }
    --component.euler_characteristic;
    if (!imported.is_boundary(e)) continue;
    ++component.boundary_edges;
    loops.Join(fans.Find(imported.from_vertex_handle(h).idx()), fans.Find(imported.to_vertex_handle(h).idx()));
  }
  for (std::size_t i = 0; i < inner.size(); ++i) result->components[i].euler_characteristic -= inner[i] / 2;
  std::vector<char> on_boundary(imported.n_vertices(), 0);
  for (const EdgeHandle e : imported.edges()) {
    if (!imported.is_boundary(e) || is_inner[e.idx()]) continue;
    on_boundary[loops.Find(fans.Find(imported.to_vertex_handle(imported.halfedge_handle(e, 0)).idx()))] = 1;
  }
  std::int32_t last_source = -1;  // vertices are in the order of their sources
  std::int64_t fans_there = 0;
  for (const VertexHandle v : imported.vertices()) {
    const FaceHandle f = FaceAt(imported, v);
    if (!of_surface(f) || fans.Find(v.idx()) != v.idx()) continue;
    ++component_of(f).euler_characteristic;
    if (on_boundary[v.idx()]) ++component_of(f).boundary_loops;
    const std::int32_t source = imported.data(v).source;
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
  const std::vector<char> used = UsedVertices(mesh, pairing);
  for (std::int64_t v = 0; v < mesh.num_vertices(); ++v) {
    const Vec3& p = mesh.positions[v];
    if (!used[v] || !p.allFinite()) continue;
    result->box_min = any ? result->box_min.cwiseMin(p).eval() : p;
    result->box_max = any ? result->box_max.cwiseMax(p).eval() : p;
    any = true;
  }
  // Of the finite faces of the surface.
  Mesh finite;
  std::vector<std::int64_t> source;
  finite.positions = mesh.positions;
  for (std::int64_t f = 0; f < mesh.num_faces(); ++f) {
    if (pairing.kind[f] != FaceKind::kWithArea || pairing.is_copy(f)) continue;
    finite.faces.push_back(mesh.faces[f]);
    source.push_back(f);
  }
  if (finite.faces.empty()) return;
  const Eigen::VectorXd angles = MeasuredAngles(finite, execution) * (180 / std::numbers::pi);
  if (execution.IsCancelled()) return;
  result->angle_min_degrees = angles.minCoeff();
  result->angle_max_degrees = angles.maxCoeff();
  for (std::int64_t f = 0; f < finite.num_faces(); ++f) {
    result->area += DoubleArea(TriangleOf(finite.positions, finite.faces[f])) / 2;
    if (angles.segment<3>(3 * f).minCoeff() < kNeedleDegrees) Add(source[f], &result->needles);
  }
}

}  // namespace

std::string Counted(std::int64_t count, const std::string& one, const std::string& many) {
  return absl::StrCat(count, " ", count == 1 ? one : many);
}

absl::Status MeshFault(const std::string& reason, const std::string& message, std::int64_t count,
                       std::map<std::string, std::string> metadata) {
  metadata["count"] = absl::StrCat(count);
  return MakeError(absl::StatusCode::kInvalidArgument, reason, message, metadata);
}

std::int64_t Diagnosis::boundary_loops() const {
  std::int64_t sum = 0;
  for (const Component& component : components) sum += component.boundary_loops;
  return sum;
}

std::int64_t Diagnosis::euler_characteristic() const {
  std::int64_t sum = 0;
  for (const Component& component : components) sum += component.euler_characteristic;
  return sum;
}

std::int64_t Diagnosis::handles() const {
  std::int64_t sum = 0;
  for (const Component& component : components) sum += component.handles;
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
  ListFaces(pairing, &result);
  ListVertices(mesh, pairing, &result);
  return result;
}

Diagnosis DescribeImport(const Mesh& mesh, const Pairing& pairing, const TriMesh& imported,
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
  const Pairing pairing = PairHalfEdges(mesh, JoinFor::kDiagnosis, execution);
  if (execution.IsCancelled()) return absl::CancelledError("cancelled");
  Diagnosis result = DescribeImport(mesh, pairing, ImportMesh(mesh, pairing.opposite), execution);
  if (execution.IsCancelled()) return absl::CancelledError("cancelled");
  ListCoincidentVertices(mesh, &result);
  Measure(mesh, pairing, execution, &result);
  if (execution.IsCancelled()) return absl::CancelledError("cancelled");
  return result;
}

}  // namespace planish
