// What a Draco file says of itself in its first bytes, without decoding it. Thread-safe.
#pragma once

#include <cstdint>
#include <optional>
#include <string_view>

#include "absl/status/statusor.h"

namespace planish {

enum class DracoGeometry { kPointCloud, kMesh, kUnknown };
enum class DracoMethod { kSequential, kKdTree, kEdgebreaker, kUnknown };

// As declared: what decoding gives may be less, and with damaged bytes more.
struct DracoCounts {
  DracoGeometry geometry = DracoGeometry::kUnknown;
  DracoMethod method = DracoMethod::kUnknown;
  // Unknown where the bytes end before, or belong to a version, geometry or method that Draco 1.5 does not know.
  std::optional<std::int64_t> faces;  // 0 for point clouds
  // Points of sequential data and of point clouds; vertices of the connectivity of Edgebreaker data, of which seams of
  // attributes make more points.
  std::optional<std::int64_t> vertices;
};

// `bytes` may be the beginning of a file: some dozen bytes do, unless metadata come first. Allocates nothing; takes
// time in proportion to the metadata, up to a limit of about a millisecond.
// INVALID_ARGUMENT, MESH_DECODE_FAILED: these are not the first bytes of Draco data.
absl::StatusOr<DracoCounts> PeekDraco(std::string_view bytes);

}  // namespace planish
