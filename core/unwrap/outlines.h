// The outlines of charts in the plane: whether they alone prove that nothing overlaps.
#pragma once

#include <cstdint>
#include <vector>

#include "core/base/execution.h"
#include "core/unwrap/verify.h"

namespace planish {

// Whether no outline of a chart meets itself or another one, no edge inside a chart is torn (its ends have the same
// (u, v) from both sides), and no chart lies inside the area of another. Exact. For maps whose triangles all have
// positive orientation. False as well after an interrupt.
bool OutlinesAreApart(const std::vector<std::int32_t>& opposite, const CornerUv& uv, const Execution& execution);

}  // namespace planish
