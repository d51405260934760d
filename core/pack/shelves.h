// Boxes in rows: places for very many charts when there is no time to look for good ones.
#pragma once

#include <vector>

#include "core/mesh/mesh.h"

namespace planish {

struct Shelf {
  Vec2 low = Vec2::Zero();  // corner of the box in its tile
  int tile = 0;
};

// Lays boxes of these extents side by side, tall ones first, in rows from v = 0 upwards, on up to `tiles` squares of
// side `side`. Touching, not overlapping. Empty if they do not fit. Deterministic, O(n log n).
std::vector<Shelf> LayOnShelves(const std::vector<Vec2>& extents, double side, int tiles);

}  // namespace planish
