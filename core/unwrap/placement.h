// Where a single chart lies in the unit square.
#pragma once

#include <vector>

#include "core/base/execution.h"
#include "core/mesh/mesh.h"

namespace planish {

// Turns the points so that the rectangle of least area round `outline`, those of them on the outline, is upright, its
// longer side along u, then moves and scales all uniformly into [0, 1]^2, touching u = 0, v = 0 and u = 1. No
// reflection. O(n), and O(h log h) in the points of the outline. Returns the factor by which lengths grew; 1 for points
// that are all the same. After a cancellation the points may be anywhere.
double PlaceInUnitSquare(std::vector<Vec2> outline, std::vector<Vec2>* points, const Execution& execution = {});

}  // namespace planish
