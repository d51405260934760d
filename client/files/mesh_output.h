// Writes a mesh file with UV, in its own format or another. Functions are thread-safe.
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

// What to do with the images of materials that use the replaced UV.
enum class TextureMode {
  kLeave,     // unchanged; a warning lists them, as they no longer fit
  kTransfer,  // resampled into the new map (client/texture)
  kDrop,      // the material's references are removed, and images that nothing else uses (glTF)
};

// The image that is resampled next.
struct ImageProgress {
  std::string name;
  std::size_t number = 1, count = 1;  // the image's number, from 1, and the number of images
};

struct TextureOptions {
  TextureMode mode = TextureMode::kLeave;
  int size = 0;             // texels per side of the new images; 0: by client/texture's TextureSideOf()
  int least_size = 1;       // least side if size is 0: smaller images would have no free texel between charts
  std::int64_t memory = 0;  // limit for one image, in bytes; 0: no limit
  // glTF: materials that differ only in images and factors become one, with one set of images and, where their
  // attributes agree, one primitive a mesh. For kTransfer.
  bool merge_materials = false;
  // Vertex colours are painted into an image of base colours. For kTransfer.
  bool bake_colors = false;
  bool allow_outside = false;  // whether images may be outside of the model's folder
  int threads = 1;
  const std::atomic<bool>* stop = nullptr;             // once true, the call ends with CANCELLED
  std::function<void(const ImageProgress&)> on_image;  // called before each image
  // The atlas of each polygon of the file; empty if there is only one.
  std::vector<std::int32_t> polygon_atlas;
};

// Maximal side of new images, unless TextureOptions::size is set.
inline constexpr int kLargestAutoTexture = 8192;

struct OutputOptions {
  MeshFormat format = MeshFormat::kObj;
  std::string path;         // of the output file, to which references are relative; "-": stdout
  bool uv_is_float = true;  // false: the UV need double
  int texcoord = 0;         // glTF: the UV become TEXCOORD_n, which may differ from the set that was read
  TextureOptions textures;
  // glTF numbers the sets of a primitive without gaps. Whether primitives that lack sets below `texcoord` get the new
  // UV as these sets too; otherwise they are an error.
  bool fills_texcoords = false;
};

struct OutputFile {
  std::string path;
  std::string bytes;
};

// A problem of a file that was written nevertheless.
struct OutputWarning {
  // UV_PRECISION: rounding changed triangles. TEXTURE_UV_REPLACED: images of a material used the replaced UV, and do
  // not fit the new ones. TEXTURE_DROPPED: references to such images were removed, or images that a PLY names, or the
  // conversion to another format left images out. TEXTURE_SIZE: an image would have to be larger to keep its texel
  // density. MATERIAL_CLONED: a material was copied for each atlas. MATERIALS_MERGED: several materials became one.
  // MATERIAL_NOT_MERGED: a material stays apart, being animated or part of variants, or no two materials could become
  // one. COLORS_BAKED: vertex colours are in images now, and glTF lost COLOR_0. COLORS_NOT_BAKED: there are no vertex
  // colours, or they could not be painted. TANGENTS_DROPPED: tangents belonged to the replaced UV. TEXCOORDS_FILLED:
  // primitives got the new UV as other sets too. POSITION_PRECISION: rounding to float moved vertices of a mesh far
  // from the origin.
  std::string reason;
  std::string message;  // a sentence for people
};

struct WrittenMesh {
  std::vector<OutputFile> files;  // OutputOptions::path comes last, after the files that it refers to
  std::vector<OutputWarning> warnings;
};

// Whether the format can hold UV only in float, so that the UV must be requested in float.
bool IsFloatByNature(MeshFormat format);

// Checks, before there are UV, whether WriteMeshWithUv() can write them. INVALID_ARGUMENT, OUTPUT_UNSUPPORTED: the
// format cannot hold UV (STL) or does not go with the options, or a primitive lacks a TEXCOORD set below
// options.texcoord and !options.fills_texcoords. For TextureMode::kTransfer also the errors of images that cannot be
// read.
absl::Status CheckOutput(const MeshFile& file, const OutputOptions& options);

// The side in texels that the atlas of a surface of `total_area` needs so that nine tenths of the area that each image
// of `file` covers keep their texel density, if charts fill two thirds of the atlas; 0 if no image is moved.
absl::StatusOr<double> EstimateTextureSide(const MeshFile& file, const OutputOptions& options, double total_area);
// Whether images of the file's materials use the UV that the output replaces.
bool TexturesRead(const MeshFile& file, const OutputOptions& options);
// The first set of UV that no triangles of the file have; nullopt if its format has only one set. kLargestTexcoord + 1,
// which CheckOutput() refuses, if none up to kLargestTexcoord is free.
std::optional<int> FreeUvSet(const MeshFile& file);

// The paths of an OBJ's material files and of the images that these name, relative to the folder of the OBJ. `path` is
// the path of the OBJ, `obj` its text.
std::vector<std::string> FilesOfObj(const std::string& path, std::string_view obj);

// Returns the file with UV, (u, v) per corner of file.mesh with v upwards. Torn polygons become several faces, each
// with everything else that the file has for the polygon. In the file's own format everything else is kept:
//
//   OBJ     as WriteObjWithUv (mesh_file.h). OutputOptions::textures decides about images; if they are moved, there is
//           a new material file as well.
//   PLY     encoding, elements, properties, comments. Comments "TextureFile" stay only if the UV do, or for
//           TextureMode::kLeave, with a warning: images of a PLY are not resampled. A list "texcoord" of faces is
//           rewritten. Without one, vertices get "s" and "t", in place of any UV they had, and vertices with several UV
//           are split: Blender reads only UV of vertices, MeshLab and assimp read both. Copies of vertices come after
//           the others. Comments tell our readers which vertices are copies (seam_copies.h), and writing the file again
//           removes these.
//   OFF     texture coordinates of vertices (STOFF), which are split like those of PLY; the rest of their lines stays.
//   glTF    everything. TEXCOORD_n of the primitives is added or replaced; their vertices are split like those of PLY,
//           with all attributes and morph targets. Tangents that belong to TEXCOORD_n are dropped, with a warning:
//           renderers compute them from the new UV. OutputOptions::textures decides about images that are used with
//           TEXCOORD_n; if normal maps are moved, tangents of the new UV are written. Draco-compressed primitives are
//           compressed again, without loss. There is one buffer; .gltf and .glb can be converted to each other.
//           References to images are rewritten to be valid from options.path.
//   Draco   attributes and metadata; TEX_COORD is replaced. Points are split like the vertices of PLY. Sequential
//           encoding keeps the order of faces and points.
//
// Another format gets the polygons (triangles for glTF and Draco) with positions, UV, and the names of materials and
// groups if it has them; normals, colours and other data are lost.
//
// INVALID_ARGUMENT: as CheckOutput; UV_PRECISION for UV in double if IsFloatByNature. RESOURCE_EXHAUSTED:
// FILE_TOO_LARGE, OUT_OF_MEMORY.
absl::StatusOr<WrittenMesh> WriteMeshWithUv(const MeshFile& file, const PolygonUv& uv, const OutputOptions& options);
inline absl::StatusOr<WrittenMesh> WriteMeshWithUv(const MeshFile& file, const std::vector<double>& corner_uv,
                                                   const OutputOptions& options) {
  return WriteMeshWithUv(file, PolygonUv{corner_uv, {}}, options);
}

}  // namespace planish
