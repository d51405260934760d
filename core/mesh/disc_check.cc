#include "core/mesh/disc_check.h"

#include <algorithm>
#include <iterator>
#include <limits>
#include <map>
#include <span>
#include <string>
#include <utility>
#include <vector>

#include "absl/strings/str_cat.h"
#include "absl/strings/str_join.h"
#include "core/base/element_ids.h"
#include "core/base/status_macros.h"
#include "core/mesh/diagnosis.h"
#include "core/mesh/half_edges.h"
#include "core/mesh/import.h"
#include "core/mesh/tri_mesh.h"

namespace planish {
namespace {

std::string FirstIds(const std::vector<std::int64_t>& list) {
  return ids::IdList(std::span(list).first(std::min(kMaxDiagnosed, list.size())));
}

// `before` and `after` stand round the number of edges.
absl::Status FaultAtEdges(const std::string& reason, const char* before, const EdgeList& list, const char* after) {
  const auto name = [](std::string* out, const auto& edge) { absl::StrAppend(out, edge[0], "-", edge[1]); };
  return MeshFault(reason, absl::StrCat(before, Counted(list.count, "edge", "edges"), after), list.count,
                   {{"edges", absl::StrJoin(list.first, ",", name)}, {"faces", FirstIds(list.faces)}});
}

absl::Status CheckFaces(const Diagnosis& d) {
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
  return absl::OkStatus();
}

absl::Status CheckManifold(const Diagnosis& d) {
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
  return absl::OkStatus();
}

absl::Status CheckOneComponent(const Diagnosis& d) {
  if (d.components.size() == 1) return absl::OkStatus();
  std::vector<std::int64_t> sizes, first_faces;
  for (const Component& component : d.components) {
    if (sizes.size() < 4) sizes.push_back(component.faces);
    first_faces.push_back(component.first_face);
  }
  const auto count = static_cast<std::int64_t>(d.components.size());
  return MeshFault("MESH_SEVERAL_COMPONENTS",
                   absl::StrCat("the mesh has ", count, " separate components (of ", absl::StrJoin(sizes, ", "),
                                count > 4 ? ", ..." : "", " faces); a disc is one: send them one by one"),
                   count, {{"faces", FirstIds(first_faces)}});
}

struct BoundaryLoop {
  std::int64_t edges, vertex;  // one on the loop, the lowest
};

// Longest first, then by their vertices.
std::vector<BoundaryLoop> LoopsOf(const TriMesh& mesh) {
  const Loops<HalfedgeHandle> loops = BoundaryLoops(mesh);
  std::vector<BoundaryLoop> found;
  for (std::int32_t i = 0; i < loops.count(); ++i) {
    BoundaryLoop loop = {static_cast<std::int64_t>(loops.loop(i).size()), std::numeric_limits<std::int64_t>::max()};
    for (const HalfedgeHandle h : loops.loop(i)) {
      loop.vertex = std::min<std::int64_t>(loop.vertex, mesh.data(mesh.from_vertex_handle(h)).source);
    }
    found.push_back(loop);
  }
  std::sort(found.begin(), found.end(),
            [](const auto& a, const auto& b) { return std::pair(-a.edges, a.vertex) < std::pair(-b.edges, b.vertex); });
  return found;
}

absl::Status CheckLoopsAndHandles(const Diagnosis& d, const TriMesh& mesh) {
  const std::int64_t handles = d.handles();
  const auto counted = [&](const char* before) {
    return handles == 0 ? "" : absl::StrCat(before, handles, handles == 1 ? " handle" : " handles");
  };
  const std::string genus = absl::StrCat(handles);
  const std::vector<BoundaryLoop> loops = LoopsOf(mesh);
  if (loops.empty()) {
    return MeshFault("MESH_CLOSED",
                     absl::StrCat("the mesh is closed: no boundary edge among ", d.edges, " edges",
                                  handles == 0 ? "" : absl::StrCat(" (genus ", handles, ")"),
                                  "; a disc has one boundary loop: cut the surface open along a seam"),
                     0, {{"genus", genus}});
  }
  std::vector<std::int64_t> sizes, vertices;
  for (const BoundaryLoop& loop : loops) {
    if (sizes.size() < 4) sizes.push_back(loop.edges);
    vertices.push_back(loop.vertex);
  }
  const auto count = static_cast<std::int64_t>(loops.size());
  if (count > 1) {
    return MeshFault("MESH_SEVERAL_LOOPS",
                     absl::StrCat("the mesh has ", count, " boundary loops", counted(" and "), " (of ",
                                  absl::StrJoin(sizes, ", "), count > 4 ? ", ..." : "",
                                  " edges); a disc has one: fill the holes, or cut from one loop to the next"),
                     count, {{"vertices", FirstIds(vertices)}, {"genus", genus}});
  }
  if (handles == 0) return absl::OkStatus();
  return MeshFault("MESH_HAS_HANDLES",
                   absl::StrCat("the mesh has", counted(" "), " (genus ", handles, ", one boundary loop of ", sizes[0],
                                " edges); a disc has none: cut it open along a seam"),
                   handles, {{"vertices", FirstIds(vertices)}, {"genus", genus}});
}

}  // namespace

absl::StatusOr<TriMesh> ImportDisc(const Mesh& mesh, const Execution& execution) {
  const Pairing pairing = PairHalfEdges(mesh, JoinFor::kDiagnosis, execution);
  if (execution.IsCancelled()) return absl::CancelledError("cancelled");
  TriMesh imported = ImportMesh(mesh, pairing.opposite);
  const Diagnosis diagnosis = DescribeImport(mesh, pairing, imported, execution);
  // What was found after a cancellation may be wrong.
  if (execution.IsCancelled()) return absl::CancelledError("cancelled");
  PLANISH_RETURN_IF_ERROR(CheckFaces(diagnosis));
  PLANISH_RETURN_IF_ERROR(CheckManifold(diagnosis));
  PLANISH_RETURN_IF_ERROR(CheckOneComponent(diagnosis));
  PLANISH_RETURN_IF_ERROR(CheckLoopsAndHandles(diagnosis, imported));
  return imported;
}

absl::Status CheckDisc(const Mesh& mesh, const Execution& execution) {
  return ImportDisc(mesh, execution).status();
}

std::int64_t CountIsolatedVertices(const Mesh& mesh) {
  std::vector<char> used(mesh.num_vertices(), 0);
  for (const Face& face : mesh.faces) {
    for (const std::int32_t v : face) used[v] = 1;
  }
  return std::count(used.begin(), used.end(), 0);
}

}  // namespace planish
