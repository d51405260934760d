// Reading mesh files, and writing OBJ with UV (client/files/mesh_output.h: every format). Functions are thread-safe;
// none depends on the locale.
#pragma once

#include <array>
#include <memory>
#include <optional>
#include <string>
#include <string_view>
#include <vector>

#include "absl/status/statusor.h"
#include "client/files/polygon_mesh.h"

namespace planish {

enum class MeshFormat { kObj, kPly, kOff, kStl, kGltf, kGlb, kDraco };

// By the end of the name, in any case: .obj, .ply, .off, .stl, .gltf, .glb, .drc.
std::optional<MeshFormat> FormatOfPath(const std::string& path);
// By what the file begins with; for STL also by its size, for OBJ by its lines. nullopt: none of these formats.
std::optional<MeshFormat> FormatOfBytes(std::string_view bytes);
// Whether `path` is "-" (stdin or stdout) or lies in /dev or /proc/self/fd: its name says nothing about a format.
bool IsStream(const std::string& path);

struct GltfMesh;  // client/files/gltf_mesh.h

// MeshFile::path of what was read from "-".
inline constexpr char kStandardInput[] = "standard input";

struct MeshFile {
  std::string path;
  MeshFormat format = MeshFormat::kObj;
  std::string bytes;  // the file as read; empty for kGlb, whose parts are in `gltf`
  PolygonMesh mesh;
  std::shared_ptr<const GltfMesh> gltf;  // the file, taken apart; for kGltf and kGlb, null otherwise
};

struct ReadOptions {
  int texcoord = 0;  // glTF: the file's UV are TEXCOORD_n
};

// Reads OBJ, PLY (ascii and binary), OFF (text), STL (ascii and binary; corners at exactly the same position become
// one vertex), glTF 2.0 as .gltf and .glb (client/files/gltf_mesh.h; the buffers it refers to as well) and Draco data
// (.drc). Of a stream (IsStream) the bytes say which; "-" is stdin, which must not be a terminal (FILE_UNREADABLE).
// Polygons have three corners or more, indices are in range; positions may be NaN or infinite. Files that were
// cut off are refused wherever the format lets one tell. NOT_FOUND / PERMISSION_DENIED / UNAVAILABLE (anything else the
// system says): FILE_UNREADABLE. INVALID_ARGUMENT: FILE_FORMAT_UNKNOWN; FILE_UNSUPPORTED (compression or references
// that we cannot follow); FILE_MALFORMED, message "path:line: what is wrong" and metadata "line" where the fault has a
// line, "path: element: what is wrong" and metadata "element" for a fault in glTF ("meshes[3].primitives[0].indices"),
// else "path: what is wrong". RESOURCE_EXHAUSTED: OUT_OF_MEMORY.
absl::StatusOr<MeshFile> ReadMeshFile(const std::string& path, const ReadOptions& options = {});

// The same of bytes in memory, in this format. Buffers that a glTF refers to are read from beside `path`.
absl::StatusOr<MeshFile> ReadMeshBytes(const std::string& path, MeshFormat format, std::string bytes,
                                       const ReadOptions& options = {});

// Which sets of UV the file has, ascending: the n of each TEXCOORD_n that some triangles of a glTF have; 0 for UV of
// other formats. Empty: none.
std::vector<int> UvSets(const MeshFile& file);

// Red, green and blue of each of mesh.material_names, from 0 to 1 as screens show them (sRGB): the base colour factor
// of a glTF. Empty: the format has none.
std::vector<std::array<double, 3>> MaterialColors(const MeshFile& file);

// The text of an OBJ with UV. `corner_uv` has (u, v) per polygon corner of file.mesh: its size must be twice that of
// file.mesh.corner_vertex. `uv_is_float`: they are rounded to float. Their digits read back to the very same numbers,
// as float and as double: with the fewer digits that are enough for a float, faces that only touch overlap for a reader
// of doubles. There is one vt per distinct (vertex, u, v), -0 counting as 0, in the order in which corners first use
// them.
//
// From an OBJ: the file's own bytes, except that the old vt lines are gone, the new ones stand in one block before the
// first face, f corners refer to them, and other elements (l, p, surf) lose their references to vt.
// From other formats: v, vt and f lines, "o" and "usemtl" where the file has groups and materials; positions have the
// shortest digits that read back to the same float, or the same double where the file held more than a float.
std::string WriteObjWithUv(const MeshFile& file, const std::vector<double>& corner_uv, bool uv_is_float);

}  // namespace planish
