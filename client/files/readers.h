// One reader per file format, each from the bytes of a file in memory. `path` is used only in error messages. All
// return polygons of at least three corners with indices in range, or INVALID_ARGUMENT FILE_MALFORMED. Positions may be
// NaN or infinite. Memory is in proportion to the bytes, whatever counts a header claims.
//
// PLY, OFF and STL have readers of our own instead of those of OpenMesh 9. These were tried on small files that were
// truncated, had three bytes changed, or digits inserted or removed. Of 60 such ascii PLY files 2 crashed with SIGSEGV
// and 17 took more than 2 s of CPU (the header's counts are trusted), of 60 binary ones 3 and 14. Truncated OFF and STL
// files were accepted (OFF: 187 of 187, STL: 198 of 198), and one OFF file took more than 2 GB.
#pragma once

#include <string>
#include <string_view>

#include "absl/status/statusor.h"
#include "client/files/polygon_mesh.h"

namespace planish {

// A corner that refers to a missing vt is read as a corner without UV: unwrapping replaces the UV anyway.
absl::StatusOr<PolygonMesh> ReadObj(const std::string& path, std::string_view text);
absl::StatusOr<PolygonMesh> ReadPly(const std::string& path, std::string_view bytes);
absl::StatusOr<PolygonMesh> ReadOff(const std::string& path, std::string_view text);
absl::StatusOr<PolygonMesh> ReadStl(const std::string& path, std::string_view bytes);
// Draco data; vertices as in DecodeDraco (core/draco/codec.h), UV from the first TEX_COORD attribute. Also
// RESOURCE_EXHAUSTED OUT_OF_MEMORY.
absl::StatusOr<PolygonMesh> ReadDracoFile(const std::string& path, std::string_view bytes);
// For glTF see ReadGltf() (client/files/gltf_mesh.h).

}  // namespace planish
