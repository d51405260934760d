// Writing a mesh file with UV, in its own format or another. Functions are thread-safe.
#pragma once

#include <atomic>
#include <cstdint>
#include <functional>
#include <optional>
#include <string>
#include <string_view>
#include <vector>

#include "absl/status/statusor.h"
#include "client/files/mesh_file.h"

namespace planish {

// What becomes of images that materials read with the UV that are replaced.
enum class TextureMode {
  kLeave,     // they stay as they are, and a warning names them: they no longer fit
  kTransfer,  // they are resampled into the new map (client/texture)
  kDrop,      // the references of the material are removed, and images that nothing else reads (glTF)
};

struct TextureOptions {
  TextureMode mode = TextureMode::kLeave;
  int size = 0;                // texels per side of the new images; 0: as client/texture's TextureSideOf() says
  int least_size = 1;          // of size 0: smaller images would have no free texel between charts
  std::int64_t memory = 0;     // most bytes that one image may take; 0: any number
  bool allow_outside = false;  // images may lie outside of the model's folder
  int threads = 1;
  const std::atomic<bool>* stop = nullptr;  // CANCELLED once it is true
  // What is done next: "wood.png, 2 of 5".
  std::function<void(const std::string&)> on_image;
  // Per polygon of the file which atlas it is in; empty: all are in one.
  std::vector<std::int32_t> polygon_atlas;
};

// Texels per side that no new image is larger than unless TextureOptions::size says so.
inline constexpr int kLargestAutoTexture = 8192;

struct OutputOptions {
  MeshFormat format = MeshFormat::kObj;
  std::string path;         // of the file to be: references to others are told from there; "-": stdout
  bool uv_is_float = true;  // false: the UV need double
  int texcoord = 0;         // glTF: the UV become TEXCOORD_n, in [0, 7]; need not be the set that was read
  TextureOptions textures;
};

struct OutputFile {
  std::string path;
  std::string bytes;
};

// What the caller should know about a file that was written all the same.
struct OutputWarning {
  // UV_PRECISION: rounding changed triangles. TEXTURE_UV_REPLACED: images of a material are read with the UV that were
  // replaced, and do not fit the new ones. TEXTURE_DROPPED: references to such images were removed. TEXTURE_SIZE: an
  // image would have to be larger to keep its texel density. MATERIAL_CLONED: a material is there once for each atlas.
  // TANGENTS_DROPPED: tangents belonged to the UV that were replaced.
  // POSITION_PRECISION: rounding to float moved vertices of a mesh far from the origin.
  std::string reason;
  std::string message;  // a sentence for people
};

struct WrittenMesh {
  std::vector<OutputFile> files;  // the file of the given path last, the ones it refers to first
  std::vector<OutputWarning> warnings;
};

// Whether the format has no place for UV in double. Then ask for UV in float before they are computed.
bool IsFloatByNature(MeshFormat format);

// What can be known before there are UV: INVALID_ARGUMENT with reason OUTPUT_UNSUPPORTED where the format cannot hold
// UV (STL) or lacks TEXCOORD sets below options.texcoord.
absl::Status CheckOutput(const MeshFile& file, const OutputOptions& options);

// Texels per side that the atlas of a surface of `total_area` should have, so that the densest tenth of what the images
// of `file` cover keeps its texel density, if charts fill two thirds of the atlas; 0 if no image moves.
absl::StatusOr<double> EstimateTextureSide(const MeshFile& file, const OutputOptions& options, double total_area);
// Whether images of the file's materials are read with the UV that the output replaces.
bool TexturesRead(const MeshFile& file, const OutputOptions& options);
// A set of UV that the file does not have yet; nullopt if its format has one only.
std::optional<int> FreeUvSet(const MeshFile& file);

// Paths of the material files of an OBJ and of the images that they name, from its folder.
std::vector<std::string> FilesOfObj(const std::string& path, std::string_view obj);

// The file with UV, (u, v) per corner of file.mesh with v upwards. Torn polygons become several faces, each with all
// else that the file says of the polygon. In its own format everything else is kept:
//
//   OBJ     as WriteObjWithUv (mesh_file.h). OutputOptions::textures says what becomes of images: where they move,
//   there
//           is a new material file as well.
//   PLY     encoding, elements, properties, comments. Where faces have a list "texcoord" it is rewritten; otherwise
//           vertices get "s" and "t", in place of any UV they had, and those with several UV become several vertices:
//           Blender reads UV in that form only, MeshLab and assimp in both. Copies of vertices stand behind the others;
//           comments tell readers of ours which they are (seam_copies.h), and they go when the file is written again.
//   OFF     texture coordinates of vertices (STOFF), which are split like those of PLY; all else on their lines stays.
//   glTF    everything; TEXCOORD_n of the primitives (replaced if there), whose vertices are split like those of PLY
//           with all attributes and morph targets. Tangents that belong to TEXCOORD_n are dropped, with a warning:
//           renderers compute them from the new UV. OutputOptions::textures says what becomes of images that are read
//           with TEXCOORD_n; where normal maps move, tangents of the new UV are written.
//           Draco-compressed primitives are compressed again, without loss. One buffer; between .gltf and .glb both
//           ways. References to images are rewritten to be valid from options.path.
//   Draco   attributes and metadata; TEX_COORD is replaced. Points are split like the vertices of PLY. Sequential
//           encoding: the order of faces and points stays.
//
// In another format it is the polygons (triangles for glTF and Draco) with positions, UV, and the names of materials
// and groups where the format has them; normals, colours and the like stay behind.
//
// INVALID_ARGUMENT: as CheckOutput; and UV_PRECISION for UV in double where IsFloatByNature. RESOURCE_EXHAUSTED:
// FILE_TOO_LARGE, OUT_OF_MEMORY.
absl::StatusOr<WrittenMesh> WriteMeshWithUv(const MeshFile& file, const PolygonUv& uv, const OutputOptions& options);
inline absl::StatusOr<WrittenMesh> WriteMeshWithUv(const MeshFile& file, const std::vector<double>& corner_uv,
                                                   const OutputOptions& options) {
  return WriteMeshWithUv(file, PolygonUv{corner_uv, {}}, options);
}

}  // namespace planish
