// Charts into a texture: turns, moves and scales them so that none comes near another.
#pragma once

#include <cstdint>
#include <vector>

#include "core/base/execution.h"
#include "core/mesh/mesh.h"
#include "core/pack/tuning.h"

namespace planish {

// What the search for places may cost. Work is counted, not timed, so that the result is the same on any machine; the
// times here are those of a core of the year 2022.
enum class PackEffort {
  kFast,    // about a quarter of what the charts and their maps cost
  kNormal,  // about half of that, or 20 ms where that is more
  kBest,    // a hundred times kNormal, for the last per cent
};
// What packing may cost over what the charts and their maps cost.
double ShareOfRest(PackEffort effort, const PackTuning& tuning = {});

// Tiles lie as UDIM has them: this many side by side, then the next row above.
inline constexpr int kTilesInRow = 10;

struct PackOptions {
  int texture_size = 1024;  // texels per side of a tile, in [16, 65536]
  int padding = 2;  // texels that stay free between two charts, in [0, 64]; half as many (rounded up) at the rim
  int tiles = 1;    // as many as may be used, in [1, 100]; tile t is UDIM 1001 + t, up to 10 in a row
  int atlases = 1;  // with so many tiles each: those of atlas a are a * tiles and following; in [1, 100] all together
  PackEffort effort = PackEffort::kNormal;
  PackTuning tuning = {};
};

// One chart in the plane, drawn to the scale of the surface.
struct PackChart {
  std::vector<Vec2> positions;
  std::vector<Face> faces;  // counter-clockwise
  double density = 1;       // length in the texture over length here, relative to the other charts; above 0
  int atlas = 0;            // whose tiles it goes to, in [0, PackOptions::atlases)
};

// Where a chart goes: p becomes scale * (R p) + offset, R being the turn by `angle` (radians, counter-clockwise).
struct ChartPlacement {
  double angle = 0;
  double scale = 1;
  Vec2 offset = Vec2::Zero();  // tile included: tile t spans [t % 10, t % 10 + 1] x [t / 10, t / 10 + 1]
  int tile = 0;

  Vec2 operator()(const Vec2& p) const;
};
// The lower left corner of a tile.
Vec2 CornerOfTile(int tile);

struct Packing {
  std::vector<ChartPlacement> charts;  // in the order given
  int tiles = 1;                       // up to the last that is used
  double scale = 1;                    // of a chart with density 1
  double padding = 0;                  // texels kept: options.padding, or less where the charts are too many for that
  double efficiency = 0;               // area of the faces over that of the tiles used
};

// How: charts are laid one after the other, from large to small, each where it lies snuggest, on bit grids (trial.h),
// at one scale after the other. With the work that is left, and charts that are not too many for it, the scale goes up,
// and charts find new places, are pushed apart and grow until they are jammed, again and again (tighten.h). Lengths
// that count are exact in the end (clearance.h). libnest2d, which Debian has, lays polygons of a given scale at turns
// from a given list, by their convex hulls unless told otherwise: not enough.
//
// Atlases are packed together, at one scale, which the fullest of them decides.
//
// The largest scale that was found at which all charts fit. Distances of `padding` texels and a little more (so that
// they outlast rounding to float) are kept between any two charts; faces inside of one chart may lie as they like, on
// each other too. Charts that would be smaller than a texel are enlarged to one, or to what there is room for.
//
// Deterministic; the same result for any number of threads, wherever the charts lie. Work is near-linear in the charts.
// No reflections. After a stop request the first places that keep the distances stand. Of no use after a cancellation.
// Positions must be finite.
Packing Pack(const std::vector<PackChart>& charts, const PackOptions& options, const Execution& execution = {});

}  // namespace planish
