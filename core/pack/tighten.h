// Turns a packing with gaps into a tight one at a larger scale.
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
  std::int64_t work = 0;  // limit in about nanoseconds, counted in steps of the algorithms
  double most_scale = std::numeric_limits<double>::infinity();  // largest scale of the result
  PackTuning tuning;
};

// The charts: exact outlines, simplified ones (Simplified()) for everything but exact distances, the atlas of each, and
// the scales.
struct TightenCharts {
  const std::vector<Outline>&outlines, &simple;
  const std::vector<int>& atlas;
  const std::vector<double>& relative_scales;
};

struct Arrangement {
  std::vector<Pose> poses;
  double scale = 1;  // charts are scaled by this times their relative scale
};

// Grows the charts until they are jammed (relax.h), from each of `starts`, and continues from the best: scales up by
// some percent, lets charts find places where they overlap less (rearrange.h), shrinks them until they can be
// separated, grows them again, and so on until the work is spent. All of `starts` must keep the distances, and be in
// order of their scales. The result keeps the distances exactly (FindTooNear() in tighten.cc), at the scale of the last
// start or a larger one.
Arrangement Tighten(const TightenCharts& charts, const TightenOptions& options, const Execution& execution,
                    const std::vector<Arrangement>& starts);

// The number of charts of the atlas that has the most.
std::int64_t MostCharts(const std::vector<int>& atlas, int atlases);

}  // namespace planish
