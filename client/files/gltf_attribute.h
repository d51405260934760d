// Vertex attributes as numbers, from accessors or from Draco. Used only in client/files.
#pragma once

#include <array>
#include <string>
#include <vector>

#include "absl/status/statusor.h"
#include "client/files/gltf_mesh.h"

namespace planish {

// `components` numbers for each vertex of the primitive's pool; empty if the primitive has no such attribute or it has
// fewer components.
absl::StatusOr<std::vector<float>> ReadVertexAttribute(const GltfMesh& gltf, const GltfPrimitive& primitive,
                                                       const std::string& name, std::size_t components);

// The normals at the corners of the primitive's triangles, three numbers each: those of the vertices or, if there are
// none, of the flat triangles, as glTF demands. Sets *are_given.
absl::StatusOr<std::vector<float>> CornerNormals(const GltfMesh& gltf, const GltfPrimitive& primitive, bool* are_given);

// COLOR_0 at the corners of the primitive's triangles, linear, with alpha; empty if it has none.
absl::StatusOr<std::vector<std::array<float, 4>>> CornerColors(const GltfMesh& gltf, const GltfPrimitive& primitive);

}  // namespace planish
