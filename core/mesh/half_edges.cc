#include "core/mesh/half_edges.h"

#include <algorithm>
#include <numeric>

namespace planish {

EdgeGroups GroupHalfEdges(const std::vector<Face>& faces, std::int64_t num_vertices, const Execution& execution,
                          const std::vector<char>& takes_part) {
  const auto num_half_edges = static_cast<std::int32_t>(3 * faces.size());
  const auto is_left_out = [&](std::int32_t c) { return !takes_part.empty() && !takes_part[c / 3]; };
  // A counting sort by the smaller end gives a short list for each vertex, which is sorted by the larger end below.
  std::vector<std::int32_t> bucket(num_vertices + 1, 0);
  for (std::int32_t c = 0; c < num_half_edges; ++c) {
    if (!is_left_out(c)) ++bucket[std::min(Origin(faces, c), Target(faces, c)) + 1];
  }
  std::partial_sum(bucket.begin(), bucket.end(), bucket.begin());

  struct Entry {
    std::int32_t larger_end;
    std::int32_t half_edge;
  };
  if (execution.IsCancelled()) return {};
  std::vector<Entry> entries(bucket.back());
  std::vector<std::int32_t> cursor(bucket.begin(), bucket.end() - 1);
  for (std::int32_t c = 0; c < num_half_edges; ++c) {
    if (is_left_out(c)) continue;
    const auto [low, high] = std::minmax({Origin(faces, c), Target(faces, c)});
    entries[cursor[low]++] = {high, c};
  }
  execution.ForEach(num_vertices, [&](std::int64_t v) {
    std::sort(entries.begin() + bucket[v], entries.begin() + bucket[v + 1], [](const Entry& a, const Entry& b) {
      return std::pair(a.larger_end, a.half_edge) < std::pair(b.larger_end, b.half_edge);
    });
  });
  if (execution.IsCancelled()) return {};

  EdgeGroups groups;
  groups.item.reserve(entries.size());
  groups.begin.reserve(entries.size() / 2 + 2);
  for (std::int64_t v = 0; v < num_vertices; ++v) {
    const auto first = entries.begin() + bucket[v], last = entries.begin() + bucket[v + 1];
    for (auto it = first; it != last; ++it) {
      groups.item.push_back(it->half_edge);
      if (std::next(it) == last || std::next(it)->larger_end != it->larger_end) {
        groups.begin.push_back(static_cast<std::int32_t>(groups.item.size()));
      }
    }
  }
  return groups;
}

}  // namespace planish
