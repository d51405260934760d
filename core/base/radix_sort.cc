#include "core/base/radix_sort.h"

#include <algorithm>
#include <array>
#include <cstddef>

namespace planish {

void SortByKey(std::vector<KeyedIndex>* entries) {
  constexpr int kBits = 11, kDigits = (64 + kBits - 1) / kBits;
  constexpr std::uint64_t kMask = (1 << kBits) - 1;
  // Below this, counting takes longer than comparing. Many charts have few faces.
  constexpr std::size_t kFew = 256;
  if (entries->size() <= kFew) {
    std::stable_sort(entries->begin(), entries->end(),
                     [](const KeyedIndex& a, const KeyedIndex& b) { return a.key < b.key; });
    return;
  }
  std::uint64_t differing = 0;
  for (const KeyedIndex& entry : *entries) differing |= entry.key ^ entries->front().key;
  std::vector<KeyedIndex> sorted;
  for (int digit = 0; digit < kDigits; ++digit) {
    const int shift = digit * kBits;
    if ((differing >> shift & kMask) == 0) continue;
    std::array<std::size_t, kMask + 1> place = {};
    for (const KeyedIndex& entry : *entries) ++place[entry.key >> shift & kMask];
    std::size_t begin = 0;
    for (std::size_t& p : place) {
      const std::size_t count = p;
      p = begin;
      begin += count;
    }
    sorted.resize(entries->size());
    for (const KeyedIndex& entry : *entries) sorted[place[entry.key >> shift & kMask]++] = entry;
    entries->swap(sorted);
  }
}

}  // namespace planish
