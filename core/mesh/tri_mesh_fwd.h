// Names TriMesh (core/mesh/tri_mesh.h) without its headers.
#pragma once

namespace OpenMesh {
template <class Traits>
class TriMesh_ArrayKernelT;
}  // namespace OpenMesh

namespace planish {

struct TriMeshTraits;
using TriMesh = OpenMesh::TriMesh_ArrayKernelT<TriMeshTraits>;

}  // namespace planish
