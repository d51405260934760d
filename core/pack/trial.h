// One attempt to lay all charts on their tiles at a given scale, from the largest to the smallest.
#pragma once

#include <cstdint>
#include <vector>

#include "core/base/execution.h"
#include "core/pack/outline.h"

namespace planish {

// Tiles as grids of side x side cells.
struct TrialGrid {
  int side = 256;  // cells
  int tiles = 1;
  double cell = 1;    // length of a cell in the texture
  double radius = 0;  // half of the padding, in the texture
};

struct TrialPlan {
  std::vector<std::int32_t> order;  // of the charts to place; all others are left out
  std::vector<std::int32_t> fixed;  // that have their place
  int angles = 8;                   // turns to try, evenly spread from the upright one on
  bool hurried = false;             // most charts are looked for from where the last one lies on, not all over the tile
  bool gives_up = false;            // in a hurry (Execution)
  double enough = 2;                // how snug a place must be to be taken without looking at others (board.h); share
};

// Where a chart's centre lies.
struct Pose {
  double angle = 0;
  Vec2 centre = Vec2::Zero();  // in cells from the corner of the tile
  int tile = 0;
};

// `scales` has what each chart is scaled by, in the texture. Returns whether all charts found a place; *poses then has
// theirs.
bool TryToPlace(const std::vector<Outline>& outlines, const std::vector<double>& scales, const TrialGrid& grid,
                const TrialPlan& plan, const Execution& execution, std::vector<Pose>* poses);

}  // namespace planish
