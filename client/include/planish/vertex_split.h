// Converts UV per corner to UV per vertex, as renderers and most file formats need them.
#pragma once

#include <cstdint>
#include <new>
#include <span>
#include <vector>

#include "planish/types.h"

namespace planish::inline abi0 {

// A mesh whose vertices have one UV each. The original vertices keep their numbers. A vertex with several UV, at a
// seam, gets a copy for each UV after the first; the copies come after all original vertices. To carry over an
// attribute:
//
//   for (std::size_t v = 0; v < split.source_vertex.size(); ++v) normals_out[v] = normals_in[split.source_vertex[v]];
struct VertexSplit {
  std::vector<std::uint32_t> source_vertex;  // per vertex: the original vertex; begins with 0, 1, 2, ...
  std::vector<std::uint32_t> triangles;      // three vertices per triangle, in the original order
  Uv uv;                                     // one (u, v) per vertex, (0, 0) for vertices without a triangle

  std::int64_t vertex_count() const { return static_cast<std::int64_t>(source_vertex.size()); }
};

// `triangles` has three ids below `vertex_count` per triangle and `uv` one (u, v) per corner, like UnwrapResult::uv.
// Corners of a vertex with equal UV (0 and -0 are equal) share a new vertex. Needs no server, takes linear time, and is
// deterministic. Throws planish::Error (kInvalidArgument): MESH_INDEX_OUT_OF_RANGE, and OPTIONS_INVALID if the number
// of UV is wrong.
Result<VertexSplit> SplitVertices(std::nothrow_t, std::int64_t vertex_count, std::span<const std::uint32_t> triangles,
                                  const Uv& uv);
inline VertexSplit SplitVertices(std::int64_t vertex_count, std::span<const std::uint32_t> triangles, const Uv& uv) {
  return SplitVertices(std::nothrow, vertex_count, triangles, uv).value();
}

}  // namespace planish::inline abi0
