#include "core/mesh/half_edges.h"

#include <algorithm>
#include <numeric>
#include <utility>

namespace planish {

EdgeGroups GroupHalfEdges(const std::vector<Face>& faces, std::int64_t num_vertices, const Execution& execution) {
  const auto num_half_edges = static_cast<std::int32_t>(3 * faces.size());
  // A counting sort by the smaller end leaves one short list per vertex, sorted by the larger end below.
  std::vector<std::int32_t> bucket(num_vertices + 1, 0);
  for (std::int32_t c = 0; c < num_half_edges; ++c) ++bucket[std::min(Origin(faces, c), Target(faces, c)) + 1];
  std::partial_sum(bucket.begin(), bucket.end(), bucket.begin());

  struct Entry {
    std::int32_t larger_end;
    std::int32_t half_edge;
  };
  if (execution.IsStopped()) return {};
  std::vector<Entry> entries(num_half_edges);
  std::vector<std::int32_t> cursor(bucket.begin(), bucket.end() - 1);
  for (std::int32_t c = 0; c < num_half_edges; ++c) {
    const auto [low, high] = std::minmax({Origin(faces, c), Target(faces, c)});
    entries[cursor[low]++] = {high, c};
  }
  execution.For(num_vertices, [&](std::int64_t begin, std::int64_t end) {
    for (std::int64_t v = begin; v < end; ++v) {
      std::sort(entries.begin() + bucket[v], entries.begin() + bucket[v + 1], [](const Entry& a, const Entry& b) {
        return std::pair(a.larger_end, a.half_edge) < std::pair(b.larger_end, b.half_edge);
      });
    }
  });
  if (execution.IsStopped()) return {};

  EdgeGroups groups;
  groups.half_edge.reserve(num_half_edges);
  groups.begin.reserve(num_half_edges / 2 + 2);
  for (std::int64_t v = 0; v < num_vertices; ++v) {
    const auto first = entries.begin() + bucket[v], last = entries.begin() + bucket[v + 1];
    for (auto it = first; it != last; ++it) {
      groups.half_edge.push_back(it->half_edge);
      if (std::next(it) == last || std::next(it)->larger_end != it->larger_end) {
        groups.begin.push_back(static_cast<std::int32_t>(groups.half_edge.size()));
      }
    }
  }
  return groups;
}

}  // namespace planish
