// Sorting and grouping of numbers.
#pragma once

#include <algorithm>
#include <cstdint>
#include <numeric>
#include <span>
#include <vector>

namespace planish {

struct KeyedIndex {
  std::uint64_t key;
  std::int32_t index;
};

// Sorts by key; stable. O(n) for every 11 bits in which the keys differ. Needs memory for a copy of the entries.
void SortByKey(std::vector<KeyedIndex>* entries);

// The numbers from 0 to n - 1.
inline std::vector<std::int32_t> Indices(std::size_t n) {
  std::vector<std::int32_t> indices(n);
  std::iota(indices.begin(), indices.end(), 0);
  return indices;
}

// The numbers from 0 to n - 1, stably sorted by `before`.
template <typename Before>
std::vector<std::int32_t> SortedIndices(std::size_t n, const Before& before) {
  std::vector<std::int32_t> order = Indices(n);
  std::stable_sort(order.begin(), order.end(), before);
  return order;
}

// Numbers in groups, one behind the other.
struct Groups {
  std::vector<std::int32_t> item;
  std::vector<std::int32_t> begin = {0};  // where each group begins in `item`, and the end

  std::int32_t count() const { return static_cast<std::int32_t>(begin.size()) - 1; }
  std::span<const std::int32_t> operator[](std::int32_t i) const {
    return {item.data() + begin[i], static_cast<std::size_t>(begin[i + 1] - begin[i])};
  }
};

// Groups the numbers i from 0 to n - 1 by key(i) in [0, num_keys), each group ascending. Numbers with a negative key
// are left out. O(n).
template <typename Key>
Groups GroupByKey(std::int32_t n, std::int64_t num_keys, const Key& key) {
  Groups groups;
  groups.begin.assign(num_keys + 1, 0);
  for (std::int32_t i = 0; i < n; ++i) {
    if (const std::int32_t k = key(i); k >= 0) ++groups.begin[k + 1];
  }
  std::partial_sum(groups.begin.begin(), groups.begin.end(), groups.begin.begin());
  groups.item.resize(groups.begin.back());
  std::vector<std::int32_t> end(groups.begin.begin(), groups.begin.end() - 1);
  for (std::int32_t i = 0; i < n; ++i) {
    if (const std::int32_t k = key(i); k >= 0) groups.item[end[k]++] = i;
  }
  return groups;
}

}  // namespace planish
