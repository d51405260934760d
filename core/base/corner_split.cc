#include "core/base/corner_split.h"

#include <bit>

#include "core/base/radix_sort.h"

namespace planish {

CornerSplit SplitCorners(std::int64_t num_vertices, std::span<const std::int32_t> corner_vertex,
                         std::span<const double> corner_uv, bool fill_unused) {
  constexpr std::int32_t kLast = -1;
  CornerSplit split;
  split.source = Indices(num_vertices);
  split.uv.resize(2 * num_vertices, 0.0);
  split.corner.reserve(corner_vertex.size());
  // Per new vertex: the next copy of the same old vertex. Linked lists will do, since a vertex has few copies.
  std::vector<std::int32_t> next(num_vertices, kLast);
  std::vector<bool> is_used(num_vertices, false);
  std::vector<bool> has_corner(fill_unused ? num_vertices : 0, false);
  if (fill_unused) {
    for (const std::int32_t vertex : corner_vertex) has_corner[vertex] = true;
  }
  std::size_t unused = 0;  // all vertices before this one have a corner or became copies
  for (std::size_t c = 0; c < corner_vertex.size(); ++c) {
    const double u = corner_uv[2 * c] + 0.0;
    const double v = corner_uv[2 * c + 1] + 0.0;
    const auto has_uv = [&](std::int32_t vertex) {
      return std::bit_cast<std::uint64_t>(split.uv[2 * vertex]) == std::bit_cast<std::uint64_t>(u) &&
             std::bit_cast<std::uint64_t>(split.uv[2 * vertex + 1]) == std::bit_cast<std::uint64_t>(v);
    };
    std::int32_t vertex = corner_vertex[c];
    if (!is_used[vertex]) {
      is_used[vertex] = true;
      split.uv[2 * vertex] = u;
      split.uv[2 * vertex + 1] = v;
    }
    while (!has_uv(vertex) && next[vertex] != kLast) vertex = next[vertex];
    if (!has_uv(vertex)) {
      while (unused < has_corner.size() && has_corner[unused]) ++unused;
      const bool is_new = unused == has_corner.size();
      const std::int32_t copy = static_cast<std::int32_t>(is_new ? split.source.size() : unused++);
      if (is_new) {
        next.push_back(kLast);
        split.source.push_back(0);
        split.uv.insert(split.uv.end(), {0, 0});
      }
      next[vertex] = copy;
      split.source[copy] = corner_vertex[c];
      split.uv[2 * copy] = u;
      split.uv[2 * copy + 1] = v;
      split.has_copies = true;
      vertex = copy;
    }
    split.corner.push_back(vertex);
  }
  return split;
}

}  // namespace planish
