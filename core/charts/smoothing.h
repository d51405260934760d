// Outlines without teeth.
#pragma once

#include <cstdint>
#include <vector>

#include "core/base/execution.h"
#include "core/charts/gluing.h"
#include "core/charts/tuning.h"

namespace planish {

// Hands single faces over to the disc across (or across a slit of the same one), again and again, wherever that makes
// seams shorter: a discrete curve-shortening flow, stopped after some sweeps so that seams stay about where they are.
// Seams along bends count as shorter. Discs stay discs, of the same number; no vertex of an outline opens wider than
// AtlasTuning::widest. `chart` has the disc of every face and follows; faces marked -1 there stay out. O(F). Of no use
// after a cancellation.
void SmoothOutlines(const AtlasTuning& tuning, const Execution& execution, Gluing* gluing,
                    std::vector<std::int32_t>* chart);

}  // namespace planish
