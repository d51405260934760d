// Where to cut a chart so that its parts pack better than the whole: across arms and necks.
#pragma once

#include <cstdint>
#include <utility>
#include <vector>

#include "core/mesh/mesh.h"

namespace planish {

struct NeckOptions {
  double least_gain = 0;  // of area between the outline and its convex hull, per cut
  double width = 0;       // what a cut costs: this times its length
};

// Chords between two points of `outline`, a simple polygon run round counter-clockwise: indices (i, j), i < j. Each
// cuts the part that it lies in in two, and the hulls of the two have less area between them than that of the part, by
// least_gain and what the cut costs; the best cuts first. No chords cross. O(n) for each cut in the number of points,
// beside a fixed amount of work: of an outline with many points only those that matter most are looked at.
std::vector<std::pair<std::int32_t, std::int32_t>> FindNecks(const std::vector<Vec2>& outline,
                                                             const NeckOptions& options);

}  // namespace planish
