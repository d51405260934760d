// Reduces the stretch of maps without faults by moving their vertices.
#pragma once

#include <vector>

#include "core/base/execution.h"
#include "core/mesh/mesh.h"
#include "core/unwrap/chart.h"

namespace planish {

// Lowers the stretch of a chart's map that does not overlap itself. Minimizes the energy of Smith and Schaefer
// ("Bijective parameterization with free boundaries", 2015), the area-weighted squares of all singular values and of
// their inverses, by quasi-Newton steps that begin with the Laplacian (Liu, Bouaziz and Kavan 2017). The outline is
// free. No step flips a triangle, and a step after which the map would overlap itself is shortened; if that does not
// help, the vertices of the overlapping triangles are fixed from then on. Angles are not kept. Faces marked in
// `ignored` (per face of the mesh; empty: none), widened ones and those without area do not count, but keep their
// orientation.
//
// Takes at most 200 steps of O(F log F) each, and one sparse factorization. Deterministic. Ends early after a stop
// request or a cancellation; the result always has no more faults than `map`. Positions are in units of the surface.
std::vector<Vec2> RelaxedPositions(const Mesh& mesh, const Chart& chart, const ChartMap& map,
                                   const std::vector<char>& ignored, const Execution& execution);

}  // namespace planish
