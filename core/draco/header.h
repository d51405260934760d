// Reads the counts that a Draco file declares in its first bytes, without decoding it. Thread-safe.
#pragma once

#include <cstdint>
#include <optional>
#include <string_view>

#include "absl/status/statusor.h"

namespace planish {

enum class DracoGeometry { kPointCloud, kMesh, kUnknown };
enum class DracoMethod { kSequential, kKdTree, kEdgebreaker, kUnknown };

// The counts that the file declares. The decoded mesh may have fewer faces and vertices, or with damaged bytes more.
struct DracoCounts {
  DracoGeometry geometry = DracoGeometry::kUnknown;
  DracoMethod method = DracoMethod::kUnknown;
  // Unset if the bytes end too early, or if Draco 1.5 does not know the version, geometry or method.
  std::optional<std::int64_t> faces;  // 0 for point clouds
  // Points, for sequential data and point clouds. For Edgebreaker data the vertices of the connectivity; seams of
  // attributes make more points.
  std::optional<std::int64_t> vertices;
};

// `bytes` may be the beginning of a file. A few dozen bytes suffice, unless metadata comes first. Allocates nothing;
// takes time in proportion to the metadata, up to about a millisecond.
// INVALID_ARGUMENT, MESH_DECODE_FAILED: these are not the first bytes of Draco data.
absl::StatusOr<DracoCounts> PeekDraco(std::string_view bytes);

}  // namespace planish
