#include "core/pack/shelves.h"

#include <algorithm>
#include <cstdint>
#include <numeric>

namespace planish {

std::vector<Shelf> LayOnShelves(const std::vector<Vec2>& extents, double side, int tiles) {
  std::vector<std::int32_t> order(extents.size());
  std::iota(order.begin(), order.end(), 0);
  std::stable_sort(order.begin(), order.end(),
                   [&](std::int32_t a, std::int32_t b) { return extents[a].y() > extents[b].y(); });
  std::vector<Shelf> shelves(extents.size());
  Vec2 at = Vec2::Zero();
  double row = 0;
  int tile = 0;
  for (const std::int32_t i : order) {
    const Vec2& extent = extents[i];
    if (extent.x() > side || extent.y() > side) return {};
    if (at.x() + extent.x() > side) {
      at = Vec2(0, at.y() + row);
      row = 0;
    }
    if (at.y() + extent.y() > side) {
      at = Vec2::Zero();
      row = 0;
      ++tile;
    }
    if (tile == tiles) return {};
    shelves[i] = {at, tile};
    at.x() += extent.x();
    row = std::max(row, extent.y());
  }
  return shelves;
}

}  // namespace planish
