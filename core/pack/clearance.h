// The judge of a packing: exact distances between charts, nothing rasterized or sampled.
#pragma once

#include <cstdint>
#include <vector>

#include "core/base/execution.h"
#include "core/pack/outline.h"
#include "core/pack/relax.h"

namespace planish {

struct TooNear {
  std::int32_t a, b;  // charts; b is -1 for the rim of the tile
  double missing;     // from the distance that should be kept; all of it where charts overlap
};

// What is nearer to each other than `distance`, or out of [low, 1 - low]^2, with charts scaled by `scales`.
std::vector<TooNear> FindTooNear(const std::vector<Outline>& outlines, const std::vector<double>& scales,
                                 const std::vector<Body>& bodies, double distance, double low,
                                 const Execution& execution);

}  // namespace planish
