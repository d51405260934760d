// Packs charts into a texture: rotates, moves and scales them so that they keep their distance.
#pragma once

#include <cstddef>
#include <functional>
#include <limits>
#include <vector>

#include "core/base/execution.h"
#include "core/mesh/mesh.h"
#include "core/pack/tuning.h"

namespace planish {

// How much work packing may take. Work is counted in steps of the algorithms, not in seconds, so that the result is the
// same on any machine. Times in comments are those of one core of the year 2022.
enum class PackEffort {
  kFast,    // about a quarter of the cost of the charts and their maps
  kNormal,  // about a quarter of that cost plus 0.15 ms a chart; at least 1.2 ms a chart, up to 12 ms
  kBest,    // 50 times that cost, at least 2 s a chart, up to a minute; makes more charts (AtlasTuning)
};
// The cost of packing relative to that of the charts and their maps.
double ShareOfRest(PackEffort effort, const PackTuning& tuning = {});

struct PackOptions {
  int texture_size = 1024;  // texels per side of a tile, in [16, 65536]
  int padding = 2;          // texels kept free between two charts, in [0, 64]; half of that (rounded up) at the rim
  int tiles = 1;            // tiles that may be used, in [1, 100]; tile t is UDIM 1001 + t
  int atlases = 1;          // each with `tiles` tiles: atlas a has those from a * tiles on; in [1, 100] tiles in total
  // The search ends at this scale of a chart with density 1 (Packing::scale).
  double most_scale = std::numeric_limits<double>::infinity();
  PackEffort effort = PackEffort::kNormal;
  PackTuning tuning = {};

  static constexpr int kTilesInRow = 10;  // UDIM: side by side, then the next row above
};

// One chart in the plane, at the scale of the surface.
struct PackChart {
  std::vector<Vec2> positions;
  std::vector<Face> faces;  // counter-clockwise
  double density = 1;       // texel density relative to other charts: length in the texture over length here; above 0
  int atlas = 0;            // the atlas that it belongs to, in [0, PackOptions::atlases)
};

// Where a chart goes: p becomes scale * (R p) + offset, where R is the rotation by `angle` (radians,
// counter-clockwise).
struct ChartPlacement {
  double angle = 0;
  double scale = 1;
  Vec2 offset = Vec2::Zero();  // includes the tile: tile t spans [t % 10, t % 10 + 1] x [t / 10, t / 10 + 1]
  int tile = 0;

  Vec2 operator()(const Vec2& p) const;
};
// The lower left corner of a tile.
Vec2 CornerOfTile(int tile);

struct Packing {
  std::vector<ChartPlacement> charts;  // in the order given
  int tiles = 1;                       // number of tiles up to the last one used
  double scale = 1;                    // of charts with density 1
  double padding = 0;                  // texels kept: options.padding, or less if too many charts leave no room for it
  double efficiency = 0;               // area of the faces over area of the tiles used
};

// ChartPlacement::scale of a chart whose points lie within `radius` of its middle, among `charts` charts, where `scale`
// is that of density 1. It is `density * scale`, unless the chart would be smaller than a texel.
double DrawnScale(double radius, double density, double scale, std::size_t charts, const PackOptions& options);

// How far a chart may be moved after packing without losing the padding, in sides of a tile.
inline constexpr double kFreeMove = 1e-6;

// Packs the charts at the largest scale that the search finds, up to PackOptions::most_scale. All atlases have the same
// scale, which the fullest one decides. Any two charts keep a distance of `padding` texels, plus a little for rounding
// to float and for moving each by kFreeMove. If there is no room for that, Packing::padding says how much is kept.
// Faces of one chart may overlap each other. Charts are rotated, not mirrored. A chart that would be smaller than a
// texel is enlarged to a texel, or to the available room. Positions must be finite.
//
// Method: trials at different scales place charts on bit grids (trial.h), largest first, each where it lies snuggest.
// The remaining work, unless there are too many charts, goes into tightening (tighten.h): the scale goes up, charts
// find new places, are pushed apart and grow until they are jammed, again and again. Finally, distances are measured
// exactly (tighten.cc). Debian's libnest2d does not search for a scale: it places polygons of a given scale at a given
// list of angles, by default by their convex hulls.
//
// Deterministic: the result depends neither on the number of threads nor on the initial positions of the charts.
// Thread-safe. Work is near-linear in the number of charts. After a stop request, the first placement that keeps the
// distances is returned. After a cancellation the result is incomplete and must not be used.
Packing Pack(std::vector<PackChart> charts, const PackOptions& options, const Execution& execution = {});
// Packs `count` charts, which make_chart(i) makes one after the other. They are not kept, since all of them may take as
// much memory as packing.
Packing Pack(std::size_t count, const std::function<PackChart(std::size_t)>& make_chart, const PackOptions& options,
             const Execution& execution = {});

}  // namespace planish
