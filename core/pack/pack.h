// Charts into a texture: turns, moves and scales them so that none comes near another.
#pragma once

#include <cstddef>
#include <functional>
#include <limits>
#include <vector>

#include "core/base/execution.h"
#include "core/mesh/mesh.h"
#include "core/pack/tuning.h"

namespace planish {

// What the search for places may cost. Work is counted in steps of the algorithms, not in seconds, so that the result
// is the same on any machine. Times in comments are those of one core of the year 2022.
enum class PackEffort {
  kFast,    // about a quarter of what the charts and their maps cost
  kNormal,  // about a quarter of that and 0.15 ms a chart, or 1.2 ms a chart, up to 12 ms, where that is more
  kBest,    // with more charts (AtlasTuning): 50 times that, or 2 s a chart, up to a minute, where that is more
};
// What packing may cost over what the charts and their maps cost.
double ShareOfRest(PackEffort effort, const PackTuning& tuning = {});

struct PackOptions {
  int texture_size = 1024;  // texels per side of a tile, in [16, 65536]
  int padding = 2;  // texels that stay free between two charts, in [0, 64]; half as many (rounded up) at the rim
  int tiles = 1;    // as many as may be used, in [1, 100]; tile t is UDIM 1001 + t
  int atlases = 1;  // with so many tiles each: those of atlas a are a * tiles and following; in [1, 100] all together
  // The search ends at this scale of a chart with density 1 (Packing::scale).
  double most_scale = std::numeric_limits<double>::infinity();
  PackEffort effort = PackEffort::kNormal;
  PackTuning tuning = {};

  static constexpr int kTilesInRow = 10;  // of UDIM: side by side, then the next row above
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
  double padding = 0;                  // texels kept: options.padding, or less where there are too many charts for that
  double efficiency = 0;               // area of the faces over that of the tiles used
};

// ChartPlacement::scale of a chart all of whose points lie within `radius` of its middle, among so many charts, where
// one with density 1 has `scale`: `density` times that, unless the chart would be smaller than a texel.
double DrawnScale(double radius, double density, double scale, std::size_t charts, const PackOptions& options);

// How far a chart may be moved after packing, in sides of a tile, and still keep the padding to others.
inline constexpr double kFreeMove = 1e-6;

// Packs the charts at the largest scale that the search finds, up to PackOptions::most_scale. All atlases have one
// scale, which the fullest of them decides. Any two charts keep a distance of `padding` texels and a little more, so
// that rounding to float does not bring them nearer, nor moving each by kFreeMove; where there is no room for that,
// Packing::padding says what is kept. Faces of one chart may lie on each other. Charts are turned, not mirrored. A
// chart that would be smaller than a texel is enlarged to one, or to what there is room for. Positions must be finite.
//
// How: at one scale after the other, charts are laid on bit grids (trial.h), from large to small, each where it lies
// snuggest. With the work that is left, unless there are too many charts for it, the scale goes up, and charts find new
// places, are pushed apart and grow until they are jammed, again and again (tighten.h). In the end, distances are
// measured exactly (tighten.cc). libnest2d, which Debian has, searches for no scale: it lays polygons of a given one
// at turns from a given list, by default by their convex hulls.
//
// Deterministic: the result depends neither on the number of threads nor on where the charts lie at first. Thread-safe.
// Work is near-linear in the number of charts. After a stop request the first places that keep the distances stand.
// After a cancellation the result is incomplete and must not be used.
Packing Pack(std::vector<PackChart> charts, const PackOptions& options, const Execution& execution = {});
// The same of `count` charts that are made one after the other by make_chart(i), and not kept: all of them may take as
// much memory as packing them.
Packing Pack(std::size_t count, const std::function<PackChart(std::size_t)>& make_chart, const PackOptions& options,
             const Execution& execution = {});

}  // namespace planish
