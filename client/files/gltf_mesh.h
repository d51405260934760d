// The triangles of a glTF file, and the glTF vertex of each corner. Used only in client/files.
#pragma once

#include <cstdint>
#include <memory>
#include <optional>
#include <string>
#include <vector>

#include "absl/status/statusor.h"
#include "client/files/gltf_accessor.h"
#include "client/files/gltf_document.h"
#include "client/files/polygon_mesh.h"
#include "core/draco/points.h"

namespace planish {

// Vertices shared by primitives of one mesh that have the same attributes and morph targets.
struct GltfPool {
  std::int64_t num_vertices = 0;
  // The decoded points, if the primitive uses KHR_draco_mesh_compression.
  std::optional<DracoPoints> draco;
};

struct GltfPrimitive {
  std::size_t mesh = 0;
  std::size_t primitive = 0;
  std::size_t pool = 0;
  std::int64_t first_polygon = 0;
  std::int64_t num_polygons = 0;
  bool is_list = true;  // false: a strip or a fan
};

struct GltfMesh {
  GltfDocument document;
  std::vector<GltfPool> pools;
  std::vector<GltfPrimitive> primitives;    // those of triangles, in the order of the file
  std::vector<std::int32_t> corner_vertex;  // per corner of the polygon mesh: vertex of the primitive's pool
};

constexpr char kDracoExtension[] = "KHR_draco_mesh_compression";

// The JSON of a primitive.
Json& PrimitiveJson(Json& root, const GltfPrimitive& primitive);
const Json& PrimitiveJson(const Json& root, const GltfPrimitive& primitive);
// The Draco extension in the JSON of a primitive, or null.
const Json* DracoJson(const Json& primitive);

// Parses a glTF or GLB file and checks every accessor used by a primitive of triangles, so that writing the file cannot
// fail on them. The polygons are the triangles of all meshes, each mesh once, whatever nodes show it. Triangles of
// strips and fans with two equal indices, which join strips, are left out. Vertices of a mesh at the same position (to
// the bit) become one.
// Positions are those of the mesh, without node transformations. UV are those of TEXCOORD_`texcoord`. Materials and
// meshes become the materials and groups of the polygons.
absl::StatusOr<PolygonMesh> ReadGltf(const std::string& path, std::string_view bytes, int texcoord,
                                     std::shared_ptr<const GltfMesh>* gltf);

}  // namespace planish
