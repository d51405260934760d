// Where to cut a chart so that its parts pack better than the whole: across arms and necks.
#pragma once

#include <cstdint>
#include <vector>

#include "core/mesh/mesh.h"

namespace planish {

struct NeckOptions {
  double least_gain = 0;  // the gain that a cut must have, an area
  double width = 0;       // a cut costs the area of a strip of this width along it
};

// A chord between two points of an outline, given by their indices; from < to.
struct Neck {
  std::int32_t from = -1, to = -1;
  // The gain of this cut, but at most that of the cut that must come before it. So the necks above any gain can be cut
  // without the others.
  double gain = 0;
};

// Finds cuts of a chart. `outline` is its outline, a simple polygon that runs counter-clockwise. The gain of a cut is
// the area of the part's convex hull minus the areas of the hulls of the two new parts, minus the cost of the cut. Each
// part is cut where the gain is largest, until no gain reaches least_gain. No two chords cross. Only the few dozen
// points that describe a part's shape best are considered. Takes O(n) for each cut, plus a fixed amount of work.
std::vector<Neck> FindNecks(const std::vector<Vec2>& outline, const NeckOptions& options);

}  // namespace planish
