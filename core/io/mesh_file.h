// Reading mesh files and writing OBJ with UV.
#pragma once

#include <string>
#include <vector>

#include "absl/status/statusor.h"
#include "core/io/polygon_mesh.h"

namespace planish {

enum class MeshFormat { kObj, kPly, kOff, kStl };

struct MeshFile {
  std::string path;
  MeshFormat format = MeshFormat::kObj;
  std::string bytes;  // the file as read
  PolygonMesh mesh;
};

// Reads OBJ, PLY (ascii and binary), OFF and STL (ascii and binary; corners at exactly the same position become one
// vertex), told apart by extension.
// NOT_FOUND / PERMISSION_DENIED: FILE_UNREADABLE. INVALID_ARGUMENT: FILE_FORMAT_UNKNOWN, FILE_MALFORMED with
// metadata "line" where the format has lines; the message starts with "path:line: ".
absl::StatusOr<MeshFile> ReadMeshFile(const std::string& path);

// The text of an OBJ with UV. `corner_uv` has (u, v) per polygon corner of file.mesh. `uv_is_float` chooses the
// shortest digits that read back to the same float, or double.
// From an OBJ: the file's own bytes, except that its vt lines are replaced and the f (and l) elements refer to the
// new ones. From other formats: v, vt and f lines.
std::string WriteObjWithUv(const MeshFile& file, const std::vector<double>& corner_uv, bool uv_is_float);

// Writes `bytes` to `path` so that a reader sees the old file or the whole new one (temporary file and rename);
// "-" is stdout. PERMISSION_DENIED or UNAVAILABLE: FILE_UNWRITABLE.
absl::Status WriteFile(const std::string& path, const std::string& bytes);

}  // namespace planish
