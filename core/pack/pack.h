// Charts into a texture: turns, moves and scales them so that none comes near another.
#pragma once

#include <cstdint>
#include <vector>

#include "absl/status/statusor.h"
#include "core/base/execution.h"
#include "core/mesh/mesh.h"

namespace planish {

struct PackOptions {
  int texture_size = 1024;  // texels per side of a tile, in [16, 65536]
  int padding = 2;          // texels that stay free between two charts, in [0, 64]; half as many (rounded up) at the rim
  int tiles = 1;            // as many as may be used, in [1, 100]; tile t is UDIM 1001 + t, up to 10 in a row
};

// One chart in the plane, drawn to the scale of the surface.
struct PackChart {
  std::vector<Vec2> positions;
  std::vector<Face> faces;  // counter-clockwise
  double density = 1;       // length in the texture over length here, relative to the other charts; above 0
};

// Where a chart goes: p becomes scale * (R p) + offset, R being the turn by `angle` (radians, counter-clockwise).
struct ChartPlacement {
  double angle = 0;
  double scale = 1;
  Vec2 offset = Vec2::Zero();  // tile included: tile t spans [t % 10, t % 10 + 1] x [t / 10, t / 10 + 1]
  int tile = 0;

  Vec2 operator()(const Vec2& p) const;
};

struct Packing {
  std::vector<ChartPlacement> charts;  // in the order given
  int tiles = 1;                       // used
  double scale = 1;                    // of a chart with density 1
};

// Deterministic; the same result for any number of threads. No reflections. Of no use after an interrupt.
Packing Pack(const std::vector<PackChart>& charts, const PackOptions& options, const Execution& execution = {});

}  // namespace planish
