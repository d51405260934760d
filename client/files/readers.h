// One reader per file format, each from the bytes of a file in memory. `path` is used in error messages only.
// All of them return polygons of at least three corners with indices in range, or INVALID_ARGUMENT FILE_MALFORMED.
// Positions may be NaN or infinite. Memory stays in proportion to the bytes, whatever counts a header claims.
//
// PLY, OFF and STL are read by our own code, not by OpenMesh 9, whose readers were tried on small files with a cut,
// three changed bytes, or digits put in or taken out: of 60 such ascii PLY files 2 crashed with SIGSEGV and 17 ran for
// longer than 2 s of CPU (it believes the counts of the header), of 60 binary ones 3 and 14; OFF and STL files that
// were cut off were read without a complaint (OFF: 187 of 187, STL: 198 of 198), and one OFF file took more than 2 GB.
#pragma once

#include <string>
#include <string_view>

#include "absl/status/statusor.h"
#include "client/files/polygon_mesh.h"

namespace planish {

// A corner that refers to a vt that is not there has none: its geometry is sound, and the vt will be replaced.
absl::StatusOr<PolygonMesh> ReadObj(const std::string& path, std::string_view text);
absl::StatusOr<PolygonMesh> ReadPly(const std::string& path, std::string_view bytes);
absl::StatusOr<PolygonMesh> ReadOff(const std::string& path, std::string_view text);
absl::StatusOr<PolygonMesh> ReadStl(const std::string& path, std::string_view bytes);
// Draco data; vertices as DecodeDraco (core/draco/codec.h) finds them, UV from the first TEX_COORD attribute.
// Also RESOURCE_EXHAUSTED OUT_OF_MEMORY.
absl::StatusOr<PolygonMesh> ReadDracoFile(const std::string& path, std::string_view bytes);
// glTF: client/files/gltf_mesh.h.

}  // namespace planish
