// Splits vertices so that each has one UV, for file formats and renderers without UV per corner.
#pragma once

#include <cstdint>
#include <span>
#include <vector>

namespace planish {

// Old vertices keep their numbers. For each further UV of a vertex a copy of the vertex is added behind all old
// vertices, or with `fill_unused` in place of an unused one.
struct CornerSplit {
  std::vector<std::int32_t> source;  // per new vertex the old one: itself, unless it is a copy
  std::vector<std::int32_t> corner;  // per corner the new vertex
  std::vector<double> uv;            // (u, v) per new vertex; 0 0 for old vertices without a corner

  bool has_copies = false;

  std::int64_t num_vertices() const { return static_cast<std::int64_t>(source.size()); }
};

// `corner_vertex` has ids below `num_vertices`, `corner_uv` two numbers per corner. Corners of a vertex with equal UV
// (0 and -0 are equal) share a new vertex. Copies are in the order in which corners first use them. With `fill_unused`,
// copies first take the places of old vertices that no corner uses. Then there are at most max(`num_vertices`, number
// of corners) vertices. (Draco decoders refuse more vertices than corners.)
CornerSplit SplitCorners(std::int64_t num_vertices, std::span<const std::int32_t> corner_vertex,
                         std::span<const double> corner_uv, bool fill_unused = false);

}  // namespace planish
