// One UV per vertex, where a file format or a renderer knows no UV per corner.
#pragma once

#include <cstdint>
#include <span>
#include <vector>

namespace planish {

// The old vertices keep their numbers; each of their further UV becomes a copy behind all of them.
struct CornerSplit {
  std::vector<std::int32_t> source;  // per new vertex the old one; the first num_vertices are 0, 1, 2, ...
  std::vector<std::int32_t> corner;  // per corner the new vertex
  std::vector<double> uv;            // (u, v) per new vertex; 0 0 for old vertices without a corner

  std::int64_t num_vertices() const { return static_cast<std::int64_t>(source.size()); }
};

// `corner_vertex` has ids below `num_vertices`, `corner_uv` two numbers per corner. Corners of a vertex share a new one
// if their UV are equal (0 and -0 alike). Copies come in the order in which corners first use them.
CornerSplit SplitCorners(std::int64_t num_vertices, std::span<const std::int32_t> corner_vertex,
                         std::span<const double> corner_uv);

}  // namespace planish
