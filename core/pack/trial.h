// Trials: attempts to place all charts on their tiles at a given scale, one after the other.
#pragma once

#include <cstdint>
#include <memory>
#include <vector>

#include "core/base/execution.h"
#include "core/pack/outline.h"

namespace planish {

struct TrialTiles {
  int tiles = 1;    // of each atlas
  int atlases = 1;  // their tiles follow one another
};

// Large charts are placed on coarser boards; this is the side of the coarsest board's cells in cells of the grid. The
// remainder of a grid beyond the last whole one is not used for such charts.
inline constexpr int kCoarsestCell = 8;

struct TrialPlan {
  std::vector<std::int32_t> order;  // of the charts, about largest first
  std::int32_t count = -1;          // only the first `count` of `order`; -1: all
  std::vector<int> turn;            // per chart the only angle it may have; -1: any. May be empty
  int angles = 8;                   // evenly spaced angles to try, from the upright one on; a multiple of 4, or below 4
  // True, for few charts: every chart is searched for from the first row on, even after a stop request. False: a stop
  // request ends the trial without a result, and the search for a chart begins at the row where the last chart of about
  // its size went. Below that row there was no room, so charts of one size search each tile only once. The first row
  // with room, at each angle, is not compared with rows beyond it. That halves the work and loses nothing among so many
  // charts (eight sets of 320 to 3,000 fill 0.672 of the texture on average either way).
  bool thorough = false;
};

struct TrialResult {
  std::size_t placed = 0;  // charts of TrialPlan::order placed before the first without a place
  double missing = 0;      // area of the charts without a place, in cells
  double filled = 0;       // of the fullest atlas: rows up to the last with a chart, over all rows of its tiles
  std::int64_t work = 0;   // nanoseconds, counted in steps of the algorithm
};

class TrialSeries {
 public:
  virtual ~TrialSeries() = default;

  // Sets the sizes for all trials until the next call, in cells of the grid: the cells along a length of 1 for each
  // chart, and half of the padding. Trials at other scales have another number of cells in a tile, so that charts keep
  // their silhouettes. Trials with the same number of angles share them.
  virtual void Resize(std::vector<double> scales, double radius) = 0;

  // Runs a trial on grids of side x side cells. Each chart goes near the lowest row with room for it, to the place with
  // the most taken cells around it. Ends as soon as the area without a place exceeds most_missing. Stores the poses of
  // placed charts in *poses, in cells from the corner of the grid.
  virtual TrialResult Run(int side, const TrialPlan& plan, double most_missing, const Execution& execution,
                          std::vector<Pose>* poses) = 0;
};

// `atlas`: the atlas of each chart. Keeps silhouettes from trial to trial if there are at most `most_kept`, each about
// a kilobyte.
std::unique_ptr<TrialSeries> MakeTrialSeries(const std::vector<Outline>& outlines, const std::vector<int>& atlas,
                                             const TrialTiles& tiles, std::size_t most_kept);

// ---- Boxes in rows: for very many charts, when there is no time to search for good places.

struct Shelf {
  Vec2 low = Vec2::Zero();  // of the box in its tile
  int tile = 0;
};

// Places boxes of these extents side by side, tall ones first, in rows from v = 0 upwards, on the tiles of their
// atlases, which are squares of side `side`. Boxes touch but do not overlap. Empty if they do not fit. Deterministic,
// O(n log n).
std::vector<Shelf> LayOnShelves(const std::vector<Vec2>& extents, const std::vector<int>& atlas,
                                const TrialTiles& tiles, double side);

}  // namespace planish
