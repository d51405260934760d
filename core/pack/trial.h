// Attempts to lay all charts on their tiles at a given scale, one after the other.
#pragma once

#include <cstdint>
#include <memory>
#include <vector>

#include "core/base/execution.h"
#include "core/pack/outline.h"

namespace planish {

struct TrialTiles {
  int tiles = 1;    // of each atlas
  int atlases = 1;  // one after the other
};

// Of the boards that large charts are looked for on: cells of the grid along one of theirs. What is left over of a grid
// beyond the last whole one is not used for such charts.
inline constexpr int kCoarsestCell = 8;

struct TrialPlan {
  std::vector<std::int32_t> order;  // of the charts, large to small about
  std::int32_t count = -1;          // so many of them, from the first on; -1: all
  std::vector<int> turn;            // of each chart, if it may have that one only; -1 otherwise. May be empty
  int angles = 8;                   // turns to try, evenly spread from the upright one on; a multiple of 4, or below 4
  // For few charts: every chart is looked for from the first row on, after a stop request too. Otherwise a stop request
  // ends the trial without a result, and a chart is looked for from the row where the last chart of about its size
  // went, since below there was no room for that one: all charts of a size together search each tile once. And the
  // first row with room for a chart, at one turn, is not compared with those beyond it, which takes half of the work
  // and gains nothing among so many charts (eight sets of 320 to 3,000 fill 0.672 of the texture in the mean either
  // way).
  bool thorough = false;
};

struct TrialResult {
  std::size_t placed = 0;  // charts of TrialPlan::order that found a place before the first that did not
  double missing = 0;      // area of the charts that found none, in cells
  double filled = 0;       // rows up to the last with a chart, over all rows of the tiles; of the fullest atlas
  std::int64_t work = 0;   // nanoseconds, counted in steps of the algorithm
};

class TrialSeries {
 public:
  virtual ~TrialSeries() = default;

  // How large the charts are for all trials until the next call, in cells of the grid that each tile is: cells along a
  // length of 1 of each chart, and half of the padding. Trials at other scales have another number of cells to a tile,
  // so that charts keep their silhouettes. Trials with the same number of turns share them.
  virtual void Resize(std::vector<double> scales, double radius) = 0;

  // On grids of side x side cells. A chart goes next to the lowest row with room for it, where it lies snuggest. Ends
  // as soon as more than most_missing of area has found no place. *poses gets those of the charts that were placed, in
  // cells from the corner of the grid.
  virtual TrialResult Run(int side, const TrialPlan& plan, double most_missing, const Execution& execution,
                          std::vector<Pose>* poses) = 0;
};

// `atlas`: whose tiles each chart goes to. Silhouettes are kept from trial to trial if there are at most `most_kept`,
// of about a kilobyte each.
std::unique_ptr<TrialSeries> MakeTrialSeries(const std::vector<Outline>& outlines, const std::vector<int>& atlas,
                                             const TrialTiles& tiles, std::size_t most_kept);

// ---- Boxes in rows: places for very many charts when there is no time to look for good ones.

struct Shelf {
  Vec2 low = Vec2::Zero();  // corner of the box in its tile
  int tile = 0;
};

// Lays boxes of these extents side by side, tall ones first, in rows from v = 0 upwards, on the tiles of their atlases,
// squares of side `side`. Touching, not overlapping. Empty if they do not fit. Deterministic, O(n log n).
std::vector<Shelf> LayOnShelves(const std::vector<Vec2>& extents, const std::vector<int>& atlas,
                                const TrialTiles& tiles, double side);

}  // namespace planish
