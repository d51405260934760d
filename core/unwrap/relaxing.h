// Maps that are sound, but stretched: their vertices move to where they are stretched less.
#pragma once

#include <vector>

#include "core/base/execution.h"
#include "core/mesh/mesh.h"
#include "core/unwrap/chart.h"

namespace planish {

// Lowers the stretch of a map of a chart that does not overlap itself: the energy of Smith and Schaefer ("Bijective
// parameterization with free boundaries", 2015), the area-weighted squares of all singular values and of their
// inverses, by the method of quasi-Newton steps that begin with the Laplacian (Liu, Bouaziz and Kavan 2017). The
// outline is free. No step turns a triangle over, and a step after which the map would overlap itself is shortened;
// where that does not help, the vertices of the triangles that meet stay from then on. Angles are not kept. Faces
// marked in `ignored` (per face of the mesh; empty: none), widened ones and those without area do not count, but keep
// their orientation.
//
// At most 200 steps of O(F log F) each, and one sparse factorization. Deterministic. Ends early after a stop request or
// a cancellation; what it returns is always as sound as `map`. Positions are in the units of the surface.
std::vector<Vec2> RelaxedPositions(const Mesh& mesh, const Chart& chart, const ChartMap& map,
                                   const std::vector<char>& ignored, const Execution& execution);

}  // namespace planish
