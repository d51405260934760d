// Describes a glTF's textures and the triangles that show them, for resampling. Used only in client/files.
#pragma once

#include <array>
#include <cstdint>
#include <set>
#include <string>
#include <vector>

#include "absl/status/status.h"
#include "absl/status/statusor.h"
#include "client/files/gltf_material.h"
#include "client/files/gltf_mesh.h"
#include "client/files/mesh_output.h"
#include "client/files/texture_files.h"

namespace planish {

// A glTF and its new map.
struct GltfOutput {
  const GltfMesh& gltf;
  const OutputOptions& options;
  const std::vector<double>& uv;  // per corner of the triangles, v downwards
  // The tangents of the new map, per corner as well; empty if none are needed.
  const std::vector<std::array<float, 4>>& tangents;
};

// Describes how `use` reads `image`: with which sampler and meaning. The triangles are added later.
TextureBake BakeOfGltfTexture(const GltfMesh& gltf, const GltfTextureUse& use, std::int64_t image);

// Appends to `bake` the triangles of a primitive with their UV in the old and the new map, and tangent frames if the
// texture has directions. `use` null: there is no image, and all UV of the old map are 0. INVALID_ARGUMENT:
// OPTIONS_INVALID if the primitive lies in several tiles.
absl::Status AddGltfTriangles(const GltfOutput& output, std::size_t primitive, const GltfTextureUse* use,
                              TextureBake* bake);

// The tangents at the corners of a primitive's triangles for a normal map that is read with `uv`, v downwards: TANGENT,
// or those of MikkTSpace. `positions` of vertices; `normals` and `normals_are_given` as CornerNormals() returns them.
absl::StatusOr<std::vector<std::array<float, 4>>> CornerTangents(const GltfMesh& gltf, const GltfPrimitive& primitive,
                                                                 const std::vector<float>& positions,
                                                                 const std::vector<float>& normals,
                                                                 bool normals_are_given, const std::vector<Vec2>& uv);

// Checks that these textures of a material can be resampled: no animation moves them, and the headers of their images
// can be read. Skips the images in `seen`, and adds the others to it.
absl::Status CheckGltfTextures(const GltfMesh& gltf, const OutputOptions& options, std::int64_t material,
                               const std::vector<GltfTextureUse>& uses, std::set<std::int64_t>* seen);

// The image files that the glTF refers to, and the glTF itself: new files must not overwrite them.
std::vector<std::string> FilesOfGltf(const GltfMesh& gltf);

// Whether a texture has directions in tangent space.
bool IsDirection(const GltfTextureUse& use);
// Removes an extension from the document's lists if nothing uses it any more.
void ForgetExtension(Json* root, const char* name);

}  // namespace planish
