// Vertex attributes as numbers, from accessors or from Draco. Used only in client/files.
#pragma once

#include <array>
#include <string>
#include <vector>

#include "absl/status/statusor.h"
#include "client/files/gltf_mesh.h"

namespace planish {

// `components` numbers for each vertex of the primitive's pool; empty if the primitive has no attribute `name`, or the
// attribute has fewer components or another number of values.
absl::StatusOr<std::vector<float>> ReadVertexAttribute(const GltfMesh& gltf, const GltfPrimitive& primitive,
                                                       const std::string& name, std::size_t components);

// The normals at the corners of the primitive's triangles, three numbers each. If its vertices have no normals, each
// corner gets the normal of its flat triangle, as glTF demands. Sets *are_given to whether the vertices have normals.
absl::StatusOr<std::vector<float>> CornerNormals(const GltfMesh& gltf, const GltfPrimitive& primitive, bool* are_given);

// COLOR_0 at the corners of the primitive's triangles, linear, with alpha; empty if the primitive has none.
absl::StatusOr<std::vector<std::array<float, 4>>> CornerColors(const GltfMesh& gltf, const GltfPrimitive& primitive);

}  // namespace planish
