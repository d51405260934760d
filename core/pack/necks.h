// Where to cut a chart so that its parts pack better than the whole: across arms and necks.
#pragma once

#include <cstdint>
#include <vector>

#include "core/mesh/mesh.h"

namespace planish {

struct NeckOptions {
  double least_gain = 0;  // that a cut must bring, an area
  double width = 0;       // a cut costs the area of a strip of this width along it
};

// A chord between two points of an outline, by their indices, from < to.
struct Neck {
  std::int32_t from = -1, to = -1;
  // What a cut there gains, but at most what the cut gains that must come before it. So the necks above any gain can be
  // cut without the others.
  double gain = 0;
};

// Where to cut a chart whose outline is `outline`, a simple polygon that runs counter-clockwise. The gain of a cut is
// what it takes off the area of convex hulls, that of the part being cut minus those of its two parts, less the cost of
// the cut. Each part is cut where the gain is largest, and no further once that is below least_gain. No two chords
// cross. Only the few dozen points that show a part's shape best are looked at: O(n) for each cut, and a fixed amount
// of work.
std::vector<Neck> FindNecks(const std::vector<Vec2>& outline, const NeckOptions& options);

}  // namespace planish
