#include "server/worker/needs.h"

#include <algorithm>

#include "absl/strings/str_cat.h"
#include "core/base/error.h"
#include "core/base/status_macros.h"
#include "core/draco/header.h"
#include "core/unwrap/estimate.h"
#include "server/worker/options.h"

namespace planish {
namespace {

// The fewest bytes that Draco uses for a triangle. If a file does not tell its number of triangles, this bounds the
// number, unless the file is malicious.
constexpr std::int64_t kLeastBytesPerTriangle = 1;

// More than any encoder produces: Draco writes a million triangles in a single point in 311 bytes, and a plane grid of
// a million triangles with coordinates of one bit in 912 bytes.
constexpr std::int64_t kMostTrianglesPerByte = 4096;

}  // namespace

absl::StatusOr<WorkNeeds> EstimateNeeds(std::string_view draco, std::int64_t mesh_bytes, const v1::MeshSize& size,
                                        const v1::UnwrapOptions& options) {
  PLANISH_ASSIGN_OR_RETURN(const UnwrapOptions core_options, ToCore(options));
  mesh_bytes = std::max<std::int64_t>(mesh_bytes, 0);
  WorkNeeds needs;
  needs.size = size;
  if (!draco.empty()) {
    PLANISH_ASSIGN_OR_RETURN(const DracoCounts counts, PeekDraco(draco));
    const std::int64_t unknown = size.triangles() > 0 ? size.triangles() : mesh_bytes / kLeastBytesPerTriangle;
    needs.size.set_triangles(counts.faces.value_or(unknown));
    // Memory is reserved by the declared counts, so they must be plausible.
    const std::int64_t bytes = std::max(mesh_bytes, static_cast<std::int64_t>(draco.size()));
    if (counts.faces.value_or(0) / kMostTrianglesPerByte > bytes) {
      return MakeError(
          absl::StatusCode::kInvalidArgument, "MESH_DECODE_FAILED",
          absl::StrCat("the mesh says that it has ", *counts.faces, " triangles, and has only ", bytes,
                       " bytes: no Draco file holds more than ", kMostTrianglesPerByte, " triangles a byte"));
    }
    needs.size.set_vertices(counts.vertices.value_or(size.vertices()));
  }
  needs.size.set_triangles(std::max<std::int64_t>(needs.size.triangles(), 0));
  if (needs.size.vertices() <= 0) needs.size.set_vertices(needs.size.triangles() / 2 + 2);
  const Estimate estimate = EstimateUnwrap(needs.size.triangles(), needs.size.vertices(), mesh_bytes, core_options);
  needs.memory_bytes = estimate.peak_bytes;
  needs.run_seconds = estimate.seconds;
  return needs;
}

}  // namespace planish
