// Parts of a chart that pack better than the whole.
#pragma once

#include <cstdint>
#include <vector>

#include "core/charts/surface.h"
#include "core/unwrap/chart.h"

namespace planish {

// Per face of the chart, in the order of chart.faces: its part, from 0 on; empty if the chart is to stay whole. Cuts
// run across arms and necks of the map (core/pack/necks.h), from face to face, and never between faces that must be
// glued; parts are connected. `total_area` is that of all charts' maps, of which there are `num_charts`.
std::vector<std::int32_t> PartAtNecks(const Surface& surface, const Chart& chart, const ChartMap& map,
                                      double total_area, int num_charts);

}  // namespace planish
