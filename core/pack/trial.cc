#include "core/pack/trial.h"

#include <algorithm>
#include <array>
#include <bit>
#include <cmath>
#include <numbers>
#include <utility>

#include "core/pack/board.h"

namespace planish {
namespace {

constexpr int kRimCells = 24;
// Up to so many cells along either side, a chart is tried upright and at a right angle only.
constexpr int kCrumb = 6;
// What a chart costs beside the board's words, in nanoseconds: a turn, and an edge of the outline in it.
constexpr std::int64_t kSilhouetteWork = 2500, kEdgeWork = 110;

// A chart is looked for on the coarsest board on which it is at least half of so many cells long.
constexpr int kCellsOfLarge = 64;
constexpr int kLevels = 4;

// A place on one of the tiles, and where the search for the next chart of this size begins.
struct Found {
  Spot spot;
  int tile = -1, first_row = 0;
  double angle = 0;
  Silhouette silhouette;
};

// Where the search for charts of one size begins, in rows of their board.
struct Start {
  int tile = 0, row = 0;
};

// A tile as boards with cells of twice the length on each level.
class Pyramid {
 public:
  explicit Pyramid(int side) {
    for (int level = 0; level < kLevels && (side >> level) << level == side; ++level)
      boards_.emplace_back(side >> level);
  }
  int levels() const { return static_cast<int>(boards_.size()); }
  const Board& board(int level) const { return boards_[level]; }
  // (x, y): the silhouette's corner in cells of level 0.
  void Add(const Silhouette& silhouette, int x, int y) {
    for (int level = 0; level < levels(); ++level) boards_[level].Add(silhouette, x, y, level);
  }

 private:
  std::vector<Board> boards_;
};

class Trial {
 public:
  Trial(const std::vector<Outline>& outlines, const std::vector<double>& scales, const TrialGrid& grid,
        const TrialPlan& plan)
      : outlines_(outlines), scales_(scales), grid_(grid), plan_(plan), tiles_(grid.tiles, Pyramid(grid.side)) {}

  TrialResult Run(const Execution& execution, std::vector<Pose>* poses) {
    TrialResult result;
    for (const std::int32_t i : plan_.order) {
      if (execution.IsCancelled() || (plan_.gives_up && execution.IsStopRequested())) break;
      const int level = LevelOf(i);
      const Found found = Find(i, level);
      if (found.tile < 0) break;
      const Vec2 centre = Vec2(found.spot.x - Board::kMargin, found.spot.y - Board::kMargin) + found.silhouette.centre;
      (*poses)[i] = {found.angle, static_cast<double>(1 << level) * centre, found.tile};
      if (level == 0) {
        tiles_[found.tile].Add(found.silhouette, found.spot.x - Board::kMargin, found.spot.y - Board::kMargin);
      } else {
        Add(i, (*poses)[i]);
      }
      ++result.placed;
    }
    result.work = work_;
    return result;
  }

 private:
  void Add(std::int32_t i, const Pose& pose) {
    work_ += kSilhouetteWork + kEdgeWork * std::ssize(outlines_[i].edges);
    const FixedSilhouette fixed =
        MakeFixedSilhouette(outlines_[i], pose.angle, scales_[i] / grid_.cell, grid_.radius / grid_.cell, pose.centre);
    tiles_[pose.tile].Add(fixed.silhouette, fixed.x, fixed.y);
  }

  int LevelOf(std::int32_t i) const {
    const double cells = 2 * (outlines_[i].radius * scales_[i] + grid_.radius) / grid_.cell;
    int level = 0;
    while (level + 1 < tiles_[0].levels() && cells > kCellsOfLarge << level) ++level;
    return level;
  }

  Silhouette At(std::int32_t i, double angle, int level) {
    work_ += kSilhouetteWork + kEdgeWork * std::ssize(outlines_[i].edges);
    const double cell = grid_.cell * (1 << level);
    return MakeSilhouette(outlines_[i], angle, scales_[i] / cell, grid_.radius / cell);
  }
  double Angle(std::int32_t i, int turn) const {
    return outlines_[i].upright + 2 * std::numbers::pi * turn / plan_.angles;
  }

  // Of charts whose width and height are the same but for a factor of the square root of two.
  Start* StartFor(const Outline& outline, double scale, int level) {
    const Box box = BoxAt(outline, outline.upright);
    const Vec2 cells = (box.high - box.low) * (scale / grid_.cell) + Vec2::Constant(2 * grid_.radius / grid_.cell);
    const auto size = [](double extent) {
      const auto whole = static_cast<std::uint64_t>(std::clamp(extent, 1.0, 65536.0));
      return static_cast<std::size_t>(std::bit_width(whole * whole));
    };
    return &starts_[(level * kSizes + size(cells.x())) * kSizes + size(cells.y())];
  }

  Found Find(std::int32_t i, int level) {
    Start* const start = StartFor(outlines_[i], scales_[i], level);
    Found best = FindFrom(i, level, *start);
    // Charts of a size differ a little, so there may be room below.
    if (best.tile < 0 && (start->tile > 0 || start->row > 0)) best = FindFrom(i, level, {});
    if (best.tile >= 0) *start = {best.tile, best.first_row};
    return best;
  }

  Found FindFrom(std::int32_t i, int level, const Start& start) {
    Found best;
    int step = 1;
    for (int turn = 0; turn < plan_.angles; turn += step) {
      Silhouette silhouette = At(i, Angle(i, turn), level);
      if (turn == 0 && std::max(silhouette.width, silhouette.height) <= kCrumb) step = std::max(1, plan_.angles / 4);
      if (step > 1 && turn >= 2 * step) break;
      const Rim rim = MakeRim(silhouette, kRimCells);
      const int last = best.tile < 0 ? grid_.tiles - 1 : best.tile;
      for (int t = start.tile; t <= last; ++t) {
        Spot spot;
        const int first = t == start.tile ? start.row - silhouette.height : 0;
        const int row = tiles_[t].board(level).FindSpot(silhouette, rim, first, silhouette.height / 2, &spot, &work_);
        if (row < 0) continue;
        if (best.tile < 0 || t < best.tile || spot.snugness > best.spot.snugness) {
          const int first_row = best.tile == t ? std::min(best.first_row, row) : row;
          best = {spot, t, first_row, Angle(i, turn), std::move(silhouette)};
        } else {
          best.first_row = std::min(best.first_row, row);
        }
        break;
      }
    }
    return best;
  }

  static constexpr std::size_t kSizes = 40;

  const std::vector<Outline>& outlines_;
  const std::vector<double>& scales_;
  const TrialGrid& grid_;
  const TrialPlan& plan_;
  std::vector<Pyramid> tiles_;
  std::array<Start, kLevels * kSizes * kSizes> starts_;
  std::int64_t work_ = 0;
};

}  // namespace

TrialResult TryToPlace(const std::vector<Outline>& outlines, const std::vector<double>& scales, const TrialGrid& grid,
                       const TrialPlan& plan, const Execution& execution, std::vector<Pose>* poses) {
  return Trial(outlines, scales, grid, plan).Run(execution, poses);
}

}  // namespace planish
