// Colours that files have for their vertices.
#pragma once

#include <vector>

#include "absl/status/statusor.h"
#include "client/files/mesh_file.h"
#include "client/texture/texture_baker.h"

namespace planish {

// Per corner of file.mesh, in linear light; empty if the file has no colours. PLY: properties red, green, blue and
// alpha of vertices, from 0 to 255 or to 1. OBJ: "v x y z r g b", from 0 to 1, or to 255 if a number is above 1. Both
// are sRGB. glTF: COLOR_0 times the base colour factor of the material.
absl::StatusOr<std::vector<CornerColor>> VertexColors(const MeshFile& file);

}  // namespace planish
