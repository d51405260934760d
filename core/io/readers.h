// One reader per file format, each from the bytes of a file in memory. `path` is used in error messages only.
// All of them return polygons of at least three corners with indices in range, or INVALID_ARGUMENT FILE_MALFORMED.
// Positions may be NaN or infinite. Memory stays in proportion to the bytes, whatever counts a header claims.
#pragma once

#include <string>
#include <string_view>

#include "absl/status/statusor.h"
#include "core/io/polygon_mesh.h"

namespace planish {

absl::StatusOr<PolygonMesh> ReadObj(const std::string& path, std::string_view text);
absl::StatusOr<PolygonMesh> ReadPly(const std::string& path, std::string_view bytes);
absl::StatusOr<PolygonMesh> ReadOff(const std::string& path, std::string_view text);
absl::StatusOr<PolygonMesh> ReadStl(const std::string& path, std::string_view bytes);

}  // namespace planish
