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
  std::vector<std::int32_t> order;  // of the charts, large to small
  int angles = 8;                   // turns to try, evenly spread from the upright one on
  bool gives_up = false;            // after a stop request
};

// Where a chart's centre lies.
struct Pose {
  double angle = 0;
  Vec2 centre = Vec2::Zero();  // in cells from the corner of the tile
  int tile = 0;
};

struct TrialResult {
  std::size_t placed = 0;  // charts of TrialPlan::order that found a place before the first that did not
  std::int64_t work = 0;   // nanoseconds, counted in steps of the algorithm
};

// A chart goes next to the lowest row with room for it, where it lies snuggest. The search begins at the row where the
// last chart of about its size went, since below there was no room for that one: all charts of a size together search
// each tile once. `scales` has what each chart is scaled by, in the texture. *poses gets those of the charts that were
// placed.
TrialResult TryToPlace(const std::vector<Outline>& outlines, const std::vector<double>& scales, const TrialGrid& grid,
                       const TrialPlan& plan, const Execution& execution, std::vector<Pose>* poses);

}  // namespace planish
