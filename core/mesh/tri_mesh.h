// The mesh type used from import to charts: OpenMesh's half-edge mesh with double positions.
//
// core/mesh/import.h makes one from any triangle soup; charts are extracted from it into flat arrays
// (core/charts/gluing.h). This header is slow to compile: include it in few sources.
#pragma once

#include <array>
#include <cstdint>

// A property's push_back() copies an uninitialized point, as Eigen does not initialize points.
#pragma GCC diagnostic push
#if !defined(__clang__)
#pragma GCC diagnostic ignored "-Wmaybe-uninitialized"
#endif
#include "OpenMesh/Core/Mesh/TriMesh_ArrayKernelT.hh"
// Specializes a template of the header above, so comes after it.
#include "OpenMesh/Core/Geometry/EigenVectorT.hh"
#pragma GCC diagnostic pop

#include "core/mesh/mesh.h"

namespace planish {

// Properties are declared here: adding one changes a mesh, which a worker thread may not do to a mesh that others read.
struct TriMeshTraits : OpenMesh::DefaultTraits {
  using Point = Vec3;
  using Normal = Vec3;
  VertexTraits {
    std::int32_t source = -1;  // the vertex in the imported Mesh; vertices that import duplicated have the same one
  };
  EdgeTraits {
    bool is_uncut = false;  // no chart may end at this edge (GivenSeams::uncut_corners, polygon)
  };
};

// Half-edge 0 of every edge is the one with the lower corner, so it has a face; edges are numbered in the order of
// these corners. Corner 0 of a face faces halfedge_handle(face), which runs from vertex 1 to vertex 2. A boundary
// vertex has one outgoing boundary half-edge, its halfedge_handle().
//
// OpenMesh's meshes have no move constructor: moving copies the whole mesh. Pass them by pointer.
using TriMesh = OpenMesh::TriMesh_ArrayKernelT<TriMeshTraits>;
using OpenMesh::EdgeHandle;
using OpenMesh::FaceHandle;
using OpenMesh::HalfedgeHandle;
using OpenMesh::VertexHandle;

// The half-edges of a face, in the order of the corners that face them: 0, 1, 2.
inline std::array<HalfedgeHandle, 3> HalfEdgesOf(const TriMesh& mesh, FaceHandle face) {
  const HalfedgeHandle first = mesh.halfedge_handle(face);
  return {first, mesh.next_halfedge_handle(first), mesh.prev_halfedge_handle(first)};
}

// The vertices of a face, in the order of its corners.
inline std::array<VertexHandle, 3> VerticesOf(const TriMesh& mesh, FaceHandle face) {
  const std::array<HalfedgeHandle, 3> h = HalfEdgesOf(mesh, face);
  return {mesh.to_vertex_handle(h[1]), mesh.to_vertex_handle(h[2]), mesh.to_vertex_handle(h[0])};
}

// The half-edge that corner 3 f + k faces, where f is a face of `mesh`.
inline HalfedgeHandle HalfEdgeOf(const TriMesh& mesh, std::int32_t corner) {
  return HalfEdgesOf(mesh, FaceHandle(corner / 3))[corner % 3];
}

// The corner 3 f + k that half-edge h faces. h must have a face.
inline std::int32_t CornerOf(const TriMesh& mesh, HalfedgeHandle h) {
  const FaceHandle face = mesh.face_handle(h);
  const HalfedgeHandle first = mesh.halfedge_handle(face);
  return 3 * face.idx() + (h == first ? 0 : mesh.next_halfedge_handle(h) == first ? 2 : 1);
}

// The corner on the other side of the edge that this corner faces; -1 on the boundary.
inline std::int32_t CornerAcross(const TriMesh& mesh, std::int32_t corner) {
  const HalfedgeHandle across = mesh.opposite_halfedge_handle(HalfEdgeOf(mesh, corner));
  return mesh.is_boundary(across) ? -1 : CornerOf(mesh, across);
}

}  // namespace planish
