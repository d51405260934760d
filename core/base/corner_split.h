// One UV per vertex, where a file format or a renderer knows no UV per corner.
#pragma once

#include <cstdint>
#include <span>
#include <vector>

namespace planish {

// The old vertices keep their numbers; each of their further UV becomes a copy behind all of them.
struct CornerSplit {
  std::vector<std::int32_t> source;  // per new vertex the old one; 0, 1, 2, ... to begin with
  std::vector<std::int32_t> corner;  // per corner the new vertex
  std::vector<double> uv;            // (u, v) per new vertex; 0 0 for old vertices without a corner

  bool has_copies = false;

  std::int64_t num_vertices() const { return static_cast<std::int64_t>(source.size()); }
};

// `corner_vertex` has ids below `num_vertices`, `corner_uv` two numbers per corner. Corners of a vertex share a new one
// if their UV are equal (0 and -0 alike). Copies come in the order in which corners first use them. With `fill_unused`
// they take the places of old vertices without a corner first, so that there are never more vertices than corners
// if there were not more to begin with: a Draco decoder refuses that.
CornerSplit SplitCorners(std::int64_t num_vertices, std::span<const std::int32_t> corner_vertex,
                         std::span<const double> corner_uv, bool fill_unused = false);

}  // namespace planish
