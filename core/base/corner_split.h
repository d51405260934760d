// Splits vertices so that each has one UV, for file formats and renderers without UV per corner.
#pragma once

#include <cstdint>
#include <span>
#include <vector>

namespace planish {

// Old vertices keep their numbers. Each further UV of a vertex becomes a copy of it, behind all old vertices.
struct CornerSplit {
  std::vector<std::int32_t> source;  // per new vertex the old one; begins with 0, 1, 2, ...
  std::vector<std::int32_t> corner;  // per corner the new vertex
  std::vector<double> uv;            // (u, v) per new vertex; 0 0 for old vertices without a corner

  bool has_copies = false;

  std::int64_t num_vertices() const { return static_cast<std::int64_t>(source.size()); }
};

// `corner_vertex` has ids below `num_vertices`, `corner_uv` two numbers per corner. Corners of a vertex with equal UV
// (0 and -0 are equal) share a new vertex. Copies are in the order in which corners first use them. With `fill_unused`,
// copies first take the places of old vertices that no corner uses. Then there are no more vertices than corners,
// unless there were before; a Draco decoder refuses more.
CornerSplit SplitCorners(std::int64_t num_vertices, std::span<const std::int32_t> corner_vertex,
                         std::span<const double> corner_uv, bool fill_unused = false);

}  // namespace planish
