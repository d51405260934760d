// Sorting of numbers.
#pragma once

#include <algorithm>
#include <cstdint>
#include <numeric>
#include <vector>

namespace planish {

struct KeyedIndex {
  std::uint64_t key;
  std::int32_t index;
};

// Sorts by key; entries with equal keys keep their order. O(n) per 11 bits in which the keys differ, and as much memory
// again.
void SortByKey(std::vector<KeyedIndex>* entries);

// The numbers from 0 to n - 1.
inline std::vector<std::int32_t> Indices(std::size_t n) {
  std::vector<std::int32_t> indices(n);
  std::iota(indices.begin(), indices.end(), 0);
  return indices;
}

// The same, sorted: `i` before `j` if before(i, j), and where neither comes before the other, the lower one first.
template <typename Before>
std::vector<std::int32_t> SortedIndices(std::size_t n, const Before& before) {
  std::vector<std::int32_t> order = Indices(n);
  std::stable_sort(order.begin(), order.end(), before);
  return order;
}

}  // namespace planish
