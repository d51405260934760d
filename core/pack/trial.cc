#include "core/pack/trial.h"

#include <numbers>

#include "core/pack/board.h"

namespace planish {
namespace {

constexpr int kRimCells = 48;

}  // namespace

bool TryToPlace(const std::vector<Outline>& outlines, const std::vector<double>& scales, const TrialGrid& grid,
                const TrialPlan& plan, const Execution& execution, std::vector<Pose>* poses) {
  std::vector<Board> boards(grid.tiles, Board(grid.side));
  for (const std::int32_t i : plan.fixed) {
    const Pose& pose = (*poses)[i];
    const FixedSilhouette fixed = MakeFixedSilhouette(outlines[i], pose.angle, scales[i] / grid.cell, grid.radius / grid.cell, pose.centre);
    boards[pose.tile].Add(fixed.silhouette, fixed.x + Board::kMargin, fixed.y + Board::kMargin);
  }
  for (const std::int32_t i : plan.order) {
    if (execution.IsStopped()) return false;
    Silhouette best_silhouette;
    Spot best;
    int best_tile = -1;
    double best_angle = 0;
    for (int a = 0; a < plan.angles; ++a) {
      const double angle = outlines[i].upright + plan.turn + 2 * std::numbers::pi * a / plan.angles;
      Silhouette silhouette = MakeSilhouette(outlines[i], angle, scales[i] / grid.cell, grid.radius / grid.cell);
      if (silhouette.width > grid.side || silhouette.height > grid.side) continue;
      const Rim rim = MakeRim(silhouette, kRimCells);
      bool better = false;
      for (int t = 0; t < grid.tiles; ++t) {
        const double before = best.snugness;
        Spot spot = best;
        boards[t].FindSpot(silhouette, rim, &spot);
        if (spot.snugness == before && (best_tile != t || spot.x + spot.y >= best.x + best.y)) continue;
        best = spot;
        best_tile = t;
        best_angle = angle;
        better = true;
      }
      if (better) best_silhouette = std::move(silhouette);
    }
    if (best_tile < 0) return false;
    boards[best_tile].Add(best_silhouette, best.x, best.y);
    (*poses)[i] = {best_angle, Vec2(best.x - Board::kMargin, best.y - Board::kMargin) + best_silhouette.centre, best_tile};
  }
  return true;
}

}  // namespace planish
