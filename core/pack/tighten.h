// From a packing with gaps to a tight one at a larger scale.
#pragma once

#include <cstdint>
#include <vector>

#include "core/base/execution.h"
#include "core/pack/outline.h"
#include "core/pack/relax.h"

namespace planish {

struct TightenOptions {
  double distance = 0;  // kept between two charts, in the texture
  double low = 0;       // charts stay within [low, 1 - low]^2
  int tiles = 1;
  double first_step = 0.03;  // growth that is tried first
  std::int64_t moves = 0;    // of single charts, to be spent about
};

struct Layout {
  std::vector<Body> bodies;
  double scale = 1;  // charts are scaled by this times their relative scale
};

// Scales up by some percent, lets charts find new places until they are apart (rearrange.h), lets them grow until they
// are jammed (relax.h); and so on until that leads nowhere or has taken enough work, which is counted in steps, not in
// seconds. *layout must keep the distances; what comes out keeps them exactly (clearance.h) at the same scale or a
// larger one.
void Tighten(const std::vector<Outline>& outlines, const std::vector<double>& relative_scales,
             const TightenOptions& options, const Execution& execution, Layout* layout);

// Shrinks charts by `factor`, below 1, about their centres, and moves those away that come too near to each other by
// that (what lies in a bay does).
void Loosen(const std::vector<Outline>& outlines, const std::vector<double>& relative_scales,
            const TightenOptions& options, double factor, const Execution& execution, Layout* layout);

}  // namespace planish
