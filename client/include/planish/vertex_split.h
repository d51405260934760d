// From UV per corner to UV per vertex, as renderers and most file formats want them.
#pragma once

#include <cstdint>
#include <new>
#include <span>
#include <vector>

#include "planish/types.h"

namespace planish::inline abi0 {

// A mesh whose vertices have one UV each. Those of the mesh that came in keep their numbers; what has several UV, at
// seams, gets a copy behind all of them for each further one. To carry an attribute over:
//
//   for (std::size_t v = 0; v < split.source_vertex.size(); ++v) normals_out[v] = normals_in[split.source_vertex[v]];
struct VertexSplit {
  std::vector<std::uint32_t> source_vertex;  // per vertex: the one that came in; 0, 1, 2, ... to begin with
  std::vector<std::uint32_t> triangles;      // three vertices per triangle, in the order that came in
  Uv uv;                                     // one (u, v) per vertex, (0, 0) for those without a triangle

  std::int64_t vertex_count() const { return static_cast<std::int64_t>(source_vertex.size()); }
};

// `triangles` has three ids below `vertex_count` per triangle and `uv` one (u, v) per corner, as UnwrapResult::uv does.
// Corners of a vertex share a new one if their UV are equal (0 and -0 alike). Needs no server, takes linear time, and
// gives the same answer for the same input. Throws planish::Error (kInvalidArgument): MESH_INDEX_OUT_OF_RANGE, and
// OPTIONS_INVALID for another number of UV.
Result<VertexSplit> SplitVertices(std::nothrow_t, std::int64_t vertex_count, std::span<const std::uint32_t> triangles,
                                  const Uv& uv);
inline VertexSplit SplitVertices(std::int64_t vertex_count, std::span<const std::uint32_t> triangles, const Uv& uv) {
  return SplitVertices(std::nothrow, vertex_count, triangles, uv).value();
}

}  // namespace planish::inline abi0
