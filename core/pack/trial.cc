#include "core/pack/trial.h"

#include <algorithm>
#include <bit>
#include <numbers>
#include <utility>

#include "core/base/radix_sort.h"
#include "core/pack/board.h"

namespace planish {
namespace {

constexpr int kRimCells = 24;
// Up to so many cells along either side, a chart is tried upright and at a right angle only.
constexpr int kCrumb = 6;
// What a chart costs beside the board's words, in nanoseconds: a silhouette and an edge of the outline in it; one that
// is turned by a right angle and a cell in it; one that is there already.
constexpr std::int64_t kSilhouetteWork = 2500, kEdgeWork = 110, kQuarterWork = 1500, kCellWork = 2, kKeptWork = 300;

constexpr int kRowsBeyond = 2;

// A chart is looked for on the coarsest board on which it is at least half of so many cells long.
constexpr int kCellsOfLarge = 64;
constexpr int kLevels = 4;
// So many silhouettes are kept at most, of about a kilobyte each.
constexpr std::size_t kMostKept = 4096;

// A chart at a turn, for the board of one level.
struct Shape {
  Silhouette silhouette;
  Rim rim;
  RowOrder row_order;
};

// A place on one of the tiles of the chart's atlas, and where the search for the next chart of this size begins.
struct Found {
  Spot spot;
  int tile = -1, first_row = 0;
  int turn = 0;
};

// Where the search for charts of one size begins, in rows of their board.
struct Start {
  int tile = 0, row = 0;
};

// A tile as boards with cells of twice the length on each level.
class Pyramid {
 public:
  explicit Pyramid(int side) {
    int levels = 1;
    while (levels < kLevels && (side >> levels) << levels == side) ++levels;
    // Longer charts are looked for on the next board: each row of cells with far fewer runs than fit in it.
    for (int level = 0; level < levels; ++level) {
      boards_.emplace_back(side >> level, level + 1 < levels ? 2 * kCellsOfLarge - 1 : side);
    }
  }
  void Clear(std::int64_t* work) {
    for (Board& board : boards_) board.Clear(work);
  }
  int levels() const { return static_cast<int>(boards_.size()); }
  const Board& board(int level) const { return boards_[level]; }
  // (x, y): the silhouette's corner in cells of level 0.
  void Add(const Silhouette& silhouette, int x, int y, std::int64_t* work) {
    for (int level = 0; level < levels(); ++level) boards_[level].Add(silhouette, x, y, level, work);
  }

 private:
  std::vector<Board> boards_;
};

}  // namespace

class TrialSeries::Impl {
 public:
  Impl(const std::vector<Outline>& outlines, const std::vector<int>& atlas, const TrialGrid& grid)
      : outlines_(outlines), atlas_(atlas), grid_(grid) {
    const int count = grid.tiles * grid.atlases;
    tiles_.reserve(count);
    for (int tile = 0; tile < count; ++tile) tiles_.emplace_back(grid.side);
  }

  TrialResult Run(const std::vector<double>& scales, const TrialPlan& plan, double most_missing,
                  const Execution& execution, std::vector<Pose>* poses) {
    Begin(scales, plan);
    TrialResult result;
    bool all = true;
    const std::size_t count = plan.count < 0 ? plan.order.size() : static_cast<std::size_t>(plan.count);
    for (std::size_t k = 0; k < count; ++k) {
      const std::int32_t i = plan.order[k];
      if (execution.IsCancelled() || (plan.gives_up && execution.IsStopRequested())) {
        result.missing = most_missing + 1;
        break;
      }
      const int level = LevelOf(i);
      const Found found = Find(i, level);
      if (found.tile < 0) {
        all = false;
        // Points have no area, but must not be missing either.
        result.missing += outlines_[i].area * shared_.scales[i] * shared_.scales[i] + 1e-30;
        if (result.missing > most_missing) break;
        continue;
      }
      Put(i, level, found, &(*poses)[i]);
      if (all) ++result.placed;
    }
    result.work = work_;
    return result;
  }

 private:
  void Begin(const std::vector<double>& scales, const TrialPlan& plan) {
    plan_ = &plan;
    work_ = 0;
    for (Pyramid& tile : tiles_) tile.Clear(&work_);
    starts_.assign(plan.thorough ? 0 : grid_.atlases * kStarts, {});
    passing_.chart = -1;
    if (shared_.scales == scales && shared_.angles == plan.angles) return;
    shared_.scales = scales;
    shared_.angles = plan.angles;
    const std::size_t slots = outlines_.size() * static_cast<std::size_t>(plan.angles);
    shared_.keeps = slots <= kMostKept;
    shared_.shapes.clear();
    shared_.fixed.clear();
    shared_.shapes.resize(shared_.keeps ? slots : 0);
    shared_.fixed.resize(shared_.keeps ? slots : 0);
  }

  void Put(std::int32_t i, int level, const Found& found, Pose* pose) {
    const Vec2 spot(found.spot.x - Board::kMargin, found.spot.y - Board::kMargin);
    const Shape& shape = At(i, found.turn, level);
    const double cells = 1 << level;
    const int tile = FirstTile(i) + found.tile;
    *pose = {Angle(i, found.turn), cells * (spot + shape.silhouette.centre), tile};
    const int x = (found.spot.x - Board::kMargin) << level, y = (found.spot.y - Board::kMargin) << level;
    if (level == 0) {
      tiles_[tile].Add(shape.silhouette, x, y, &work_);
      return;
    }
    std::unique_ptr<FixedSilhouette> own;
    std::unique_ptr<FixedSilhouette>& fixed = shared_.keeps ? shared_.fixed[Slot(i, found.turn)] : own;
    if (fixed == nullptr) {
      work_ += kSilhouetteWork + kEdgeWork * std::ssize(outlines_[i].edges);
      fixed = std::make_unique<FixedSilhouette>(
          MakeFixedSilhouette(outlines_[i], pose->angle, shared_.scales[i] / grid_.cell, grid_.radius / grid_.cell,
                              cells * shape.silhouette.centre));
      if (shared_.keeps) fixed->silhouette.spans.shrink_to_fit();
    }
    tiles_[tile].Add(fixed->silhouette, x + fixed->x, y + fixed->y, &work_);
  }

  int FirstTile(std::int32_t i) const { return atlas_[i] * grid_.tiles; }

  int LevelOf(std::int32_t i) const {
    const double cells = 2 * (outlines_[i].radius * shared_.scales[i] + grid_.radius) / grid_.cell;
    int level = 0;
    while (level + 1 < tiles_[0].levels() && cells > kCellsOfLarge << level) ++level;
    return level;
  }

  std::size_t Slot(std::int32_t i, int turn) const { return static_cast<std::size_t>(i) * shared_.angles + turn; }

  double Angle(std::int32_t i, int turn) const {
    return outlines_[i].upright + 2 * std::numbers::pi * turn / shared_.angles;
  }

  // Good until the next call, if it is not kept.
  const Shape& At(std::int32_t i, int turn, int level) {
    std::unique_ptr<Shape>& slot = shared_.keeps ? shared_.shapes[Slot(i, turn)] : passing_.shape;
    if (shared_.keeps && slot != nullptr) {
      work_ += kKeptWork;
      return *slot;
    }
    // A turn by more than a right angle is always made of the one a right angle before: a silhouette made of the
    // outline anew could lie elsewhere in its cells.
    const int quarter = shared_.angles % 4 == 0 ? shared_.angles / 4 : shared_.angles;
    auto shape = std::make_unique<Shape>();
    if (turn >= quarter) {
      const bool is_passing = !shared_.keeps && passing_.chart == i && passing_.turn == turn - quarter;
      const Shape* before = is_passing      ? passing_.shape.get()
                            : shared_.keeps ? shared_.shapes[Slot(i, turn - quarter)].get()
                                            : nullptr;
      if (before == nullptr) before = &At(i, turn - quarter, level);
      shape->silhouette = QuarterTurn(before->silhouette);
      work_ += kQuarterWork + kCellWork * shape->silhouette.cells;
    } else {
      work_ += kSilhouetteWork + kEdgeWork * std::ssize(outlines_[i].edges);
      const double cell = grid_.cell * (1 << level);
      shape->silhouette = MakeSilhouette(outlines_[i], Angle(i, turn), shared_.scales[i] / cell, grid_.radius / cell);
    }
    shape->rim = MakeRim(shape->silhouette, kRimCells);
    shape->row_order = RowOrder(shape->silhouette);
    if (shared_.keeps) shape->silhouette.spans.shrink_to_fit();
    passing_.chart = i;
    passing_.turn = turn;
    slot = std::move(shape);
    return *slot;
  }

  // Of charts of one atlas whose width and height are the same but for a factor of the square root of two.
  Start* StartFor(std::int32_t i, int level) {
    const Outline& outline = outlines_[i];
    const double scale = shared_.scales[i];
    const Box box = BoxAt(outline, outline.upright);
    const Vec2 cells = (box.high - box.low) * (scale / grid_.cell) + Vec2::Constant(2 * grid_.radius / grid_.cell);
    const auto size = [](double extent) {
      const auto whole = static_cast<std::uint64_t>(std::clamp(extent, 1.0, 65536.0));
      return static_cast<std::size_t>(std::bit_width(whole * whole));
    };
    return &starts_[atlas_[i] * kStarts + (level * kSizes + size(cells.x())) * kSizes + size(cells.y())];
  }

  Found Find(std::int32_t i, int level) {
    if (plan_->thorough) return FindFrom(i, level, {});
    Start* const start = StartFor(i, level);
    Found best = FindFrom(i, level, *start);
    // Charts of a size differ a little, so there may be room below.
    if (best.tile < 0 && (start->tile > 0 || start->row > 0)) best = FindFrom(i, level, {});
    if (best.tile >= 0) *start = {best.tile, best.first_row};
    return best;
  }

  Found FindFrom(std::int32_t i, int level, const Start& start) {
    Found best;
    const int only = plan_->turn.empty() ? -1 : plan_->turn[i];
    const int quarters = shared_.angles % 4 == 0 ? 4 : 1, quarter = shared_.angles / quarters;
    bool is_crumb = false;
    for (int k = 0; k < (only < 0 ? shared_.angles : 1) && !(is_crumb && k == 2); ++k) {
      const int turn = only < 0 ? k / quarters + k % quarters * quarter : only;
      const Shape& shape = At(i, turn, level);
      if (k == 0) is_crumb = std::max(shape.silhouette.width, shape.silhouette.height) <= kCrumb;
      const int last = best.tile < 0 ? grid_.tiles - 1 : best.tile;
      for (int t = start.tile; t <= last; ++t) {
        Spot spot;
        const int height = shape.silhouette.height, first = t == start.tile ? start.row - height : 0;
        const int last_row = best.tile == t ? best.first_row + height / kRowsBeyond : grid_.side;
        const int row = tiles_[FirstTile(i) + t].board(level).FindSpot(shape.silhouette, shape.rim, shape.row_order,
                                                                       first, last_row, height / 2, &spot, &work_);
        if (row < 0) continue;
        if (best.tile < 0 || t < best.tile || spot.snugness > best.spot.snugness) {
          const int first_row = best.tile == t ? std::min(best.first_row, row) : row;
          best = {spot, t, first_row, turn};
        } else {
          best.first_row = std::min(best.first_row, row);
        }
        break;
      }
    }
    return best;
  }

  static constexpr std::size_t kSizes = 40, kStarts = kLevels * kSizes * kSizes;

  const std::vector<Outline>& outlines_;
  const std::vector<int>& atlas_;
  const TrialGrid grid_;
  std::vector<Pyramid> tiles_;  // each trial clears them
  // What trials at the same scales and angles share: by chart and turn, unless these are too many.
  struct Shared {
    std::vector<double> scales;
    int angles = 0;
    bool keeps = false;  // the shapes
    std::vector<std::unique_ptr<Shape>> shapes;
    std::vector<std::unique_ptr<FixedSilhouette>> fixed;  // the same on level 0, at the corner of a spot
  };
  Shared shared_;
  // Of the trial under way.
  const TrialPlan* plan_ = nullptr;
  // Of a chart at a turn, as it was needed last; the shape is there if shapes are not kept.
  struct Passing {
    std::unique_ptr<Shape> shape;
    std::int32_t chart = -1;
    int turn = 0;
  };
  Passing passing_;
  std::vector<Start> starts_;  // kStarts for each atlas
  std::int64_t work_ = 0;
};

TrialSeries::TrialSeries(const std::vector<Outline>& outlines, const std::vector<int>& atlas, const TrialGrid& grid)
    : impl_(std::make_unique<Impl>(outlines, atlas, grid)) {}

TrialSeries::~TrialSeries() = default;

TrialResult TrialSeries::Run(const std::vector<double>& scales, const TrialPlan& plan, double most_missing,
                             const Execution& execution, std::vector<Pose>* poses) {
  return impl_->Run(scales, plan, most_missing, execution, poses);
}

std::vector<Shelf> LayOnShelves(const std::vector<Vec2>& extents, double side, int tiles) {
  const std::vector<std::int32_t> order =
      SortedIndices(extents.size(), [&](std::int32_t a, std::int32_t b) { return extents[a].y() > extents[b].y(); });
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
