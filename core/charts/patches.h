// Small patches of faces that look the same way: what charts are made of.
#pragma once

#include <cstdint>
#include <vector>

#include "core/charts/surface.h"
#include "core/charts/tuning.h"

namespace planish {

// Per face: the number of its patch, ascending with the lowest face of each; -1 for faces that take no part. Patches
// are connected and follow no uncut edge. Neighbours are joined as long as the mean normal stays longer than a set part
// of 1, those with the most similar normals first (hierarchical face clustering, Garland et al. 2001): a patch of a
// sphere spans about 33 degrees from its middle. Costs are rounded to 1e-7, so that rigid motion and scale change
// nothing. O(F log F).
std::vector<std::int32_t> MakePatches(const Surface& surface, const AtlasTuning& tuning,
                                      const Execution& execution = {});

}  // namespace planish
