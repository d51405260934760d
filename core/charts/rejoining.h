// Other neighbours where more than two faces meet, once there are charts.
#pragma once

#include <array>
#include <cstdint>
#include <vector>

#include "core/charts/gluing.h"

namespace planish {

// Import joins half-edges at crowded edges (Surface::crowded_edges) before anything is known about charts, and charts
// end at many of these edges all the same. There the half-edges are free for others: returned are pairs of them, by
// corner, that were not joined before and belong to two charts, so that a chart may go on where it had to end. The
// smallest charts come first, then pairs that bend least. `chart`: per face, that of the gluing; -1 for faces without
// one. O(n) in the half-edges at crowded edges, of which at most 64 lie on one.
std::vector<std::array<std::int32_t, 2>> PairsToRejoin(const Gluing& gluing, const std::vector<std::int32_t>& chart);

}  // namespace planish
