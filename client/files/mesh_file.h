// Reads mesh files, and writes OBJ with UV (for other formats see client/files/mesh_output.h). Functions are
// thread-safe and do not depend on the locale.
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

// The format of a path by its extension, in upper or lower case: .obj, .ply, .off, .stl, .gltf, .glb, .drc. nullopt for
// any other.
std::optional<MeshFormat> FormatOfPath(const std::string& path);
// The format of a file by its first bytes; STL also by the size, OBJ by a line. nullopt: none of these formats.
std::optional<MeshFormat> FormatOfBytes(std::string_view bytes);
// Whether `path` is "-" (stdin or stdout) or in /dev or /proc/self/fd, so that its name does not tell the format.
bool IsStream(const std::string& path);

struct GltfMesh;  // client/files/gltf_mesh.h

// MeshFile::path for input from "-".
inline constexpr char kStandardInput[] = "standard input";

struct MeshFile {
  std::string path;
  MeshFormat format = MeshFormat::kObj;
  std::string bytes;  // the file as read; empty for kGlb, whose parts are in `gltf`
  PolygonMesh mesh;
  std::shared_ptr<const GltfMesh> gltf;  // the parsed file, for kGltf and kGlb; null otherwise
};

// glTF: the largest n of a TEXCOORD_n that is read or written. glTF itself has no limit.
inline constexpr int kLargestTexcoord = 63;

struct ReadOptions {
  int texcoord = 0;  // glTF: the n of the TEXCOORD_n that is read as UV
};

// Reads OBJ, PLY (ascii and binary), OFF (text), STL (ascii and binary; corners at exactly the same position become one
// vertex), glTF 2.0 as .gltf and .glb (client/files/gltf_mesh.h; with the buffers that it refers to) and Draco data
// (.drc). For a stream (IsStream) the bytes determine the format; "-" is stdin, which must not be a terminal
// (FILE_UNREADABLE). Polygons have three or more corners, and indices are in range; positions may be NaN or infinite.
// Truncated files are refused if the format allows detecting them. NOT_FOUND / PERMISSION_DENIED / UNAVAILABLE (any
// other system error): FILE_UNREADABLE. INVALID_ARGUMENT: FILE_FORMAT_UNKNOWN; FILE_UNSUPPORTED (compression or
// references that we cannot read); FILE_MALFORMED, with the message "path:line: what is wrong" and metadata "line" if
// the fault has a line, "path: element: what is wrong" and metadata "element" for a fault in glTF
// ("meshes[3].primitives[0].indices"), else "path: what is wrong". RESOURCE_EXHAUSTED: OUT_OF_MEMORY.
absl::StatusOr<MeshFile> ReadMeshFile(const std::string& path, const ReadOptions& options = {});

// As ReadMeshFile(), for bytes in memory in this format. Buffers that a glTF refers to are read from beside `path`.
absl::StatusOr<MeshFile> ReadMeshBytes(const std::string& path, MeshFormat format, std::string bytes,
                                       const ReadOptions& options = {});

// The sets of UV in the file, ascending: the n of each TEXCOORD_n that some triangles of a glTF have; 0 for UV of other
// formats. Empty if there are none.
std::vector<int> UvSets(const MeshFile& file);

// Red, green and blue of each of mesh.material_names, from 0 to 1 in sRGB: the base colour factor of a glTF. Empty for
// other formats.
std::vector<std::array<double, 3>> MaterialColors(const MeshFile& file);

// The text of an OBJ with UV. `corner_uv` has (u, v) per polygon corner of file.mesh: its size must be twice that of
// file.mesh.corner_vertex. `uv_is_float`: rounds them to float. The digits read back to exactly the same numbers, as
// float and as double. (The shortest digits of a float would make touching faces overlap for a reader of doubles.)
// There is one vt per distinct (vertex, u, v), where -0 equals 0, in the order in which corners first use them.
//
// From an OBJ: the file's own bytes, except that the old vt lines are removed, the new ones are in one block before the
// first face, f corners refer to them, and other elements (l, p, surf) lose their references to vt. From other formats:
// v, vt and f lines, with "o" and "usemtl" if the file has groups and materials. Positions have the shortest digits
// that read back to the same float, or to the same double if the file had more precision.
std::string WriteObjWithUv(const MeshFile& file, const std::vector<double>& corner_uv, bool uv_is_float);

}  // namespace planish
