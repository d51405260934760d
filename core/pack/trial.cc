#include "core/pack/trial.h"

#include <numbers>

#include "core/pack/board.h"

namespace planish {
namespace {

constexpr int kRimCells = 48;
constexpr int kLooks = 16;  // of so many charts one is looked for from the bottom on, when hurried

}  // namespace

bool TryToPlace(const std::vector<Outline>& outlines, const std::vector<double>& scales, const TrialGrid& grid,
                const TrialPlan& plan, const Execution& execution, std::vector<Pose>* poses) {
  std::vector<Board> boards(grid.tiles, Board(grid.side));
  for (const std::int32_t i : plan.fixed) {
    const Pose& pose = (*poses)[i];
    const FixedSilhouette fixed =
        MakeFixedSilhouette(outlines[i], pose.angle, scales[i] / grid.cell, grid.radius / grid.cell, pose.centre);
    boards[pose.tile].Add(fixed.silhouette, fixed.x + Board::kMargin, fixed.y + Board::kMargin);
  }
  int last_row = 0, placed = 0;
  for (std::size_t k = 0; k < plan.order.size();) {
    if (execution.IsStopped() || (plan.gives_up && execution.IsHurried())) return false;
    const std::int32_t i = plan.order[k];
    const bool from_last = plan.hurried && placed++ % kLooks != 0;
    Silhouette best_silhouette;
    Spot best;
    int best_tile = -1;
    double best_angle = 0;
    for (int a = 0; a < plan.angles && best.snugness < plan.enough; ++a) {
      const double angle = outlines[i].upright + 2 * std::numbers::pi * a / plan.angles;
      Silhouette silhouette = MakeSilhouette(outlines[i], angle, scales[i] / grid.cell, grid.radius / grid.cell);
      if (silhouette.width > grid.side || silhouette.height > grid.side) continue;
      const Rim rim = MakeRim(silhouette, kRimCells);
      bool better = false;
      for (int t = 0; t < grid.tiles && best.snugness < plan.enough; ++t) {
        const double before = best.snugness;
        Spot spot = best;
        boards[t].FindSpot(silhouette, rim, plan.enough, from_last ? last_row - 2 * silhouette.height : 0, &spot);
        if (spot.snugness == before && (best_tile != t || spot.x + spot.y >= best.x + best.y)) continue;
        best = spot;
        best_tile = t;
        best_angle = angle;
        better = true;
      }
      if (better) best_silhouette = std::move(silhouette);
    }
    if (best_tile < 0) {
      if (!from_last) return false;
      placed = 0;  // once more, from the bottom
      continue;
    }
    last_row = best.y;
    ++k;
    boards[best_tile].Add(best_silhouette, best.x, best.y);
    (*poses)[i] = {best_angle, Vec2(best.x - Board::kMargin, best.y - Board::kMargin) + best_silhouette.centre,
                   best_tile};
  }
  return true;
}

}  // namespace planish
