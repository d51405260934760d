// From a packing with gaps to a tight one at a larger scale.
#pragma once

#include <cstdint>
#include <limits>
#include <vector>

#include "core/base/execution.h"
#include "core/pack/outline.h"
#include "core/pack/relax.h"
#include "core/pack/tuning.h"

namespace planish {

struct TightenOptions : PackRules {
  std::int64_t work = 0;  // about what may be spent: nanoseconds, counted in steps of the algorithms
  double most_scale = std::numeric_limits<double>::infinity();  // what comes out is no larger
  PackTuning tuning;
};

// The charts: outlines, exact and as Simplified() makes them for everything but exact distances; the atlas whose tiles
// each is on; and the scales.
struct TightenCharts {
  const std::vector<Outline>&outlines, &simple;
  const std::vector<int>& atlas;
  const std::vector<double>& relative_scales;
};

struct Arrangement {
  std::vector<Pose> poses;
  double scale = 1;  // charts are scaled by this times their relative scale
};

// Lets the charts grow until they are jammed (relax.h), from each of `starts`, and goes on from the best: scales up by
// some percent, lets charts find places where they overlap less (rearrange.h), shrinks them until they can be pushed
// apart, lets them grow again, and so on until the work is spent. All of `starts` must keep the distances, each at a
// scale at least that of the one before; what comes out keeps them exactly (FindTooNear() in tighten.cc) at the scale
// of the last or a larger one.
Arrangement Tighten(const TightenCharts& charts, const TightenOptions& options, const Execution& execution,
                    const std::vector<Arrangement>& starts);

// How many charts the atlas with the most of them has.
std::int64_t MostCharts(const std::vector<int>& atlas, int atlases);

}  // namespace planish
