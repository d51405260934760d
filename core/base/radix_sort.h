#pragma once

#include <cstdint>
#include <vector>

namespace planish {

struct KeyedIndex {
  std::uint64_t key;
  std::int32_t index;
};

// Sorts by key; entries with equal keys keep their order. O(n) per 11 bits in which the keys differ, and as much memory
// again.
void SortByKey(std::vector<KeyedIndex>* entries);

}  // namespace planish
