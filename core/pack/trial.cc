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
// Charts of at most this many cells along either side are tried at two angles only: upright and a right angle.
constexpr int kCrumb = 6;
// Costs in nanoseconds, beside the words of the board: making a silhouette, and each edge of its outline; rotating one
// by a right angle, and each of its cells; using one that is kept.
constexpr std::int64_t kSilhouetteWork = 2500, kEdgeWork = 110, kQuarterWork = 1500, kCellWork = 2, kKeptWork = 300;
constexpr std::int64_t kHalfWork = 800;  // rotating one by two right angles

// Places are compared up to this fraction (1 / kRowsBeyond) of the chart's height beyond the first.
constexpr int kRowsBeyond = 2;

// A chart is placed on the coarsest board on which it is at least half this many cells long.
constexpr int kCellsOfLarge = 64;
constexpr int kLevels = 4;
static_assert(kCoarsestCell == 1 << (kLevels - 1));

// A chart at one angle, for the board of one level.
struct Shape {
  Silhouette silhouette;
  Rim rim;
  Probes probes;
  bool repeats = false;  // has the same cells as the angle it was made from
};

// A place on one of the tiles of the chart's atlas, and the row where the search for the next chart of this size
// begins.
struct Found {
  Spot spot;
  int tile = -1, first_row = 0;
  int turn = 0;
};

// Where the search for charts of one size begins, in rows of their board.
struct Start {
  int tile = 0, row = 0;
};

// A tile as boards, with cells of twice the length on each level. The remainder of the grid beyond the last whole cell
// of a level is not used on that level.
using Pyramid = std::vector<Board>;

class Series final : public TrialSeries {
 public:
  Series(const std::vector<Outline>& outlines, const std::vector<int>& atlas, const TrialTiles& tiles,
         std::size_t most_kept)
      : outlines_(outlines), atlas_(atlas), count_(tiles), most_kept_(most_kept) {}

  void Resize(std::vector<double> scales, double radius) override {
    scales_ = std::move(scales);
    radius_ = radius;
    shared_ = {};
  }

  TrialResult Run(int side, const TrialPlan& plan, double most_missing, const Execution& execution,
                  std::vector<Pose>* poses) override {
    Begin(side, plan);
    TrialResult result;
    bool all = true;
    const std::size_t count = plan.count < 0 ? plan.order.size() : static_cast<std::size_t>(plan.count);
    for (std::size_t k = 0; k < count; ++k) {
      const std::int32_t i = plan.order[k];
      if (execution.IsCancelled() || (!plan.thorough && execution.IsStopRequested())) {
        result.missing = most_missing + 1;
        break;
      }
      const int level = LevelOf(i);
      const Found found = Find(i, level);
      if (found.tile < 0) {
        all = false;
        // Points have no area, but must count as missing.
        result.missing += outlines_[i].area * scales_[i] * scales_[i] + 1e-30;
        if (result.missing > most_missing) break;
        continue;
      }
      Put(i, level, found, &(*poses)[i]);
      if (all) ++result.placed;
    }
    result.filled = filled_;
    result.work = work_;
    return result;
  }

 private:
  void Begin(int side, const TrialPlan& plan) {
    constexpr int kRoom = 16;  // later grids may be larger by the side / kRoom
    plan_ = &plan;
    work_ = 0;
    filled_ = 0;
    side_ = side;
    if (side > most_side_) {
      most_side_ = side + side / kRoom;
      const std::size_t tiles = static_cast<std::size_t>(count_.tiles) * count_.atlases;
      tiles_.clear();
      tiles_.reserve(tiles);
      while (tiles_.size() < tiles) {
        Pyramid& boards = tiles_.emplace_back();
        // Longer charts are placed on the next board, so each row needs far fewer levels of runs.
        for (int level = 0; level < kLevels; ++level) {
          boards.emplace_back(most_side_ >> level, level + 1 < kLevels ? 2 * kCellsOfLarge - 1 : most_side_);
        }
      }
    }
    for (Pyramid& boards : tiles_) {
      for (int level = 0; level < kLevels; ++level) boards[level].Clear(side >> level, &work_);
    }
    starts_.assign(plan.thorough ? 0 : count_.atlases * kStarts, {});
    if (shared_.angles == plan.angles) return;
    const std::size_t slots = outlines_.size() * static_cast<std::size_t>(plan.angles);
    shared_ = {};
    shared_.angles = plan.angles;
    shared_.keeps = slots <= most_kept_;
    shared_.shapes.resize(shared_.keeps ? slots : plan.angles);
    shared_.fixed.resize(shared_.keeps ? slots : 0);
  }

  void Put(std::int32_t i, int level, const Found& found, Pose* pose) {
    const Vec2 spot(found.spot.x - Board::kMargin, found.spot.y - Board::kMargin);
    const Shape& shape = At(i, found.turn, level);
    const double cells = 1 << level;
    const int tile = FirstTile(i) + found.tile;
    *pose = {cells * (spot + shape.silhouette.centre), Angle(i, found.turn), tile};
    const double last_row = cells * (spot.y() + shape.silhouette.height) / side_;
    filled_ = std::max(filled_, (found.tile + last_row) / count_.tiles);
    int x = (found.spot.x - Board::kMargin) << level, y = (found.spot.y - Board::kMargin) << level;
    const Silhouette* silhouette = &shape.silhouette;  // on level 0
    std::unique_ptr<FixedSilhouette> own;
    if (level > 0) {
      std::unique_ptr<FixedSilhouette>& fixed = shared_.keeps ? shared_.fixed[SlotOf(i, found.turn)] : own;
      if (fixed == nullptr) {
        work_ += kSilhouetteWork + kEdgeWork * std::ssize(outlines_[i].edges);
        fixed = std::make_unique<FixedSilhouette>(
            MakeFixedSilhouette(outlines_[i], pose->angle, scales_[i], radius_, cells * shape.silhouette.centre));
        if (shared_.keeps) fixed->silhouette.spans.shrink_to_fit();
      }
      silhouette = &fixed->silhouette;
      x += fixed->x;
      y += fixed->y;
    }
    for (int l = 0; l < kLevels; ++l) tiles_[tile][l].Add(*silhouette, x, y, l, &work_);
  }

  int FirstTile(std::int32_t i) const { return atlas_[i] * count_.tiles; }

  int LevelOf(std::int32_t i) const {
    const double cells = 2 * (outlines_[i].radius * scales_[i] + radius_);
    int level = 0;
    while (level + 1 < kLevels && cells > kCellsOfLarge << level) ++level;
    return level;
  }

  double Angle(std::int32_t i, int turn) const {
    return outlines_[i].upright + 2 * std::numbers::pi * turn / shared_.angles;
  }

  std::size_t SlotOf(std::int32_t i, int turn) const {
    return (shared_.keeps ? static_cast<std::size_t>(i) * shared_.angles : 0) + turn;
  }

  // The shape is valid until another chart is asked for, unless shapes are kept.
  const Shape& At(std::int32_t i, int turn, int level) {
    if (!shared_.keeps && shared_.chart != i) {
      for (std::unique_ptr<Shape>& shape : shared_.shapes) shape.reset();
      shared_.chart = i;
    }
    std::unique_ptr<Shape>& slot = shared_.shapes[SlotOf(i, turn)];
    if (slot == nullptr) {
      slot = std::make_unique<Shape>(MakeShape(i, turn, level));
    } else {
      work_ += kKeptWork;
    }
    return *slot;
  }

  // Silhouettes at angles that differ by right angles are made from each other: one made from the outline could lie
  // differently in its cells.
  Shape MakeShape(std::int32_t i, int turn, int level) {
    const int half = shared_.angles % 2 == 0 ? shared_.angles / 2 : shared_.angles;
    const int quarter = shared_.angles % 4 == 0 ? half / 2 : half;
    Shape shape;
    if (turn >= quarter) {
      const Silhouette& before = At(i, turn - (turn >= half ? half : quarter), level).silhouette;
      shape.silhouette = turn >= half ? HalfTurn(before) : QuarterTurn(before);
      shape.repeats = shape.silhouette.HasSameCells(before);
      work_ += turn >= half ? kHalfWork : kQuarterWork + kCellWork * shape.silhouette.cells;
    } else {
      work_ += kSilhouetteWork + kEdgeWork * std::ssize(outlines_[i].edges);
      const double cell = 1 << level;
      shape.silhouette = MakeSilhouette(outlines_[i], Angle(i, turn), scales_[i] / cell, radius_ / cell);
    }
    shape.rim = MakeRim(shape.silhouette, kRimCells);
    shape.probes = Probes(shape.silhouette);
    if (shared_.keeps) shape.silhouette.spans.shrink_to_fit();
    return shape;
  }

  // Charts of one atlas share a start if their widths and their heights are equal up to a factor of about the square
  // root of two.
  Start* StartFor(std::int32_t i, int level) {
    const Outline& outline = outlines_[i];
    const Box box = BoxAt(outline, outline.upright);
    const Vec2 cells = (box.high - box.low) * scales_[i] + Vec2::Constant(2 * radius_);
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
    // The start is for charts of similar size, so chart i may still fit below it.
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
      if (shape.repeats && only < 0) continue;
      if (k == 0) is_crumb = std::max(shape.silhouette.width, shape.silhouette.height) <= kCrumb;
      const int last = best.tile < 0 ? count_.tiles - 1 : best.tile;
      for (int t = start.tile; t <= last; ++t) {
        Spot spot;
        const int height = shape.silhouette.height, first = t == start.tile ? start.row - height : 0;
        const int beyond = height / kRowsBeyond, last_row = best.tile == t ? best.first_row + beyond : side_;
        const int row = tiles_[FirstTile(i) + t][level].FindSpot(shape.silhouette, shape.rim, shape.probes, first,
                                                                 last_row, plan_->thorough ? beyond : 0, &spot, &work_);
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
  const TrialTiles count_;
  const std::size_t most_kept_;
  std::vector<double> scales_;  // of each chart
  double radius_ = 0;
  std::vector<Pyramid> tiles_;  // most_side_ cells wide; cleared by each trial
  int most_side_ = 0;
  // Shared by trials with the same sizes and number of angles.
  struct Shared {
    int angles = 0;
    bool keeps = false;                                   // whether shapes of all charts are kept, by chart and angle
    std::vector<std::unique_ptr<Shape>> shapes;           // if not kept, those of one chart
    std::vector<std::unique_ptr<FixedSilhouette>> fixed;  // of shapes on coarser levels: on level 0; if kept
    std::int32_t chart = -1;                              // the chart of these shapes, if they are not kept
  };
  Shared shared_;
  // State of the current trial.
  const TrialPlan* plan_ = nullptr;
  int side_ = 0;
  std::vector<Start> starts_;  // kStarts for each atlas
  double filled_ = 0;          // TrialResult::filled
  std::int64_t work_ = 0;
};

}  // namespace

std::unique_ptr<TrialSeries> MakeTrialSeries(const std::vector<Outline>& outlines, const std::vector<int>& atlas,
                                             const TrialTiles& tiles, std::size_t most_kept) {
  return std::make_unique<Series>(outlines, atlas, tiles, most_kept);
}

std::vector<Shelf> LayOnShelves(const std::vector<Vec2>& extents, const std::vector<int>& atlas,
                                const TrialTiles& tiles, double side) {
  const std::vector<std::int32_t> order =
      SortedIndices(extents.size(), [&](std::int32_t a, std::int32_t b) { return extents[a].y() > extents[b].y(); });
  std::vector<Shelf> shelves(extents.size());
  struct Row {
    Vec2 end = Vec2::Zero();
    double height = 0;
    int tile = 0;
  };
  std::vector<Row> rows(tiles.atlases);  // the last row of each atlas
  for (const std::int32_t i : order) {
    const Vec2& extent = extents[i];
    if (extent.x() > side || extent.y() > side) return {};
    Row& row = rows[atlas[i]];
    if (row.end.x() + extent.x() > side) row = {Vec2(0, row.end.y() + row.height), 0, row.tile};
    if (row.end.y() + extent.y() > side) row = {Vec2::Zero(), 0, row.tile + 1};
    if (row.tile == tiles.tiles) return {};
    shelves[i] = {row.end, atlas[i] * tiles.tiles + row.tile};
    row.end.x() += extent.x();
    row.height = std::max(row.height, extent.y());
  }
  return shelves;
}

}  // namespace planish
