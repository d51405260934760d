#include "planish/vertex_split.h"

#include <limits>

#include "absl/strings/str_cat.h"
#include "client/src/errors.h"
#include "client/src/mesh_packer.h"
#include "core/base/corner_split.h"

namespace planish::inline abi0 {

Result<VertexSplit> SplitVertices(std::nothrow_t, std::int64_t vertex_count, std::span<const std::uint32_t> triangles,
                                  const Uv& uv) {
  return Caught([&] {
    const std::vector<double> corner_uv = uv.As<double>();
    if (triangles.size() % 3 != 0 || corner_uv.size() != 2 * triangles.size()) {
      throw Invalid("OPTIONS_INVALID", absl::StrCat(triangles.size(), " corners of triangles and ", corner_uv.size(),
                                                    " numbers of UV do not go together: there must be two a corner"));
    }
    if (vertex_count < 0 || vertex_count + static_cast<std::int64_t>(triangles.size()) >
                                std::int64_t{std::numeric_limits<std::int32_t>::max()}) {
      throw Invalid("OPTIONS_INVALID", "too many vertices, or fewer than none");
    }
    CheckIndices(triangles, static_cast<std::size_t>(vertex_count));
    const std::vector<std::int32_t> corners(triangles.begin(), triangles.end());
    const CornerSplit split = SplitCorners(vertex_count, corners, corner_uv);
    VertexSplit result;
    result.source_vertex.assign(split.source.begin(), split.source.end());
    result.triangles.assign(split.corner.begin(), split.corner.end());
    result.uv =
        uv.precision() == Precision::kDouble ? Uv(split.uv) : Uv(std::vector<float>(split.uv.begin(), split.uv.end()));
    return result;
  });
}

}  // namespace planish::inline abi0
